"""What tests register is forgotten after them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from ig2mj.plugins import KINDS, registry_of


@contextlib.contextmanager
def restored() -> Iterator[None]:
    """What is registered inside the block is forgotten after it."""
    before = {kind: registry_of(kind).registered() for kind in KINDS}
    try:
        yield
    finally:
        for kind, things in before.items():
            registry_of(kind).restore(things)


def forget() -> None:
    """Nothing is registered."""
    for kind in KINDS:
        registry_of(kind).restore({})
