"""The commands, and how errors reach people."""

from __future__ import annotations

import errno
import importlib
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from draglag.errors import DraglagError
from draglag.system.packages import missing_package
from draglag_app.cli.terminal import guard_output
from draglag_app.leftovers import sweep_for

_HERE = "draglag_app.cli"

# name → (module:function, help in one line). The line stands here so that the list of commands imports none of them.
COMMANDS: dict[str, tuple[str, str]] = {
    "demo": (f"{_HERE}.demo:demo", "Measure a simulated touchscreen from target to curve."),
    "devices": (f"{_HERE}.devices:devices", "List devices to measure with."),
    "check": (f"{_HERE}.check:check", "Is the whole rig ready? One line a check."),
    "record": (f"{_HERE}.record:record", "Measure a protocol into a new session file."),
    "simulate": (f"{_HERE}.simulate:simulate", "Make a session of a simulated screen, with effects if you like."),
    "import": (f"{_HERE}.files:import_", "Make a session file from an exchange folder or another program's recording."),
    "export": (f"{_HERE}.files:export", "Write a session as exchange folder, CSV, netCDF or MATLAB file."),
    "analyze": (f"{_HERE}.analyze:analyze", "Latency of every run, the curve, taps and validation."),
    "gap": (f"{_HERE}.gap:gap", "Where simulation and measurement disagree, why, and how the gap shrinks."),
    "validate": (f"{_HERE}.validate:validate", "What a latency model removes from another session."),
    "compensate": (f"{_HERE}.compensate:compensate", "Take the lag out of recorded touch events."),
    "compare": (f"{_HERE}.compare:compare", "How the curves of sessions differ."),
    "plan": (f"{_HERE}.plan:plan", "How sure a protocol will be of the latency, before anyone draws a circle."),
    "reproduce": (f"{_HERE}.reproduce:reproduce", "The paper's tables and figures from simulated screens."),
    "blind": (f"{_HERE}.blind:blind", "The hidden-effect benchmark (in a checkout)."),
    "verify": (f"{_HERE}.verify:verify", "Check a session file; save what an unfinished one holds."),
}

OPERATOR_WINDOW = "draglag_app.windows.main:open_operator_window"
_WINDOW = f"{_HERE}.window:open_window"
_OPEN_SESSION = f"{_HERE}.window:open_session"


# What the system says of a name that a person gave: it exists, is too long, may not be written there …
_OF_A_NAME = (
    errno.ENAMETOOLONG, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST,
    errno.ENOTEMPTY, errno.ELOOP, errno.EBUSY, errno.EXDEV, errno.ENXIO,
)  # fmt: skip
_SHOWN = 200  # characters of a name in a message


class LazyGroup(click.Group):
    """A group that imports a command when called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command = load(COMMANDS[cmd_name][0])
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Session files open the window."""
        if args[0].endswith((".h5", ".partial")):
            return args[0], load(_OPEN_SESSION), args
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> Any:
        return spoken(super().invoke, ctx)


@click.group(cls=LazyGroup, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="draglag", message="%(prog)s %(version)s")
@click.pass_context
def cli(ctx: click.Context) -> None:
    """Measure, model and compensate the drag latency of touchscreens.

    Without a command the operator window opens, with a session file on its results.

    \b
    Examples:
        draglag demo --out demo
        draglag demo/session.h5
        draglag analyze session.h5
    """
    if ctx.invoked_subcommand is None:
        ctx.exit(load(_WINDOW)())


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; exit code 0 done, 1 error of data or rig, 2 usage."""
    sweep_for(sys.argv[1:] if arguments is None else arguments)
    guard_output()
    cli.main(args=None if arguments is None else list(arguments), prog_name="draglag")


def load(place: str) -> Any:
    """``module:function`` → the function."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def spoken(action: Callable[..., Any], *arguments: Any) -> Any:
    """Run a command; an error becomes a line on stderr and exit 1, a bug also a saved traceback."""
    try:
        return action(*arguments)
    except (click.exceptions.Exit, click.ClickException, click.Abort):
        raise
    except DraglagError as error:
        click.echo(f"draglag: {error}", err=True)
    except ModuleNotFoundError as missing:
        click.echo(f"draglag: {missing_package(missing) or _unexpected(missing)}", err=True)
    except BrokenPipeError:
        # The reader (head, less) has gone: nothing to say, and nothing to say it to.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as error:
        if error.errno in _OF_A_NAME and isinstance(error.filename, str | bytes):
            name = os.fsdecode(error.filename)
            shown = name if len(name) <= _SHOWN else f"{name[:_SHOWN]}…"
            click.echo(f"draglag: {shown}: {error.strerror}. Choose another name or place.", err=True)
        elif error.errno not in (errno.ENOSPC, errno.EDQUOT):
            click.echo(f"draglag: {_unexpected(error)}", err=True)
        else:
            click.echo(
                f"draglag: the output cannot be written ({error.strerror}). Make room, then try again.", err=True
            )
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left of it has no room either
    except Exception as error:  # the one place where a bug meets people
        click.echo(f"draglag: {_unexpected(error)}", err=True)
    raise click.exceptions.Exit(1)


def _unexpected(error: Exception) -> str:
    return f"unexpected {type(error).__name__}; please report it with the file {_save_traceback()}."


def _save_traceback() -> Path:
    from platformdirs import user_log_path

    folder = user_log_path("draglag", appauthor=False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor, name = tempfile.mkstemp(prefix="error-", suffix=".log", dir=folder, text=True)
    except OSError:
        descriptor, name = tempfile.mkstemp(prefix="draglag-error-", suffix=".log", text=True)
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        file.write(f"draglag {' '.join(sys.argv[1:])}\n\n{traceback.format_exc()}")
    return Path(name)
