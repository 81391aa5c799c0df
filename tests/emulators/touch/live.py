"""Starting the live touchscreen, and the environment in which others see it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).parent
SYSTEM_PYTHON = "/usr/bin/python3"
_INSTALL = "sudo apt-get install -y umockdev gir1.2-umockdev-1.0 python3-gi"
EV_KEY, EV_ABS, BTN_TOUCH = 1, 3, 0x14A
ABS_X, ABS_Y, SLOT, MT_X, MT_Y, TRACKING = 0x00, 0x01, 0x2F, 0x35, 0x36, 0x39


def why_not() -> str:
    """Why the live touchscreen cannot run here, or ""."""
    if shutil.which("umockdev-wrapper") is None or not os.path.exists(SYSTEM_PYTHON):
        return f"umockdev is not installed: {_INSTALL}"
    probe = "import gi; gi.require_version('UMockdev', '1.0'); from gi.repository import UMockdev"
    if subprocess.run([SYSTEM_PYTHON, "-c", probe], capture_output=True, check=False).returncode:
        return f"umockdev's Python binding is not installed: {_INSTALL}"
    return ""


def contact(slot: int, number: int, x: int, y: int) -> list[list[int]]:
    """Events that put a contact down."""
    return [[EV_ABS, SLOT, slot], [EV_ABS, TRACKING, number], *moved(slot, x, y)[1:]]


def moved(slot: int, x: int, y: int) -> list[list[int]]:
    return [[EV_ABS, SLOT, slot], [EV_ABS, MT_X, x], [EV_ABS, MT_Y, y]]


def lifted(slot: int) -> list[list[int]]:
    return [[EV_ABS, SLOT, slot], [EV_ABS, TRACKING, -1]]


def pressed(x: int, y: int) -> list[list[int]]:
    """Events that touch a panel without slots."""
    return [[EV_KEY, BTN_TOUCH, 1], [EV_ABS, ABS_X, x], [EV_ABS, ABS_Y, y]]


class LiveTouch:
    """A touchscreen only processes with ``environment()`` can see. A context manager; ``node`` is its path."""

    def __init__(self, **options: object) -> None:
        """``options``: of ``panel.Panel`` (name, width, height, resolution, fuzz, slots)."""
        self._options = options

    def __enter__(self) -> LiveTouch:
        command = ["umockdev-wrapper", SYSTEM_PYTHON, str(HERE / "server.py"), json.dumps(self._options)]
        self._server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        hello = json.loads(self._answer())
        self.root, self.node = hello["root"], hello["node"]
        return self

    def __exit__(self, *error: object) -> None:
        assert self._server.stdin is not None
        self._server.stdin.close()
        try:
            self._server.wait(5)
        except subprocess.TimeoutExpired:
            self._server.kill()
            self._server.wait()
        self._server.stdout.close()

    def environment(self) -> dict[str, str]:
        """For processes that shall see the touchscreen."""
        preload = ":".join(filter(None, ["libumockdev-preload.so.0", os.environ.get("LD_PRELOAD", "")]))
        return dict(os.environ, LD_PRELOAD=preload, UMOCKDEV_DIR=self.root)

    def _answer(self) -> str:
        line = self._server.stdout.readline() if self._server.stdout else ""
        if not line:
            raise RuntimeError("the emulated touchscreen did not start or died")
        return line

    def do(self, what: str, **parameters: object) -> dict[str, object]:
        """One command of ``server.py``."""
        assert self._server.stdin is not None
        self._server.stdin.write(json.dumps({"do": what, **parameters}) + "\n")
        self._server.stdin.flush()
        return json.loads(self._answer())

    def frame(self, events: list[list[int]], at_s: float | None = None) -> None:
        self.do("frame", events=events, at=at_s)

    def frames(self, timed: list[tuple[float, list[list[int]]]], ahead_s: float = 0.0) -> None:
        """Events at their times, handed over at once; ``ahead_s`` before their stamps."""
        self.do("frames", frames=timed, ahead=ahead_s)
