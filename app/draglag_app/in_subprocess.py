"""Long computations in a process of their own."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from draglag.errors import DataError, DraglagError, message_of
from draglag.messages import message

Progress = Callable[[float, str], None]
_POLL_S = 0.1


def run_in_subprocess(function: Callable[..., Any], arguments: tuple[Any, ...], progress: Progress) -> Any:
    """The result of ``function(*arguments, progress)`` in a new process; all picklable. Raises DraglagError.

    What ``progress``, called several times a second, raises ends the process and is raised here.
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
                raise value
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
        there.send(("fault", error))
    except Exception as error:  # reported to the caller
        there.send(("fault", DataError(message("{kind}: {error}", kind=type(error).__name__, error=error))))
    finally:
        there.close()


def close_gap_of(
    session: Any,
    without: frozenset[str],
    added: tuple[str, ...],
    kept: Any,
    path: Any,
    include: frozenset[str],
    progress: Progress,
) -> dict[str, object]:
    """The JSON of a session's gap report, and what a page shows with it.

    Args:
        without: effects that may not be named.
        added: effects to add by hand, in order.
        kept: ``report`` of an earlier result to continue.
        include: runs to use although they went wrong.

    Further keys: ``provisional``, ``overlay`` (None: ``overlay_why``), ``model``, ``report``.
    """
    import hashlib
    from datetime import UTC, datetime

    from draglag.gap import close_gap
    from draglag.gap.by_hand import add_by_hand
    from draglag.gap.provisional import provisional_term
    from draglag.gap.replaying.extended import extended_model
    from draglag.gap.wording import drift_in_analysis
    from draglag.simulation.effects import EFFECTS

    candidates = None if not without else [effect for effect in EFFECTS if effect not in without]

    def part(low: float, high: float) -> Progress:
        return lambda fraction, text: progress(low + (high - low) * fraction, text)

    report = (
        kept
        if kept is not None
        else close_gap(session, candidates=candidates, progress=part(0.0, 0.5), include=include)
    )
    if report.last is None:
        return {**report.to_dict(), "overlay": None, "model": None, "report": None}
    there = {step.effect for step in report.steps}
    for effect in added:
        if effect not in there:
            progress(0.5, effect)
            report = add_by_hand(session, report, effect)
    overlay, why = _overlay(session, report, part(0.55, 0.98))
    checksum = hashlib.sha256(path.read_bytes()).hexdigest() if path is not None and path.is_file() else ""
    unnamed = provisional_term(report)
    model = extended_model(session, report, datetime.now(UTC).isoformat(timespec="seconds"), checksum)
    return {
        **report.to_dict(),
        "drift_in_analysis": drift_in_analysis(session, report),
        "overlay": overlay,
        "overlay_why": why,
        "provisional": None if unnamed is None else unnamed.to_dict(),
        "model": model.model_dump(mode="json"),
        "report": report,
    }


def write_gap_of(session: Any, report: Any, path: Any, progress: Progress) -> None:
    """Write a gap report's page, with the provisional term that the window shows. Raises DataError."""
    from draglag.gap.provisional import provisional_term
    from draglag.report.gap import write_gap_report

    write_gap_report(session, report, path, progress, provisional_term(report))


def _overlay(session: Any, report: Any, progress: Progress) -> tuple[Any, str]:
    from draglag.gap.replaying.replay import replays
    from draglag.report.replayed import overlay_numbers

    try:
        return overlay_numbers(replays(session, report, progress), report), ""
    except (DraglagError, ValueError) as problem:
        return None, message_of(problem)
