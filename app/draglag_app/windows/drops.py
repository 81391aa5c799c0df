"""Sessions dropped onto the window."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QMimeData, QObject
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QLineEdit, QWidget

from draglag_app.windows.pages.compare import ComparePage

if TYPE_CHECKING:
    from draglag_app.windows.window import OperatorWindow


class Drops(QObject):
    """Opens a dropped session, compares several."""

    def __init__(self, window: OperatorWindow) -> None:
        super().__init__(window)
        self._window = window
        window.setAcceptDrops(True)
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() not in (QEvent.Type.DragEnter, QEvent.Type.Drop) or not isinstance(event, QDropEvent):
            return False
        paths = dropped(event.mimeData())
        if paths:
            event.acceptProposedAction()
            if event.type() == QEvent.Type.Drop:
                self._take(paths)
        return bool(paths)

    def _take(self, paths: list[Path]) -> None:
        window = self._window
        if len(paths) == 1 or window.space.recording.active:
            window.open_file(paths[0])
            return
        _, page = window.pages["compare"]
        assert isinstance(page, ComparePage)
        window.go("compare")
        page.add_files(paths)


def refuse_drops(root: QWidget) -> None:
    """Let fields accept none: they would insert the path as text."""
    for field in root.findChildren(QLineEdit):
        field.setAcceptDrops(False)


def dropped(data: QMimeData) -> list[Path]:
    """One session, or several files; else none."""
    paths = [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]
    if len(paths) != len(data.urls()):
        return []
    files = [path for path in paths if path.suffix == ".h5"]
    alone = [path for path in paths if path.is_dir() or path.name == "session.json"]
    return paths if len(files) == len(paths) or len(alone) == len(paths) == 1 else []
