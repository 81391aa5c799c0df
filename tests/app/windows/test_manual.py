"""The manual, which is all that a new operator has."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QPushButton

from draglag_app.windows.actions import ACTIONS
from draglag_app.windows.pages.help import manual_text
from draglag_app.windows.wording.i18n import table_of


def test_the_manual_tells_what_the_window_can_do_by_the_names_it_has_there(open_window: Callable) -> None:
    window = open_window()
    there = {one.text() for one in window.findChildren(QPushButton)}
    named = {
        "Look for devices", "Show the bar", "Correct", "Rotate 90°", "Save…", "Keep results", "Explain the gap",
        "Remove effect", "Add effect", "Save model…", "Add the one at hand", "Add sessions…",
    }  # fmt: skip
    assert named <= there
    dutch = table_of("nl")
    assert [name for name in named if f"*{name}*" not in manual_text("en")] == []
    assert [name for name in named if f"*{dutch[name]}*" not in manual_text("nl")] == []
    keys = [
        spec.keys for spec in ACTIONS if spec.menu in ("session", "measure", "edit") and spec.id not in ("quit", "redo")
    ]
    for language in ("en", "nl"):
        assert [key for key in keys if key not in manual_text(language)] == []
