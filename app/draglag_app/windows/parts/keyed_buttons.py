"""Buttons that show keys, as "Start F5"."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtWidgets import QPushButton, QWidget

_APART = "  "  # between what a button does and its keys


def show_keys(window: QWidget, usual: Mapping[str, str], present: Mapping[str, str]) -> None:
    """Replace the usual keys by the present ones; both: action → keys."""
    by_keys = {keys: action for action, keys in usual.items() if keys}
    for button in window.findChildren(QPushButton):
        what, apart, keys = button.text().rpartition(_APART)
        action = button.property("keyed") or (by_keys.get(keys) if apart else None)
        if action is None:
            continue
        button.setProperty("keyed", action)
        text = what if apart else button.text()
        button.setText(_APART.join(part for part in (text, present.get(action, "")) if part))
