"""Dialogs that are not modal, as those take Esc from the participant's screen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QChildEvent, Qt
from PySide6.QtWidgets import QDialog, QFileDialog, QMessageBox, QWidget

from draglag_app.windows.parts.plain import plain

Mode = QFileDialog.FileMode


class _FileDialog(QFileDialog):
    """Its questions are modal only to its window."""

    def childEvent(self, event: QChildEvent) -> None:
        super().childEvent(event)
        if event.polished() and isinstance(child := event.child(), QDialog):
            child.setWindowModality(Qt.WindowModality.WindowModal)


def pick_files(
    parent: QWidget, title: str, start: Path, kind: str, mode: Mode, then: Callable[[list[Path]], None]
) -> None:
    """Show a file dialog; ``then`` gets the choice, if any.

    ``start``: folder, or for ``Mode.AnyFile`` the proposed path; the caller asks about replacing.
    """
    window = parent.window()
    close_file_dialogs(window)
    dialog = _FileDialog(window, title)
    dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.setWindowModality(Qt.WindowModality.NonModal)
    dialog.setFileMode(mode)
    if kind:
        dialog.setNameFilter(kind)
    if mode is Mode.AnyFile:
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setOption(QFileDialog.Option.DontConfirmOverwrite)  # Qt would ask with a modal box
        dialog.setDirectory(str(start.parent))
        dialog.selectFile(start.name)
    else:
        dialog.setOption(QFileDialog.Option.ShowDirsOnly, mode is Mode.Directory)
        dialog.setDirectory(str(start))
    keys = getattr(window, "run_keys", None)
    if keys is not None:
        dialog.addActions(keys())
    dialog.accepted.connect(lambda: then([Path(name) for name in dialog.selectedFiles()]))
    if parent is not window:
        parent.destroyed.connect(dialog.close)  # what the answer was for is gone
    dialog.show()


def close_file_dialogs(window: QWidget) -> None:
    """Close the window's dialogs, as if cancelled."""
    for dialog in window.findChildren(QFileDialog, options=Qt.FindChildOption.FindDirectChildrenOnly):
        dialog.close()


def ask_whether(parent: QWidget, text: str, then: Callable[[], None]) -> None:
    """Show a question; ``then`` is called on Yes."""
    yes, no = QMessageBox.StandardButton.Yes, QMessageBox.StandardButton.No
    box = QMessageBox(QMessageBox.Icon.Question, "draglag", plain(text), yes | no, parent.window())
    box.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    box.setWindowModality(Qt.WindowModality.NonModal)
    box.setDefaultButton(no)

    def answered(button: int) -> None:
        if button == yes.value:
            then()

    box.finished.connect(answered)
    if parent is not parent.window():
        parent.destroyed.connect(box.close)
    box.show()
