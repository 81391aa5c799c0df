"""A disk that fills up while a session is recorded: the operator reads it, and what was saved stays."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable

import pytest
from PySide6.QtWidgets import QApplication

from app.windows.conftest import wait_until
from draglag.store import SessionWriter, read_session
from draglag_app.windows.window import OperatorWindow


def test_a_full_disk_is_told_plainly_and_keeps_what_was_saved(
    qapp: QApplication, open_window: Callable[..., OperatorWindow], monkeypatch: pytest.MonkeyPatch
) -> None:
    append = SessionWriter.append_laser

    def full(self: SessionWriter, run_id: str, trace: object) -> None:
        if run_id == "run-03":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        append(self, run_id, trace)

    monkeypatch.setattr(SessionWriter, "append_laser", full)
    window = open_window()
    window.ask("start")
    wait_until(qapp, lambda: not window.space.recording.active and not window.space.tasks.running)
    told = window.notice_text.text()
    assert "No space left on device" in told
    assert ".partial" in told
    # What to do, not only what is wrong.
    assert "Make room" in told
    assert window.notice.property("level") == "error"
    # A new session can be begun, and nothing claims that this one was saved.
    assert window.record.buttons["start"].isVisibleTo(window)
    assert "Saved" not in told
    (left,) = list((window.space.recording.order.out.parent).glob("*.partial"))
    assert [run.outcome for run in read_session(left).runs][:2] == ["complete", "complete"]
