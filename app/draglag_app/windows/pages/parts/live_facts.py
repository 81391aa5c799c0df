"""Numbers of a recording; notes."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import datetime

from PySide6.QtCore import QCoreApplication, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLineEdit

from draglag_app.session import events
from draglag_app.windows.parts.widgets import Fact, Panel, label
from draglag_app.windows.wording import words

# A touch rate is not of now where the last touch is older.
_OLD_S = 1.0
_OF_NOW = ("touch_rate", "touch_age", "edges")  # without a meaning once a session is over


def tr(text: str) -> str:
    return QCoreApplication.translate("LiveFacts", text)


class LiveFacts(Panel):
    """Numbers and a note field; ``noted``: a note was written, or none."""

    noted = Signal()

    def __init__(self, write: Callable[[str], bool]) -> None:
        super().__init__()
        self._write = write
        self._touched_s: float | None = None
        self._losses: dict[str, int] = {}
        grid = QGridLayout()
        grid.setVerticalSpacing(6)
        self.facts = {}
        for k, (name, title) in enumerate(
            (
                ("touch_rate", tr("touch events")),
                ("touch_age", tr("last touch")),
                ("edges", tr("edges, this run")),
                ("lost", tr("lost")),
                ("file", tr("file")),
                ("taps", tr("taps")),
            )
        ):
            fact = self.facts[name] = Fact(title)
            grid.addWidget(fact, k // 3, k % 3)
        self.body.addLayout(grid)
        self.note = QLineEdit()
        self.note.returnPressed.connect(self._write_note)
        self._before = label(tr("Note"))
        self._before.setBuddy(self.note)
        row = QHBoxLayout()
        row.addWidget(self._before)
        row.addWidget(self.note, 1)
        self.body.addLayout(row)

    def set_recording(self, recording: bool) -> None:
        self.note.setEnabled(recording)
        for part in (self._before, self.note):  # of no use between sessions
            part.setVisible(recording)
        self.note.setPlaceholderText(tr("Note with the present time: F4, write, Return"))
        for name in self.facts if recording else _OF_NOW:
            self.facts[name].show_text(words.DASH)
        if recording:
            self._touched_s, self._losses = None, {}

    def take(self, event: events.SamplesArrived, n_edges: int) -> None:
        """Show the numbers of one source."""
        self._losses[event.role] = event.lost
        if event.role == "touch" and event.count:
            self._touched_s = time.monotonic() - max(0.0, event.age_s)
            if event.rate_hz:  # not of a single event
                self.facts["touch_rate"].show_text(words.per_second(event.rate_hz))
            self.facts["touch_age"].show_text(words.duration_ms(event.age_s))
        self.facts["lost"].show_text(str(sum(self._losses.values())))
        self.facts["edges"].show_text(str(n_edges))

    def keep_time(self) -> None:
        """Show the growing age of the last touch."""
        age_s = 0.0 if self._touched_s is None else time.monotonic() - self._touched_s
        if age_s > _OLD_S:
            self.facts["touch_rate"].show_text(words.per_second(0.0))
            self.facts["touch_age"].show_text(words.duration_ms(age_s))

    def keep(self, text: str) -> bool:
        """Whether a session took the note."""
        kept = self._write(text)
        if kept:
            now = datetime.now().strftime("%H:%M:%S")
            self.note.setPlaceholderText(tr("Noted at {time}: {text}").format(time=now, text=text))
        return kept

    def _write_note(self) -> None:
        text = self.note.text().strip()
        if text and self.keep(text):
            self.note.clear()
        self.noted.emit()
