"""Lists that drop down from boxes, with rows as high as a finger needs."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox, QStyledItemDelegate, QWidget


def raise_rows(root: QWidget) -> None:
    """Let the lists of all boxes below a widget take the height that the style sheet gives rows.

    Qt's own rows for boxes that cannot be typed into leave the style sheet aside.
    """
    for box in root.findChildren(QComboBox):
        box.setItemDelegate(QStyledItemDelegate(box))
