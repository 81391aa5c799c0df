"""The question where to save."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtWidgets import QDialog, QHBoxLayout, QVBoxLayout, QWidget

from draglag_app.session import Control, events
from draglag_app.windows.parts.ask_files import ask_folder
from draglag_app.windows.parts.file_dialogs import close_file_dialogs
from draglag_app.windows.parts.widgets import button, label
from draglag_app.windows.wording.library_words import fault_words

_WIDTH_PX = 560


def tr(text: str) -> str:
    return QCoreApplication.translate("AnotherPlace", text)


class AnotherPlace(QDialog):
    """Asks until a button is pressed; not modal."""

    def __init__(self, window: QWidget, control: Control, event: events.PlaceWanted) -> None:
        super().__init__(window)
        self._control = control
        self.setWindowTitle("draglag")
        self.setWindowModality(Qt.WindowModality.NonModal)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setMinimumWidth(_WIDTH_PX)
        body = QVBoxLayout(self)
        self.text = label(fault_words(event.problem, event.remedy), wrap=True)
        body.addWidget(self.text)
        body.addWidget(label(tr("The session waits. Where shall it go on?"), wrap=True))
        row = QHBoxLayout()
        body.addLayout(row)
        self.other = button(tr("Another folder …"), "primary")
        self.again = button(tr("Try again here"))
        self.end = button(tr("End the session"), "danger")
        for made in (self.other, self.again, self.end):
            row.addWidget(made)
        self.other.clicked.connect(lambda: ask_folder(self, tr("Folder to go on in"), event.path.parent, self._answer))
        self.again.clicked.connect(lambda: self._answer(None))
        self.end.clicked.connect(self._none)

    def reject(self) -> None:
        """Esc is ignored: the session would wait with nobody asked."""

    def _answer(self, folder: Path | None) -> None:
        self._control.name_place(folder)
        self.done(0)

    def _none(self) -> None:
        self._control.no_place()
        self._control.stop()
        self.done(0)


def ask_another_place(window: QWidget, control: Control | None, event: events.PlaceWanted) -> AnotherPlace | None:
    """The question, replacing an earlier one."""
    withdraw(window)
    if control is None:
        return None
    dialog = AnotherPlace(window, control, event)
    dialog.show()
    return dialog


def withdraw(window: QWidget) -> None:
    """Close the question."""
    for dialog in window.findChildren(AnotherPlace):
        close_file_dialogs(dialog)
        dialog.done(0)
