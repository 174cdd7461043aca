"""Commands that documentation and examples show: they are parsed, not run."""

from __future__ import annotations

import pytest
import tyro

from ig2mj import cli
from ig2mj.cli.common import parsing


def parse_only(words: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """Exit status of a command whose function does nothing."""
    real = tyro.cli

    def parse_arguments(function, **options):
        quiet = lambda *args, **given: 0  # noqa: E731  tyro reads the signature that is put on it
        quiet.__name__, quiet.__doc__, quiet.__annotations__ = (
            function.__name__,
            function.__doc__,
            function.__annotations__,
        )
        quiet.__signature__ = function.__signature__  # type: ignore[attr-defined]
        return real(quiet, **options)

    with monkeypatch.context() as patch:
        patch.setattr(parsing.tyro, "cli", parse_arguments)
        return cli.call(words)
