"""What the bus process tells its reader: one JSON object a line, written without ever waiting."""

from __future__ import annotations

import json
import os
import select
from typing import Any

_MOST_BYTES = 4 << 20


class ReaderGone(Exception):
    """Nobody reads any more, or the reader closed our input: time to end."""


class Wire:
    """Lines to ``out`` (made non-blocking); the end of ``inlet`` asks us to stop."""

    def __init__(self, inlet: int, out: int) -> None:
        self._inlet, self._out = inlet, out
        os.set_blocking(out, False)
        self._waiting = bytearray()

    def tell(self, kind: str, **content: Any) -> None:
        """Queue and send a message. Raises ReaderGone."""
        self._waiting += json.dumps({"m": kind, **content}).encode() + b"\n"
        self.flush()

    def flush(self) -> None:
        """Raises ReaderGone when the pipe is closed or was not read for far too long."""
        try:
            while self._waiting:
                del self._waiting[: os.write(self._out, self._waiting)]
        except BlockingIOError:
            if len(self._waiting) > _MOST_BYTES:
                raise ReaderGone from None
        except OSError:
            raise ReaderGone from None

    def check(self, wait_s: float = 0.0) -> None:
        """Raises ReaderGone once the reader has closed its end; waits for that at most ``wait_s``."""
        ready, _, _ = select.select([self._inlet], [], [], wait_s)
        if ready and not os.read(self._inlet, 4096):
            raise ReaderGone
