"""`TOGETHER`: requests of a block that are carried out together, at its end.

Engines and cameras ask for kernels to be loaded. Kernels may neither be made nor hashed while others are being built
(`ig2mj.engine.warp.kernels.wait_for_others`), so that one engine after the other would wait for the kernels of the one
before it. Whatever is made inside a block is made first; then all kernels are loaded side by side.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from typing import Any, Protocol


class Request(Protocol):
    """What is asked for."""

    def cancel(self) -> None: ...


class Together:
    """Blocks of threads; a block inside another one is part of it."""

    def __init__(self) -> None:
        self._here = threading.local()

    @contextlib.contextmanager
    def block(self) -> Iterator[None]:
        """Requests that this thread makes inside the block are carried out at its end, or cancelled if it raises."""
        if self.active:
            yield
            return
        self._here.asked = dict[Callable[[list[Any]], None], list[Request]]()
        try:
            yield
        except BaseException:
            for requests in self._here.asked.values():
                for request in requests:
                    request.cancel()
            raise
        else:
            self.flush()
        finally:
            del self._here.asked

    @property
    def active(self) -> bool:
        """Whether this thread is inside a block."""
        return hasattr(self._here, "asked")

    def add(self, act: Callable[[list[Any]], None], request: Request) -> None:
        """Asks for a call of `act` with this and all other requests for it: at the end of the block, or now where
        there is none."""
        if self.active:
            self._here.asked.setdefault(act, []).append(request)
        else:
            act([request])

    def flush(self) -> None:
        """Carries out now what this thread has asked for."""
        if self.active:
            asked, self._here.asked = self._here.asked, {}
            for act, requests in asked.items():
                act(requests)


TOGETHER = Together()
"""Of this process."""
