"""Asks for another place where nothing can be saved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from draglag.errors import DataError, DraglagError
from draglag.messages import message
from draglag.store import SessionWriter
from draglag_app.session import events
from draglag_app.session.control import Control
from draglag_app.session.saver import Saver


def resume_elsewhere(saver: Saver, control: Control, emit: events.Listener) -> bool:
    """Whether saving goes on, as a place was named."""

    def go_on(place: Path | None) -> None:
        saver.call(lambda: saver.resume(place))

    return control.has_place and _request_place(saver.failure, saver.path, go_on, control, emit, stoppable=True)


def close(writer: SessionWriter, control: Control, emit: events.Listener) -> Path:
    """The session file, elsewhere if necessary. Raises DataError: the journal remains."""
    try:
        return writer.close()
    except DataError as error:
        failure = error

    def go_on(place: Path | None) -> None:
        if place is not None:
            writer.move(place)
        writer.close()

    if not control.has_place or not _request_place(failure, writer.path, go_on, control, emit, stoppable=False):
        raise elsewhere(failure, writer.partial)
    return writer.path


def elsewhere(failure: DraglagError, partial: Path) -> DataError:
    """The failure with its remedy."""
    return DataError(
        failure.problem,
        message("Make room on the disk, then `draglag verify {file}`, or save it elsewhere with --out", file=partial),
    )


def _request_place(
    failure: DraglagError | None,
    path: Path,
    go_on: Callable[[Path | None], None],
    control: Control,
    emit: events.Listener,
    stoppable: bool,
) -> bool:
    while failure is not None:
        emit(events.PlaceWanted(path, failure.problem, failure.remedy))
        answer = control.wait_for_place(stoppable)
        if answer is None:
            return False
        folder = answer.folder
        try:
            go_on(None if folder is None else folder / path.name)
        except DraglagError as error:
            failure = error
        else:
            return True
    return True
