"""Estimates of the session being recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from draglag.analysis import curve_points, has_constant_speed
from draglag.curve import CurveFit, fit_best
from draglag.errors import EstimateError
from draglag.latency import RunEstimate, estimate_on_clock, with_systematics
from draglag.latency.conduct import excluded_because, with_conduct
from draglag.latency.stamps import stamps_reach_s, with_stamps
from draglag.system.memory import release_freed_memory
from draglag_app.session import events
from draglag_app.windows.parts.tasks import Progress

if TYPE_CHECKING:
    from draglag_app.windows.workspace import Workspace


class LiveEstimates(QObject):
    """Estimates each run after its end, and again once saved.

    Attributes:
        known: one estimate per run, in order of recording.
        preliminary: ids of runs not whole yet.
        curve: through whole runs; None while too few.
    """

    changed = Signal()

    def __init__(self, workspace: Workspace) -> None:
        super().__init__(workspace)
        self._space = workspace
        self.known: list[RunEstimate] = []
        self.preliminary: set[str] = set()
        self.curve: CurveFit | None = None
        self._fitting = False
        self._fit_again = False
        workspace.recording.began.connect(self.clear)
        workspace.bridge.run_previewed.connect(self._previewed)
        workspace.bridge.run_finished.connect(self._finished)

    def clear(self) -> None:
        """Begin a new session."""
        self.known, self.curve = [], None
        self.preliminary.clear()
        self.changed.emit()

    def take(self, estimate: RunEstimate) -> None:
        """Use the estimate of a whole run."""
        self.preliminary.discard(estimate.id)
        self._put(estimate)
        self._fit()

    def _previewed(self, event: events.RunPreviewed) -> None:
        order = self._space.recording.order
        # As fast as the computer allows, the whole run follows at once.
        if order is None or order.rig.stage.time_base.realtime:
            self._estimate(event, preliminary=True)

    def _finished(self, event: events.RunFinished) -> None:
        if event.outcome == "complete":
            self._estimate(event, preliminary=False)
        elif event.run.id in self.preliminary:
            self.preliminary.discard(event.run.id)
            self.known = [estimate for estimate in self.known if estimate.id != event.run.id]
            self.changed.emit()

    def _estimate(self, event: events.RunPreviewed | events.RunFinished, preliminary: bool) -> None:
        order, run, options = self._space.recording.order, event.run, self._space.options
        if order is None or not has_constant_speed(run):
            return
        stylus_mm = order.options.stylus.diameter_mm
        if preliminary:
            self.preliminary.add(run.id)

        def work(progress: Progress) -> RunEstimate:
            found = estimate_on_clock(
                run, event.clocks, stylus_mm, options.estimator, options.update_rate_hz, options.window_s
            )
            found = with_systematics(found, correct=options.estimator != "paper")
            return with_conduct(with_stamps(found, stamps_reach_s([run.touch.t_s])), run)

        def done(estimate: RunEstimate) -> None:
            if not preliminary:
                self.take(estimate)
            elif run.id in self.preliminary:
                self._put(estimate)

        self._space.tasks.start(self.tr("Estimating"), work, done, self._space.fault)

    def _put(self, estimate: RunEstimate) -> None:
        ids = [known.id for known in self.known]
        if estimate.id in ids:
            self.known[ids.index(estimate.id)] = estimate
        else:
            self.known.append(estimate)
        self.changed.emit()

    def _fit(self) -> None:
        if self._fitting:
            self._fit_again = True
            return
        whole = [estimate for estimate in self.known if estimate.id not in self.preliminary]
        self._fitting, self._fit_again = True, False

        def done(curve: CurveFit | None) -> None:
            self._fitting = False
            self.curve = curve
            self.changed.emit()
            if self._fit_again:
                self._fit()

        def failed(text: str) -> None:
            self._fitting = False

        def work(progress: Progress) -> CurveFit | None:
            curve = curve_through(whole)
            release_freed_memory()  # the run's arrays are freed by now, and nothing moves on the screen
            return curve

        self._space.tasks.start(self.tr("Fitting"), work, done, failed)


def curve_through(known: list[RunEstimate]) -> CurveFit | None:
    """The best curve; None while too few."""
    points = curve_points([estimate for estimate in known if not excluded_because(estimate)])
    try:
        return fit_best(points)
    except EstimateError:
        return None
