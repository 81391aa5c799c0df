"""The question before closing during a recording."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtWidgets import QMessageBox, QWidget


def tr(text: str) -> str:
    return QCoreApplication.translate("leaving", text)


def sure_to_stop(window: QWidget) -> bool:
    """Whether the operator wants to stop and save."""
    box = QMessageBox(window)
    box.setWindowTitle("draglag")
    box.setText(tr("A session is being recorded."))
    stop = box.addButton(tr("Stop and save"), QMessageBox.ButtonRole.DestructiveRole)
    stay = box.addButton(tr("Continue recording"), QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(stay)
    box.setEscapeButton(stay)
    box.setWindowModality(Qt.WindowModality.WindowModal)  # the participant's Esc still aborts the run
    box.exec()
    return box.clickedButton() is stop
