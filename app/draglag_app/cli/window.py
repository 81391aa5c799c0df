"""Opening the operator window from the command line, and saying why it cannot open."""

from __future__ import annotations

import os
from pathlib import Path

import click

from draglag.errors import DataError, DraglagError
from draglag_app.cli.main import OPERATOR_WINDOW, load

# One of these says where Qt draws; without any it ends the whole program.
_WHERE_TO_DRAW = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")


def need_display() -> None:
    """Raises DraglagError where Qt has nothing to draw on."""
    if not any(os.environ.get(name) for name in _WHERE_TO_DRAW):
        raise DraglagError(
            "there is no display to draw on", "Start it from a desktop, or use a command that needs none"
        )


def open_window(session: Path | None = None) -> int:
    """The exit code of the operator window, once it is closed; it opens on the results of a session file.

    Raises DraglagError where there is no display, or where a library that Qt needs is missing.
    """
    need_display()
    try:
        opener = load(OPERATOR_WINDOW)
    except ImportError as error:
        if "cannot open shared object file" not in str(error):
            raise
        library = str(error).partition(":")[0]
        raise DraglagError(
            f"the operator window needs {library}, which is not installed", "./run app in a checkout says how to get it"
        ) from error
    return int(opener(session) or 0)


@click.command("SESSION.h5", hidden=True)
@click.argument("session", type=click.Path(path_type=Path))
@click.pass_context
def open_session(ctx: click.Context, session: Path) -> None:
    """Open the operator window on the results of a session file."""
    if not session.is_file():
        raise DataError(f"{session}: there is no such file", "Check the name")
    ctx.exit(open_window(session))
