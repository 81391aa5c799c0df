"""The menu of recent sessions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QWidget

from draglag_app.windows.parts.letter_menu import LetterMenu
from draglag_app.windows.parts.plain import plain

MOST = 9
"""Entries with a digit to press."""


def remembered(path: Path, known: Iterable[str]) -> list[str]:
    """Paths, the opened one first, at most ``MOST``."""
    opened = str(path.absolute())
    return [opened, *(one for one in known if one != opened)][:MOST]


class RecentMenu(LetterMenu):
    """Filled each time it is shown."""

    def __init__(self, parent: QWidget, known: Callable[[], Iterable[str]], chosen: Callable[[Path], object]) -> None:
        super().__init__(QCoreApplication.translate("Actions", "Recent sessions"), parent)
        self._known, self._chosen = known, chosen
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self.fill)

    def fill(self) -> None:
        """Fill in the files that are there."""
        self.clear()
        there = [path for path in map(Path, self._known()) if path.is_file()]
        for number, path in enumerate(there, 1):
            # An ampersand in a name is no key.
            action = self.addAction(f"&{number}  {path.name.replace('&', '&&')}")
            action.setToolTip(plain(str(path)))
            action.triggered.connect(lambda checked=False, path=path: self._chosen(path))
        if not there:
            self.addAction(QCoreApplication.translate("Actions", "none yet")).setEnabled(False)
