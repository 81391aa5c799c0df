"""Opening the operator window."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import click

from draglag.errors import DataError, DraglagError
from draglag.messages import message
from draglag.system.packages import need
from draglag_app.cli.main import OPERATOR_WINDOW, load

WINDOW_MODULES = ("PySide6", "pyqtgraph")

_REMEDY = message("Start it from a desktop, or use a command that needs none")
_NEED_NONE = ("offscreen", "minimal")  # platforms of Qt that draw into memory
_TIMEOUT_S = 20.0  # Qt starts within half a second; a display that does not answer may take for ever


def need_display() -> None:
    """Raises DraglagError without a display: Qt would end the program."""
    display, platform = os.environ.get("DISPLAY", ""), os.environ.get("QT_QPA_PLATFORM", "")
    if platform in _NEED_NONE:
        return
    if not (display or os.environ.get("WAYLAND_DISPLAY") or platform):
        raise DraglagError("there is no display to draw on", _REMEDY)
    if _on_x():
        if not display or not _x_answers():
            raise DraglagError(message("the display {display} does not answer", display=display or "of X"), _REMEDY)
    elif not _qt_starts():
        where = f"QT_QPA_PLATFORM={platform}" if platform else f"WAYLAND_DISPLAY={os.environ['WAYLAND_DISPLAY']}"
        raise DraglagError(message("Qt cannot draw on the display that is set ({where})", where=where), _REMEDY)


def _qt_starts() -> bool:
    """Whether Qt starts, tried in another process, which it may end."""
    trial = [sys.executable, "-c", "from PySide6.QtGui import QGuiApplication; QGuiApplication([])"]
    try:
        done = subprocess.run(trial, stdin=subprocess.DEVNULL, capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        return False
    # A missing module or library is no matter of the display: whoever opens the window says which.
    return done.returncode >= 0


def open_window(session: Path | None = None) -> int:
    """The operator window's exit code. Raises DraglagError."""
    need(*WINDOW_MODULES)
    need_display()
    try:
        opener = load(OPERATOR_WINDOW)
        if _on_x():
            _load_x_plugin()
    except (ImportError, OSError) as error:
        if "cannot open shared object file" not in str(error):
            raise
        library = str(error).partition(":")[0]
        raise DraglagError(
            message("the operator window needs {library}, which is not installed", library=library),
            "./run app in a checkout says how to get it",
        ) from error
    return int(opener(session) or 0)


def _on_x() -> bool:
    return not os.environ.get("WAYLAND_DISPLAY") and os.environ.get("QT_QPA_PLATFORM", "xcb") in ("", "xcb")


def _x_answers() -> bool:
    try:
        xcb = ctypes.CDLL("libxcb.so.1")
    except OSError:
        return True
    xcb.xcb_connect.restype = ctypes.c_void_p
    connection = ctypes.c_void_p(xcb.xcb_connect(None, None))
    refused = xcb.xcb_connection_has_error(connection)
    xcb.xcb_disconnect(connection)
    return not refused


def _load_x_plugin() -> None:
    qt = importlib.util.find_spec("PySide6")
    for folder in (qt.submodule_search_locations or []) if qt else []:
        plugin = Path(folder) / "Qt" / "plugins" / "platforms" / "libqxcb.so"
        if plugin.is_file():
            ctypes.CDLL(str(plugin))


@click.command("SESSION.h5", hidden=True)
@click.argument("session", type=click.Path(path_type=Path))
@click.pass_context
def open_session(ctx: click.Context, session: Path) -> None:
    """Open the operator window on the results of a session file."""
    if not session.is_file():
        raise DataError(message("{session}: there is no such file", session=session), "Check the name")
    ctx.exit(open_window(session))
