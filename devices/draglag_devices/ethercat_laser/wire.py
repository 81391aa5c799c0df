"""Messages of the bus process to its reader: one JSON object a line, written without ever waiting.

Words for people in them keep their template and arguments (``draglag.messages``).
"""

from __future__ import annotations

import json
import os
import select
from typing import Any

from draglag.messages import packed

_MOST_BYTES = 4 << 20


class ReaderGone(Exception):
    """Nobody reads any more, or the reader closed our input: time to end."""


class Wire:
    """Lines to ``out`` (made non-blocking); the end of ``inlet`` asks us to stop."""

    def __init__(self, inlet: int, out: int) -> None:
        self._inlet, self._out = inlet, out
        os.set_blocking(out, False)
        self._waiting = bytearray()

    def send(self, kind: str, **content: Any) -> None:
        """Queue and send a message. Raises ReaderGone."""
        self.pass_on(json.dumps({"m": kind, **packed(content)}).encode())

    def pass_on(self, line: bytes) -> None:
        """Queue and send a message that is a line already. Raises ReaderGone."""
        self._waiting += line + b"\n"
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

    def drain(self) -> None:
        """Send what is still queued, however long the reader takes. Raises ReaderGone."""
        os.set_blocking(self._out, True)
        self.flush()

    def check(self, wait_s: float = 0.0) -> None:
        """Raises ReaderGone once the reader has closed its end; waits for that at most ``wait_s``."""
        self.wait(None, wait_s)

    def wait(self, source: int | None, wait_s: float) -> bool:
        """Whether there is something to read from ``source``, within the time. Raises ReaderGone as ``check`` does."""
        sources = [self._inlet] if source is None else [self._inlet, source]
        ready, _, _ = select.select(sources, [], [], wait_s)
        if self._inlet in ready and not os.read(self._inlet, 4096):
            raise ReaderGone
        return source is not None and source in ready
