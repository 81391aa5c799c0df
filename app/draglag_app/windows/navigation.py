"""The column of pages."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QSize, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QButtonGroup, QFrame, QPushButton, QVBoxLayout

from draglag_app.windows.parts.icons import icon
from draglag_app.windows.parts.theme import theme, wide

_WIDTH_PX, _ICON_PX, _MARGIN_PX = 164, 22, 20
# After these comes a little room: to set up, to judge, to look things up.
_LAST_OF_A_GROUP = ("record", "compare")


class Navigation(QFrame):
    """A button per page; ``titles`` by name; ``actions``: for tips."""

    chosen = Signal(str)

    def __init__(self, titles: Mapping[str, str], actions: Mapping[str, QAction]) -> None:
        super().__init__()
        self.setObjectName("navigation")
        self.setFixedWidth(wide(_WIDTH_PX))
        box = QVBoxLayout(self)
        box.setContentsMargins(0, 8, 0, 8)
        box.setSpacing(2)
        group = QButtonGroup(self)
        self._titles, self._narrow = dict(titles), False
        self.tabs: dict[str, QPushButton] = {}
        for name, title in titles.items():
            tab = self.tabs[name] = QPushButton(title)
            tab.setCheckable(True)
            tab.setIconSize(QSize(_ICON_PX, _ICON_PX))
            tab.setFixedWidth(wide(_WIDTH_PX))
            tab.setAccessibleName(title)
            action = actions.get(f"go_{name}")
            keys = "" if action is None else action.shortcut().toString()
            tab.setToolTip("  ".join(part for part in (title, keys) if part))
            tab.clicked.connect(lambda checked=False, name=name: self.chosen.emit(name))
            group.addButton(tab)
            box.addWidget(tab)
            if name in _LAST_OF_A_GROUP:
                box.addSpacing(10)
        box.addStretch(1)
        self.paint_icons()

    def set_narrow(self, narrow: bool) -> None:
        """Show icons alone."""
        if narrow == self._narrow:
            return
        self._narrow = narrow
        width = _ICON_PX + 2 * _MARGIN_PX if narrow else wide(_WIDTH_PX)
        self.setFixedWidth(width)
        for name, tab in self.tabs.items():
            tab.setText("" if narrow else self._titles[name])
            tab.setFixedWidth(width)

    def paint_icons(self) -> None:
        """Draw in the present theme."""
        for name, tab in self.tabs.items():
            tab.setIcon(icon(name, theme().text))
