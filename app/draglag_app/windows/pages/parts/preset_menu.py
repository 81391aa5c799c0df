"""The menu of preset protocols."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from draglag.errors import DraglagError
from draglag.protocol.runs import Protocol, expand, load_protocol, session_duration_s
from draglag_app.session.options import COUNTDOWN_S
from draglag_app.windows.parts.full_texts import elided
from draglag_app.windows.parts.letter_menu import LetterMenu
from draglag_app.windows.parts.plain import plain
from draglag_app.windows.settings import PanelSettings
from draglag_app.windows.wording import words
from draglag_resources import presets

# Of the window's width; the rest is for the name and the duration.
_SENTENCE_SHARE = 0.6


class PresetMenu(LetterMenu):
    """``chosen`` gets a name; ``panel`` gives the screen."""

    def __init__(self, parent: QWidget, panel: Callable[[], PanelSettings], chosen: Callable[[str], object]) -> None:
        super().__init__(parent)
        self._panel = panel
        self.setToolTipsVisible(True)
        self._entries: dict[str, tuple[QAction, Protocol]] = {}
        for name in presets("protocols"):
            entry = self.addAction(name)
            entry.triggered.connect(lambda checked=False, name=name: chosen(name))
            self._entries[name] = entry, load_protocol(name)
        self.aboutToShow.connect(self.write)

    def write(self) -> None:
        """Write the entries for the present screen."""
        parent = self.parentWidget()
        room_px = int(_SENTENCE_SHARE * parent.window().width()) if parent is not None else 0
        for name, (entry, protocol) in self._entries.items():
            meaning = words.preset_meaning(protocol.description)
            entry.setText(f"{name}: {elided(self.fontMetrics(), meaning, room_px)}\t{self._duration(protocol)}")
            entry.setToolTip(plain(meaning))

    def _duration(self, protocol: Protocol) -> str:
        panel = self._panel()
        try:
            plan = expand(protocol, panel.screen(), beam=panel.beam())
        except DraglagError:  # it does not fit that screen; choosing it says why
            return words.DASH
        text = QCoreApplication.translate("PresetMenu", "{time} min")
        return text.format(time=words.duration(session_duration_s(protocol, plan, COUNTDOWN_S)))
