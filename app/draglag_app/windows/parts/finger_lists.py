"""Drop-down lists with rows as high as a finger needs."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox, QStyledItemDelegate, QWidget


def raise_rows(root: QWidget) -> None:
    """Give lists of boxes the style sheet's row height, which Qt ignores in boxes without typing."""
    for box in root.findChildren(QComboBox):
        box.setItemDelegate(QStyledItemDelegate(box))
