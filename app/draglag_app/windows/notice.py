"""The strip of notices and progress."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QTimer, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QFrame, QHBoxLayout, QProgressBar, QWidget

from draglag_app.windows.parts.tasks import Tasks
from draglag_app.windows.parts.widgets import button, label, restyle
from draglag_app.windows.wording.library_words import in_words

# Work that is over at once shall not flicker.
_SLOW_MS = 400


class NoticeStrip(QFrame):
    """A sentence, and a bar during tasks."""

    def __init__(self, tasks: Tasks, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._tasks = tasks
        self.setObjectName("notice")
        self.setMinimumHeight(46)
        row = QHBoxLayout(self)
        row.setContentsMargins(14, 4, 10, 4)
        self.text = label("", "noticeText", wrap=True)
        row.addWidget(self.text, 1)
        self.progress = QProgressBar()
        self.progress.setRange(0, 1000)
        self.progress.setTextVisible(False)
        self.progress.setFixedWidth(180)
        self.cancel = button(self.tr("Cancel  Ctrl+."))
        self.cancel.clicked.connect(tasks.cancel_all)
        self.open = button(self.tr("Open"))
        self.open.clicked.connect(self._open)
        self._path: Path | None = None
        self.dismiss = button(self.tr("OK"))
        self.dismiss.clicked.connect(lambda: self.notify("", ""))
        for widget in (self.progress, self.cancel, self.open, self.dismiss):
            row.addWidget(widget)
        self._slow = QTimer(self)
        self._slow.setSingleShot(True)
        self._slow.setInterval(_SLOW_MS)
        self._slow.timeout.connect(self._show_progress)
        self.progress.hide()
        self.cancel.hide()
        self.open.hide()
        self.dismiss.hide()
        self.hide()
        tasks.changed.connect(self._tasks_changed)
        tasks.progressed.connect(lambda fraction, text: self.progress.setValue(round(1000 * fraction)))

    def notify(self, level: str, text: str) -> None:
        """Show a sentence: "info", "warning" or "error"; empty: none."""
        self.text.setText(in_words(text))
        restyle(self, "level", level)
        self.open.hide()
        self.dismiss.setVisible(bool(text))
        self.setVisible(bool(text) or self.progress.isVisibleTo(self))

    def saved(self, path: Path, more: str = "") -> None:
        """Show a written file or folder, and ``more``."""
        said = self.tr("Saved: {path}").format(path=path)
        self.notify("info", " · ".join(part for part in (said, more) if part))
        self._path = path
        self.open.setVisible(path.is_dir() or path.suffix == ".html")

    def _open(self) -> None:
        if self._path is not None and not QDesktopServices.openUrl(QUrl.fromLocalFile(str(self._path))):
            text = self.tr("No program of this desktop opens {path}.").format(path=self._path)
            self.notify("warning", text)

    def forget_done(self) -> None:
        """Clear an "info"."""
        if self.property("level") == "info":
            self.notify("", "")

    def _tasks_changed(self) -> None:
        if self._tasks.running:
            self._slow.start()
            return
        self._slow.stop()
        self.progress.hide()
        self.cancel.hide()
        self.setVisible(bool(self.text.text()))

    def _show_progress(self) -> None:
        if self._tasks.running:
            self.progress.show()
            self.cancel.show()
            self.show()
