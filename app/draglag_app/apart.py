"""Long computations in a process of their own, so that they neither hold up a recording nor outlive a cancel. No Qt."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from draglag.errors import DataError, DraglagError

Progress = Callable[[float, str], None]
_POLL_S = 0.1


def run_apart(function: Callable[..., Any], arguments: tuple[Any, ...], progress: Progress) -> Any:
    """``function(*arguments, progress)`` in a new process; returns its result.

    Function, arguments and result must be picklable. ``progress`` is called several times a second with what the
    function told last; whatever it raises ends the process and is raised here.

    Raises DataError with the function's own sentence when it fails, or when the process ends without a result.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_child, args=(there, function, arguments), daemon=True)
    process.start()
    there.close()
    fraction, text = 0.0, ""
    try:
        while True:
            progress(fraction, text)
            if not here.poll(_POLL_S):
                continue
            kind, value = here.recv()
            if kind == "progress":
                fraction, text = value
            elif kind == "result":
                return value
            else:
                raise DataError(value)
    except EOFError:
        raise DataError("the computation ended without a result", "try again") from None
    finally:
        if process.is_alive():
            process.terminate()
        process.join()
        here.close()


def _child(there: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    def progress(fraction: float, text: str) -> None:
        there.send(("progress", (fraction, text)))

    try:
        there.send(("result", function(*arguments, progress)))
    except DraglagError as error:
        there.send(("fault", str(error)))
    except Exception as error:  # told to whoever asked
        there.send(("fault", f"{type(error).__name__}: {error}"))
    finally:
        there.close()


def close_gap_of(session: Any, without: frozenset[str], progress: Progress) -> dict[str, object]:
    """The gap report of a session as the design's JSON; effects in ``without`` may not be named."""
    from draglag.gap import close_gap
    from draglag.simulation.effects import EFFECTS

    candidates = None if not without else [effect for effect in EFFECTS if effect not in without]
    return close_gap(session, candidates=candidates, progress=progress).to_dict()
