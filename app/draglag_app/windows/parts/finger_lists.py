"""Drop-down lists for fingers."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox, QStyledItemDelegate, QWidget


def raise_rows(root: QWidget) -> None:
    """Give boxes' lists the style sheet's row height, which Qt ignores in boxes without typing."""
    for box in root.findChildren(QComboBox):
        box.setItemDelegate(QStyledItemDelegate(box))
