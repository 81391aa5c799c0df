"""Record: the run as it happens."""

from __future__ import annotations

import time
from pathlib import Path

from PySide6.QtCore import QCoreApplication, Signal
from PySide6.QtWidgets import (
    QApplication,
    QHBoxLayout,
    QVBoxLayout,
    QWidget,
)

from draglag.protocol.runs import first_target_after_s
from draglag_app.session import events
from draglag_app.session.machine import Phase
from draglag_app.session.options import COUNTDOWN_S
from draglag_app.windows.bridge import Prompted
from draglag_app.windows.pages.parts.between_runs import comes_again, in_rest_s, rest_words, session_left, verdict_words
from draglag_app.windows.pages.parts.live_facts import LiveFacts
from draglag_app.windows.pages.parts.run_table import RunTable
from draglag_app.windows.pages.parts.state_band import StateBand, plain_row
from draglag_app.windows.parts.full_texts import ElidedLabel
from draglag_app.windows.parts.theme import theme, wide
from draglag_app.windows.parts.widgets import LARGE_TEXT, button, label
from draglag_app.windows.recording.live_view import LiveView
from draglag_app.windows.start import Obstacle
from draglag_app.windows.wording import words
from draglag_app.windows.wording.library_words import in_words
from draglag_app.windows.workspace import Edit, Workspace

# The heading and four rows of the table; while nothing is recorded, with letters of the usual size, there is no line
# for notes to its right and it is lower, so that the page fits the screen of 1280 x 800 below a window's title bar.
_LOWER_PX, _LOWER_IDLE_PX = 214, 160


def tr(text: str) -> str:
    return QCoreApplication.translate("RecordPage", text)


# What the button of an obstacle says, by the page that mends it.
MEND = {
    "bench": lambda: tr("Choose instruments"),
    "geometry": lambda: tr("Check the geometry"),
    "preferences": lambda: tr("Choose the folder"),
}


class RecordPage(QWidget):
    """The page; its buttons emit ``asks(action id)``."""

    asks = Signal(str)
    noted = Signal()
    """A note was written, or there is none to write."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._space = workspace
        self._due_s = 0.0
        self._span_s = 0.0
        self._run_s = 0.0  # how long the run that is begun lasts
        self._phase: Phase | None = None
        self._outcome: tuple[str, str] | None = None
        self._missing: list[Obstacle] = []
        self._faults: list[str] = []
        self._resting, self._rest_s, self._rest_until_s, self._number = False, 0.0, 0.0, 0
        self._coming, self._repeats = "run", True  # what the rest is followed by, whether F7 has a run to repeat
        self._ended: tuple[str, str] | None = None  # id and outcome of the run that ended last
        self.band = StateBand()
        self.band.pressed.connect(self._ask)
        self.big, self.small, self.buttons = self.band.big, self.band.small, self.band.buttons
        self.progress, self.heading = self.band.progress, self.band.heading
        self.now = LiveFacts(self._write_note)
        self.now.noted.connect(self.noted)
        self.facts, self.note = self.now.facts, self.now.note
        outer = QVBoxLayout(self)
        outer.setContentsMargins(12, 12, 12, 12)
        outer.setSpacing(10)
        outer.addWidget(self.band)
        outer.addWidget(self._about())
        self.clock_warning = label("", "warning", wrap=True)
        self.clock_warning.hide()
        outer.addWidget(self.clock_warning)
        self.live = LiveView(self.tr("Latency so far"), self._next_frame_s)
        outer.addWidget(self.live, 1)
        lower = QHBoxLayout()
        self.table = RunTable()
        if wide(100) > LARGE_TEXT:
            self.table.show_first_columns()
        lower.addWidget(self.table, 3)
        lower.addWidget(self.now, 2)
        outer.addLayout(lower)
        self.live.drawing.connect(self._keep_time)
        self._listen()
        self.set_recording(False)

    def _about(self) -> QWidget:
        self.about_row, row = plain_row()
        self.about = ElidedLabel("hint")
        details = button(self.tr("Session details…  Ctrl+D"))
        details.clicked.connect(lambda: self.asks.emit("details"))
        row.addWidget(self.about, 1)
        row.addWidget(details)
        return self.about_row

    def _ask(self, action: str) -> None:
        self.asks.emit(f"go_{self._mends_on()}" if action == "mend" else action)

    def _mends_on(self) -> str:
        return self._missing[0].page if self._missing else "bench"

    def _listen(self) -> None:
        bridge = self._space.bridge
        bridge.state_changed.connect(self._state_changed)
        bridge.prompted.connect(self._prompted)
        bridge.resting.connect(self._rest_began)
        bridge.run_queued.connect(self._run_queued)
        bridge.run_started.connect(self.live.begin_run)
        bridge.run_previewed.connect(lambda event: self.table.add_run(event.run))
        bridge.run_finished.connect(self._run_finished)
        bridge.samples_arrived.connect(self._samples_arrived)
        bridge.taps_arrived.connect(lambda taps: self.facts["taps"].show_text(f"{taps.down} / {taps.release}"))
        bridge.disk_status.connect(lambda disk: self.facts["file"].show_text(words.size(disk.file_bytes)))
        self._space.live.changed.connect(self._live_changed)

    # --- state ----------------------------------------------------------------------------------------------

    def set_recording(self, recording: bool) -> None:
        """Show a session's beginning or end."""
        self.about_row.setVisible(not recording)
        self.band.set_recording(recording)
        self.now.set_recording(recording)
        low = not recording and wide(100) <= LARGE_TEXT
        for part in (self.table, self.now):
            part.setFixedHeight(_LOWER_IDLE_PX if low else _LOWER_PX)
        if recording:
            self._outcome = None
            self._ended, self._resting, self._number = None, False, 0
            self._coming, self._repeats = "run", True
            self.table.clear_runs()
            self._enable(resting=False, running=False)
            self.band.say(self.tr("Opening the instruments"), "")
            self.live.begin_session()
        else:
            self.live.end_session()
            self._phase, self._resting = None, False
            self._show_idle()

    def show_outcome(self, path: Path | None, problem: str) -> None:
        """Show why a session ended early."""
        if problem:
            title = self.tr("Nothing was recorded") if path is None else self.tr("Ended early")
            self._outcome = (title, in_words(problem))

    def forget_outcome(self) -> None:
        """Forget why the last session ended early."""
        self._outcome = None

    def show_readiness(self, missing: list[Obstacle], faults: list[str]) -> None:
        """Show obstacles, and faults of instruments."""
        self._missing, self._faults = missing, faults
        if not self._space.recording.active:
            self._show_idle()

    def _show_idle(self) -> None:
        start = self._what_starts()
        mends = bool(self._missing or self._faults)
        self.band.show_mend(MEND[self._mends_on()]() if mends else "")
        details = self._space.settings.details()
        about = " · ".join(f"{words.detail_name(name)}: {text}" for name, text in details.items())
        self.about.setText(about or self.tr("No participant, session or operator is named"))
        if self._outcome is not None:
            self.band.say(self._outcome[0], f"{self._outcome[1]} {start}", "bad")
        elif self._missing:
            short = ", ".join(obstacle.short for obstacle in self._missing)
            self.band.say(self.tr("▲ Not ready: {what}").format(what=short), self._sentences(), "bad")
        elif mends:
            self.band.say(self.tr("▲ Not ready"), self._sentences(), "bad")
        else:
            self.band.say(self.tr("Ready"), start)

    def _sentences(self) -> str:
        return " ".join([*(obstacle.sentence for obstacle in self._missing), *self._faults])

    def _what_starts(self) -> str:
        protocol = self._space.protocol
        start = self.tr("F5 starts: {name}").format(name=protocol.name)
        after_s = first_target_after_s(protocol, COUNTDOWN_S)
        if protocol.runs and (after_s <= COUNTDOWN_S or not self._space.settings.begin_by_hand):  # no rest before it
            start += self.tr(" · the first target moves after {time}").format(time=words.duration(after_s))
        return start

    def _state_changed(self, event: events.StateChanged) -> None:
        self._phase = event.phase
        self._due_s = time.monotonic() + event.remaining_s
        self._span_s = event.remaining_s
        planned = self._space.recording.planned(event.run_id)
        self._number = max(self._number, event.run_number)  # a run that comes again at the end has its old number
        self._what = self.tr("run {k} of {n}").format(k=event.run_number, n=event.run_count)
        if planned is not None:
            speed = "" if planned.nominal_speed_mm_s is None else f" {planned.nominal_speed_mm_s:.0f} mm/s"
            self._what += f" · {words.target_name(planned.kind)}{speed}"
            if planned.practice:
                self._what += " · " + self.tr("practice")
            if event.run_id != planned.id:
                self._what += " · " + self.tr("repeated")
            self._run_s = planned.duration_s
        if event.phase is Phase.PREPARING:
            self.live.prepare(event.run_id, self._space.recording.order, planned)
        running = event.phase in (Phase.PREPARING, Phase.COUNTDOWN, Phase.RECORDING)
        self._enable(resting=not running, running=running)
        self._show_state()

    def _enable(self, resting: bool, running: bool) -> None:
        self.band.enable(resting, running, self.table.rowCount() > 0 and self._repeats)

    def _prompted(self, event: Prompted) -> None:
        if self._phase not in (None, Phase.FINISHED):
            return
        if event.kind == "tap":
            self.band.say(self.tr("Taps"), in_words(event.text))
        elif event.text == "Rest":
            self._resting = True
            self._show_rest()
        elif event.text:
            self.band.say(self.tr("Wait"), in_words(event.text))
        self._resting = event.text == "Rest"
        self._enable(resting=self._resting, running=event.kind == "tap")

    def _rest_began(self, event: events.Resting) -> None:
        self._resting, self._rest_s = True, event.remaining_s
        self._coming, self._repeats = event.coming, event.repeats
        self._enable(resting=True, running=False)
        self._rest_until_s = time.monotonic() + event.remaining_s
        self._show_rest()

    def _show_rest(self) -> None:
        control, first = self._space.recording.control, not self.table.rowCount()
        again = control is not None and control.repeating and not first
        left_s = self._rest_until_s - time.monotonic()
        planned_s = self._space.recording.left_s(self._number, tapped=self._coming == "clocks")
        session_s = in_rest_s(planned_s, self._rest_s, left_s)
        level, verdict, more = self._verdict()
        text = rest_words(left_s, session_s, first, again, more, self._coming, self._repeats)
        self.band.say(verdict or self.tr("Rest"), text, level)

    def _verdict(self) -> tuple[str, str, str]:
        live = self._space.live
        if self._ended is None:
            return "", "", ""
        run_id, outcome = self._ended
        control, planned = self._space.recording.control, self._space.recording.planned(run_id)
        queued = control is not None and planned is not None and planned.id in control.queued
        if outcome != "complete":
            return "bad", f"✕ {words.outcome_name(outcome)}", comes_again() if queued else ""
        found = next((one for one in live.known if one.id == run_id), None)
        return ("", "", "") if found is None else verdict_words(found, found.id in live.preliminary, queued)

    def _run_queued(self, event: events.RunQueued) -> None:
        control = self._space.recording.control
        if control is not None:
            what = self.tr("record {run} again at the end").format(run=event.run_id)
            run_id = event.run_id
            self._space.undo.push(Edit(what, lambda: control.queue(run_id), lambda: control.unqueue(run_id)))

    def _show_state(self) -> None:
        self._resting = False
        left_s, control = self._due_s - time.monotonic(), self._space.recording.control
        again = " · " + self.tr("repeated next") if control is not None and control.repeating else ""
        to_come_s = self._run_s if self._phase is Phase.COUNTDOWN else 0.0
        session = session_left(max(0.0, left_s) + to_come_s + self._space.recording.left_s(self._number))
        if self._phase is Phase.COUNTDOWN:
            starts = self.tr("Starts in {n}").format(n=max(1, round(left_s + 0.5)))
            self.band.say(starts, f"{self._what}{again} · {session}")
            self.band.show_share(0.0)
        elif self._phase is Phase.RECORDING:
            left = self.tr("{time} left").format(time=words.duration(left_s))
            self.band.say(self.tr("● Recording"), f"{self._what} · {left}{again} · {session}", "live")
            self.band.show_share(1 - max(0.0, left_s) / max(self._span_s, 1e-3))
        elif self._phase is Phase.CLOSING:
            self.band.say(self.tr("Saving"), self._what + again)
            self.band.show_share(1.0)

    def _run_finished(self, event: events.RunFinished) -> None:
        self.live.draw_all()
        self.table.add_run(event.run, event.outcome)
        self._ended = (event.run.id, event.outcome)
        self._signal_end()

    def _signal_end(self) -> None:
        settings = self._space.settings
        if settings.sound:
            QApplication.beep()
        if settings.flash and not settings.reduced_motion:
            self.band.flash()

    # --- data -----------------------------------------------------------------------------------------------

    def _samples_arrived(self, event: events.SamplesArrived) -> None:
        self.live.add(event)
        self.now.take(event, self.live.n_edges)

    def _keep_time(self) -> None:
        self.now.keep_time()
        if self._phase in (Phase.COUNTDOWN, Phase.RECORDING):
            self._show_state()
        elif self._resting:
            self._show_rest()

    def _next_frame_s(self) -> float:
        window = self._space.recording.window
        return 0.0 if window is None else window.next_frame_s()

    def _live_changed(self) -> None:
        live = self._space.live
        # Of a preliminary estimate the clock comparison after the run is still to come.
        said = words.clock_words([estimate for estimate in live.known if estimate.id not in live.preliminary])
        self.clock_warning.setText("▲ " + said)
        self.clock_warning.setStyleSheet(f"color: {theme().warning};")
        self.clock_warning.setVisible(bool(said))
        self.live.curve.draw(live.known, live.curve)
        self.table.show_estimates(live.known, preliminary=live.preliminary)
        if self._resting:
            self._show_rest()

    def _write_note(self, text: str) -> bool:
        control = self._space.recording.control
        if control is not None:
            control.note(text)
        return control is not None

    def say_repeat(self) -> None:
        """Show that a repeat was requested."""
        if self._phase in (None, Phase.FINISHED):
            if self._resting:
                self._show_rest()
        else:
            self._show_state()

    def restyle_plots(self) -> None:
        """Draw in the present theme."""
        self.live.restyle()
        self.band.restyle()
        self._live_changed()
