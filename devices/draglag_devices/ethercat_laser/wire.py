"""Messages of the bus process: JSON, one object a line."""

from __future__ import annotations

import json
import os
import select
from typing import Any

from draglag.messages import packed

_MOST_BYTES = 4 << 20


class ReaderGone(Exception):
    """The reader closed its end."""


class Wire:
    """Lines to ``out``, which is made non-blocking, until the end of ``inlet``; then methods raise ReaderGone."""

    def __init__(self, inlet: int, out: int) -> None:
        self._inlet, self._out = inlet, out
        os.set_blocking(out, False)
        self._waiting = bytearray()

    def send(self, kind: str, **content: Any) -> None:
        """Queue and send a message."""
        self.pass_on(json.dumps({"m": kind, **packed(content)}).encode())

    def pass_on(self, line: bytes) -> None:
        """Queue and send an encoded line."""
        self._waiting += line + b"\n"
        self.flush()

    def flush(self) -> None:
        """Send what the pipe takes; ReaderGone also where 4 MiB wait."""
        try:
            while self._waiting:
                del self._waiting[: os.write(self._out, self._waiting)]
        except BlockingIOError:
            if len(self._waiting) > _MOST_BYTES:
                raise ReaderGone from None
        except OSError:
            raise ReaderGone from None

    def drain(self) -> None:
        """Send all, blocking."""
        os.set_blocking(self._out, True)
        self.flush()

    def check(self, wait_s: float = 0.0) -> None:
        """Raise ReaderGone if the reader closes its end within ``wait_s``."""
        self.wait(None, wait_s)

    def wait(self, source: int | None, wait_s: float) -> bool:
        """Whether ``source`` is readable in time."""
        sources = [self._inlet] if source is None else [self._inlet, source]
        ready, _, _ = select.select(sources, [], [], wait_s)
        if self._inlet in ready and not os.read(self._inlet, 4096):
            raise ReaderGone
        return source is not None and source in ready
