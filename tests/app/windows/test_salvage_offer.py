"""Recordings that were cut short are saved at the next start, elsewhere where their disk is full."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox

from app.windows.conftest import wait_until
from core.store_sessions import full_session
from draglag.store import SessionWriter, read_session
from draglag_app.windows.window import OperatorWindow


def test_what_cannot_be_saved_where_it_is_can_be_saved_in_another_folder(
    qapp: QApplication, open_window: Callable[..., OperatorWindow], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    window = open_window()
    folder, other = Path(window.space.settings.folder), tmp_path / "other"
    folder.mkdir(exist_ok=True, parents=True)
    other.mkdir()
    SessionWriter(folder / "s.h5", full_session()).abandon()
    take_room = os.posix_fallocate

    def full(fd: int, at: int, size: int) -> None:
        if Path(os.path.realpath(f"/proc/self/fd/{fd}")).parent == folder.resolve():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        take_room(fd, at, size)

    monkeypatch.setattr(os, "posix_fallocate", full)
    monkeypatch.setattr(QMessageBox, "question", lambda *args, **options: QMessageBox.StandardButton.Yes)
    window.offer_salvage()
    wait_until(qapp, lambda: window.findChild(QFileDialog) is not None)
    assert "No space left on device" in window.notice_text.text()
    chooser = window.findChild(QFileDialog)
    assert chooser is not None
    chooser.setDirectory(str(other))
    chooser.accept()
    wait_until(qapp, lambda: (other / "s.h5").exists() and not window.space.tasks.running)
    assert [run.outcome for run in read_session(other / "s.h5").runs] == ["complete", "complete"]
    assert (folder / "s.h5.partial").exists()
