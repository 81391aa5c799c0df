"""Plots of a recording."""

from __future__ import annotations

import math
from collections.abc import Callable

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QSplitter

from draglag.protocol.runs import PlannedRun
from draglag_app.live import LiveRun
from draglag_app.session import events
from draglag_app.windows.participant.docked import DockedPicture
from draglag_app.windows.participant.window import ParticipantWindow
from draglag_app.windows.plots.curve_plot import CurvePlot
from draglag_app.windows.recording.live_plots import SpeedPlot, TracePlot
from draglag_app.windows.recording.session_thread import Order

# One of the two live plots is drawn this often, by turns: together they would cost the participant a frame.
_REDRAW_MS = 100
# Height of each of the two plots that stand one above the other, with the table below them.
_LEAST_PX = 110
# A frame that was late itself leaves less than this until the next: the plot waits for that one, but not for ever.
_ROOM_S, _MOST_WAITS = 0.010, 3


class LiveView(QSplitter):
    """Draws right after a frame of the participant's target, with the longest time to the next."""

    drawing = Signal()
    """Ten times a second during a session, when there is time to draw."""

    def __init__(self, latency_title: str, next_frame_s: Callable[[], float]) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._next_frame_s = next_frame_s
        self._run: LiveRun | None = None
        self._fresh = False
        self._docked: DockedPicture | None = None
        self.trace, self.speed = TracePlot(), SpeedPlot()
        self.curve = CurvePlot(latency_title, named_above=True)
        self._turns: list[TracePlot | SpeedPlot] = [self.trace, self.speed]
        for plot in (self.speed, self.curve):
            plot.setMinimumHeight(_LEAST_PX)
        right = QSplitter(Qt.Orientation.Vertical)
        right.addWidget(self.speed)
        right.addWidget(self.curve)
        right.setSizes([200, 260])
        self.addWidget(self.trace)
        self.addWidget(right)
        self.setSizes([560, 520])
        self._due, self._frame_drawn = QTimer(self), QTimer(self)
        self._due.setInterval(_REDRAW_MS)
        self._frame_drawn.setSingleShot(True)
        for timer in (self._due, self._frame_drawn):
            timer.setTimerType(Qt.TimerType.PreciseTimer)
        self._waits = 0
        self._due.timeout.connect(self._wait_for_frame)
        self._frame_drawn.timeout.connect(self._draw)

    @property
    def n_edges(self) -> int:
        """Edges of the present run."""
        return 0 if self._run is None else self._run.n_edges

    def begin_session(self) -> None:
        """Clear the plots."""
        self.trace.begin(None, None)
        self.speed.begin(None)
        self._due.start()

    def end_session(self) -> None:
        """Stop drawing."""
        if self._docked is not None:
            self._docked.hide()
            self._docked.deleteLater()
            self._docked = None
        self._due.stop()
        self._frame_drawn.stop()

    def dock(self, picture: ParticipantWindow) -> None:
        """Show the participant's picture until the session ends."""
        self._docked = DockedPicture(picture)
        self.insertWidget(0, self._docked)
        self.setSizes([300, 500, 380])
        picture.setFocus()  # Esc aborts the run, as in a window of its own

    def prepare(self, run_id: str, order: Order | None, planned: PlannedRun | None) -> None:
        """Prepare the plots for a run."""
        self._run = LiveRun(run_id, planned, 0.0)
        self.trace.begin(order, planned)
        self.speed.begin(planned)

    def begin_run(self, event: events.RunStarted) -> None:
        """The target moves."""
        self._run = LiveRun(event.run_id, event.planned, event.start_s)

    def add(self, samples: events.SamplesArrived) -> None:
        """Add samples, drawn when there is time."""
        if self._run is not None:
            self._run.add(samples)
        self._fresh = True

    def draw_all(self) -> None:
        """Draw both plots now."""
        if self._run is not None:
            self.trace.draw(self._run)
            self.speed.draw(self._run)

    def restyle(self) -> None:
        """Draw in the present theme."""
        for plot in (self.trace, self.speed, self.curve):
            plot.restyle()
        self.draw_all()

    def _wait_for_frame(self) -> None:
        self._frame_drawn.start(math.ceil(1e3 * self._next_frame_s()))

    def _draw(self) -> None:
        self._waits += 1
        if 0 < self._next_frame_s() < _ROOM_S and self._waits <= _MOST_WAITS:
            self._wait_for_frame()
            return
        self._waits = 0
        self.drawing.emit()
        if self._fresh and self._run is not None and self.isVisible():
            plot = self._turns.pop(0)
            self._turns.append(plot)
            plot.draw(self._run)
            self._fresh = plot is not self.speed
