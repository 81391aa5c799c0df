"""A disk that fills up while a session is recorded: the operator reads it, and the session goes on elsewhere."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication, QFileDialog

from app.windows.conftest import wait_until
from draglag.protocol.runs import expand
from draglag.recording import Session
from draglag.store import read_session
from draglag.store.frames import FrameFile
from draglag_app.windows.another_place import AnotherPlace
from draglag_app.windows.window import OperatorWindow


@contextmanager
def full(monkeypatch: pytest.MonkeyPatch, folder: Path, after: int) -> Iterator[list[int]]:
    """The folder takes so many records, and no more until the list that comes back holds something."""
    append, written, room = FrameFile.append, [0], list[int]()

    def filling(self: FrameFile, payload: bytes) -> None:
        written[0] += 1
        if self.path.parent == folder and written[0] > after and not room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        append(self, payload)

    with monkeypatch.context() as patch:
        patch.setattr(FrameFile, "append", filling)
        yield room


def question(qapp: QApplication, window: OperatorWindow) -> AnotherPlace:
    """What the operator is asked, once the disk is full."""
    wait_until(qapp, lambda: window.findChild(AnotherPlace) is not None)
    dialog = window.findChild(AnotherPlace)
    assert dialog is not None
    return dialog


def folder_of(window: OperatorWindow) -> Path:
    return Path(window.space.settings.folder)


def assert_all_planned_runs_are_whole(window: OperatorWindow, session: Session) -> None:
    """Those that the full disk spoilt were recorded once more."""
    order = window.space.recording.order
    assert order is not None
    planned = {planned.id for planned in expand(order.protocol, order.options.screen, beam=order.options.beam)}
    whole = {"-".join(run.id.split("-")[:2]) for run in session.runs if run.outcome == "complete"}
    assert whole == planned
    assert {run.outcome for run in session.runs} <= {"complete", "failed"}


def test_the_session_goes_on_in_another_folder_and_nothing_is_lost(
    qapp: QApplication, open_window: Callable[..., OperatorWindow], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    window = open_window()
    with full(monkeypatch, folder_of(window), 12):
        window.ask("start")
        dialog = question(qapp, window)
        assert "No space left on device" in dialog.text.text()
        assert "Make room" in dialog.text.text()
        assert ".partial" in dialog.text.text()
        (tmp_path / "stick").mkdir()
        dialog.other.click()
        chooser = dialog.findChild(QFileDialog)
        assert chooser is not None
        chooser.setDirectory(str(tmp_path / "stick"))
        chooser.accept()
        wait_until(qapp, lambda: not window.space.recording.active and not window.space.tasks.running)
    (path,) = (tmp_path / "stick").glob("*.h5")
    session = read_session(path)
    assert_all_planned_runs_are_whole(window, session)
    assert list(folder_of(window).glob("*.h5*")) == []
    assert window.findChild(AnotherPlace) is None


def test_the_session_goes_on_where_it_was_once_there_is_room(
    qapp: QApplication, open_window: Callable[..., OperatorWindow], monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window()
    with full(monkeypatch, folder_of(window), 12) as room:
        window.ask("start")
        dialog = question(qapp, window)
        dialog.again.click()  # nothing was deleted yet: asked again
        wait_until(qapp, lambda: window.findChild(AnotherPlace) not in (None, dialog))
        room.append(1)
        question(qapp, window).again.click()
        wait_until(qapp, lambda: not window.space.recording.active and not window.space.tasks.running)
    (path,) = folder_of(window).glob("*.h5")
    assert_all_planned_runs_are_whole(window, read_session(path))


def test_a_session_ended_on_a_full_disk_keeps_what_was_saved(
    qapp: QApplication, open_window: Callable[..., OperatorWindow], monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window()
    with full(monkeypatch, folder_of(window), 12):
        window.ask("start")
        question(qapp, window).end.click()
        wait_until(qapp, lambda: not window.space.recording.active and not window.space.tasks.running)
    reported = window.notice_text.text()
    assert "No space left on device" in reported
    assert ".partial" in reported
    # What to do, not only what is wrong.
    assert "Make room" in reported
    assert window.notice.property("level") == "error"
    # A new session can be begun, and nothing claims that this one was saved.
    assert window.record.buttons["start"].isVisibleTo(window)
    assert "Saved" not in reported
    (left,) = folder_of(window).glob("*.partial")
    assert len(read_session(left).runs) >= 1
