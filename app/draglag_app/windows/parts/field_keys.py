"""Undo and redo in a field."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QAbstractSpinBox, QComboBox, QLineEdit, QWidget

_UNDO = (QKeySequence.StandardKey.Undo, QKeySequence.StandardKey.Redo)
# On X11 a field takes Ctrl+E for the end of the line.
_NEVER = (QKeySequence.StandardKey.MoveToEndOfLine, QKeySequence.StandardKey.SelectEndOfLine)


class FieldKeys(QObject):
    """Fields pass these keys to the window once their text is accepted."""

    def __init__(self, root: QWidget) -> None:
        super().__init__(root)
        for field in root.findChildren(QWidget):
            edit = _edit_of(field)
            if edit is None:
                continue
            field.installEventFilter(self)
            done = field.editingFinished if isinstance(field, QAbstractSpinBox) else edit.editingFinished
            done.connect(lambda edit=edit: edit.setModified(False))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.ShortcutOverride or not isinstance(event, QKeyEvent):
            return False
        edit = _edit_of(watched)
        undo = any(event.matches(key) for key in _UNDO)
        end = bool(event.text()) and any(event.matches(key) for key in _NEVER)
        if edit is None or not (end or (undo and not edit.isModified())):
            return False
        event.ignore()
        return True


def _edit_of(field: QObject) -> QLineEdit | None:
    if isinstance(field, QLineEdit):
        return field
    if isinstance(field, QAbstractSpinBox):
        return field.findChild(QLineEdit)
    return field.lineEdit() if isinstance(field, QComboBox) else None
