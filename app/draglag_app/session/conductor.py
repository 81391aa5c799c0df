"""The session's own thread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from draglag.errors import DraglagError
from draglag.instruments.orientation import WORDS, wrong_way_round
from draglag.latency.conduct import PRACTICE
from draglag.messages import chained, joined, message
from draglag.protocol.runs import PlannedRun, Protocol
from draglag.protocol.targets import Tap
from draglag.recording import AxisInfo, Run, empty_laser, empty_touch
from draglag_app.session import events
from draglag_app.session.comparing import Comparisons
from draglag_app.session.control import Control
from draglag_app.session.display import Display
from draglag_app.session.machine import RunState, Signal, advance
from draglag_app.session.options import SessionOptions
from draglag_app.session.place import resume_elsewhere
from draglag_app.session.recorder import Recorder
from draglag_app.session.unseen import no_edges, no_touch
from draglag_app.session.verdict import went_wrong
from draglag_app.session.watch import STUCK_S, Watch
from draglag_devices.rig import Rig

# Touch events and edges later than this after the target's end belong to something else.
TAIL_S = 0.5
# By then a screen of ordinary latency has shown all but the last few edges: enough for a first estimate.
PREVIEW_S = 0.2
# By the first the stylus is mostly on the target, and the run hardly begun; a hand that comes late is seen later.
CHECKS_AFTER_S = (1.5, 4.0, 10.0)
# A run that goes wrong again and again says something about the rig, not about the run.
MOST_ATTEMPTS = 3
# A hand that follows the target has touched the screen by then.
TOUCHED_AFTER_S = 4.0

NO_TOUCH = message("No touch was recorded in any run. Check which touchscreen is in use: draglag devices lists them.")
RUN_ROLES = ("touch", "laser")
TAP_ROLES = ("touch", "walt")


@dataclass(frozen=True)
class _Recorded:
    planned: PlannedRun
    number: int
    count: int
    attempt: int = 1


class Conductor:
    """Runs the protocol, and takes the operator's requests."""

    def __init__(
        self,
        protocol: Protocol,
        rig: Rig,
        display: Display,
        options: SessionOptions,
        listener: events.Listener,
        control: Control,
        recorder: Recorder,
    ) -> None:
        self._protocol = protocol
        self._stage = rig.stage
        self._time = rig.stage.time_base
        self._roles = tuple(source.role for source in rig.sources)
        self._display = display
        self._options = options
        self._emit = listener
        self._control = control
        self._saver = recorder.saver
        self.axes: tuple[AxisInfo, ...] = ()
        self.problem = ""
        self._last: _Recorded | None = None
        self._ran = self._touched = self._unsaved = False
        self._wrong: dict[str, _Recorded] = {}  # planned runs that went wrong, by id
        self._watch = Watch(self._time, self._roles, display, listener, control, self._saver)
        self._compare = Comparisons(rig.sources, self._time, self._saver)

    def run_plan(self, plan: tuple[PlannedRun, ...]) -> None:
        """Run all steps: clock checks, taps and runs, with rests between."""
        self._watch.pulse.start()
        try:
            self._run_steps(plan)
        finally:
            self._watch.pulse.stop()

    def _run_steps(self, plan: tuple[PlannedRun, ...]) -> None:
        for k, (what, step) in enumerate(self._steps(plan)):
            if k and not self._between(what):
                break
            self._last = None
            step()
            if self._over():
                break
        else:
            while self._last is not None and self._control.take_repeat() and self._rest() and not self._over():
                self._repeat_run()
        if self._ran and not self._touched and not self.problem:
            self.problem = NO_TOUCH

    def _steps(self, plan: tuple[PlannedRun, ...]) -> Iterator[tuple[str, Callable[[], None]]]:
        taps, check = self._protocol.taps, self._protocol.clock_check
        if check is not None:
            yield "clocks", lambda: self._clock_check(check.duration_s)
        if taps is not None and taps.when in ("start", "both"):
            yield "taps", lambda: self._taps(taps.count, taps.interval_s)
        for number, planned in enumerate(plan, 1):
            yield "run", partial(self._planned, planned, number, len(plan))
        while self._control.queued:
            yield "run", partial(self._once_more, self._control.queued[0])
        if taps is not None and taps.when in ("end", "both"):
            yield "taps", lambda: self._taps(taps.count, taps.interval_s)
        if check is not None and self._protocol.checks_clocks_twice:
            yield "clocks", lambda: self._clock_check(check.duration_s)

    def _between(self, coming: str) -> bool:
        while self._rest(coming):
            repeat = self._control.take_repeat()
            if self._last is None or not repeat:
                return True
            self._repeat_run()
            if self._over():
                break
        return False

    def _over(self) -> bool:
        if (
            self._saver.failure is not None
            and resume_elsewhere(self._saver, self._control, self._emit)
            and self._unsaved
        ):
            self._control.repeat_run()  # the run that could not be saved whole
        self._unsaved = False
        if self._saver.failure is not None:
            self.problem = self._saver.failure.problem
        elif self._control.stopping:
            self.problem = message("Stopped by the operator.")
        elif "touch" in self._saver.lost:
            self.problem = self._saver.lost["touch"].message
        elif self._saver.lost and not self.problem:
            self.problem = joined(" ", (error.message for error in self._saver.lost.values()))
        hopeless = self._saver.failure is not None or self._control.stopping or "touch" in self._saver.lost
        return hopeless

    # --- runs -----------------------------------------------------------------------------------------------

    def _planned(self, planned: PlannedRun, number: int, count: int) -> None:
        self._control.take_repeat()  # what was asked before there was a run to repeat
        if "laser" in self._saver.lost:
            return
        self._last = _Recorded(planned, number, count)
        self._run(planned, planned.id, number, count)

    def _once_more(self, run_id: str) -> None:
        if self._control.unqueue(run_id) and run_id in self._wrong:
            self._control.take_repeat()
            self._last = self._wrong.pop(run_id)
            self._repeat_run()

    def _queue_or_forget(self, planned: PlannedRun, run: Run, outcome: str) -> None:
        last, wanted = self._last, self._control.retries and not planned.practice and not self._control.stopping
        if not wanted:
            return
        why = went_wrong(run, outcome, self._saver.clocks, self._options.stylus.diameter_mm)
        if why and last is not None and last.attempt < MOST_ATTEMPTS:
            self._wrong[planned.id] = last
            self._control.queue(planned.id)
            self._emit(events.RunQueued(planned.id, why))
        else:
            self._control.unqueue(planned.id)
            self._wrong.pop(planned.id, None)

    def _repeat_run(self) -> None:
        last = self._last
        if last is None or "laser" in self._saver.lost:
            return
        self._control.take_repeat()  # asked for twice is once
        self._last = last = replace(last, attempt=last.attempt + 1)
        self._run(last.planned, f"{last.planned.id}-{last.attempt}", last.number, last.count)

    def _run(self, planned: PlannedRun, run_id: str, number: int, count: int) -> None:
        state = RunState()

        def go(signal: Signal, remaining_s: float = 0.0) -> None:
            nonlocal state
            state = advance(state, signal)
            self._emit(events.StateChanged(run_id, state.phase, remaining_s, number, count))

        self._control.take_abort()
        go(Signal.PREPARE)
        start_s, signal = self._prepare(planned, run_id)
        end_s = start_s + planned.duration_s
        if signal is None:
            signal = self._count_down_and_follow(planned, run_id, start_s, go)
        if signal is not None:
            # The target is gone: what the hand would have done next never happens.
            end_s = min(max(self._time.now(), start_s), end_s)
            self._stage.stop()
            self._saver.call(lambda: self._saver.cut_run(end_s))
        self._control.take_proceed()  # asked for while the run lasted: there was no rest to skip
        go(signal or Signal.TARGET_DONE)
        self._display.hide()
        if signal is None:
            self._preview(end_s)
            signal = self._watch.drain(end_s + TAIL_S, RUN_ROLES)
            if signal is not None:
                go(signal)
        self._compare.wait(RUN_ROLES)
        self._watch.check_standstill()
        run = self._saver.call(lambda: self._saver.end_run(state.ending or "failed", end_s - start_s))
        if self._saver.failure is not None and not self._saved_elsewhere(run):
            self._unsaved = True
            go(Signal.FAILURE)
        go(Signal.DRAINED)
        if run is None:
            run = self._empty_run(planned, run_id, start_s)
        self._ran, self._touched = True, self._touched or len(run.touch.t_s) > 0
        outcome = state.outcome or "failed"
        self._emit(events.RunFinished(replace(run, outcome=outcome), outcome, self._saver.clocks))
        self._queue_or_forget(planned, run, outcome)

    def _count_down_and_follow(
        self, planned: PlannedRun, run_id: str, start_s: float, go: Callable[[Signal, float], None]
    ) -> Signal | None:
        """What ended the run before its target did, else None."""
        self._compare.ask(RUN_ROLES)
        go(Signal.READY, self._options.countdown_s)
        signal = self._watch.wait_until(start_s, RUN_ROLES)
        if signal is None:
            go(Signal.TARGET_MOVES, planned.duration_s)
            self._emit(events.RunStarted(run_id, planned, start_s))
            signal = self._follow(planned, start_s, start_s + planned.duration_s)
        return signal

    def _saved_elsewhere(self, run: Run | None) -> bool:
        whole = run is not None and run.outcome != "failed"
        return whole and resume_elsewhere(self._saver, self._control, self._emit)

    def _prepare(self, planned: PlannedRun, run_id: str) -> tuple[float, Signal | None]:
        self._display.prompt(message("{run}: follow the target", run=run_id))
        self._watch.check_disk(force=True)

        def begin() -> float:
            # In the writer's thread, between two batches: on a busy machine, too, no sample is older than the run.
            start_s = round(self._time.now() + self._options.countdown_s, 6)
            self._saver.begin_run(self._empty_run(planned, run_id, start_s), start_s + planned.duration_s + TAIL_S)
            return start_s

        try:
            start_s = self._saver.call(begin)
            if planned.note:
                self._watch.log("info", "protocol", planned.note)
            if planned.practice:
                self._watch.log("info", PRACTICE, message("practice run, not for the curve"))
        except DraglagError:
            return self._time.now(), Signal.FAILURE
        self._display.show(planned.target, start_s)
        self._stage.begin_run(planned, start_s, run_id)
        return start_s, None

    def _follow(self, planned: PlannedRun, start_s: float, end_s: float) -> Signal | None:
        turned = dark = False
        for after_s in CHECKS_AFTER_S:
            signal = self._watch.wait_until(min(start_s + after_s, end_s), RUN_ROLES, frames=True)
            if signal is not None:
                return signal
            turned = turned or self._check_orientation(planned, start_s)
            if after_s >= TOUCHED_AFTER_S and start_s + after_s < end_s:
                dark = dark or self._check_seen(after_s)
        return self._watch.wait_until(end_s, RUN_ROLES, frames=True)

    def _check_orientation(self, planned: PlannedRun, start_s: float) -> bool:
        run = self._saver.call(self._saver.so_far)
        wrong = None if run is None else wrong_way_round(run.touch, planned.target, start_s, self._options.screen)
        if wrong is not None:
            self._watch.log(
                "error",
                "touch",
                message(
                    "The touches are {how} against the target: screen or touchscreen was turned after the calibration. "
                    "Stop, calibrate the touchscreen again, and start again.",
                    how=WORDS[wrong],
                ),
            )
        return wrong is not None

    def _check_seen(self, after_s: float) -> bool:
        run = self._saver.call(self._saver.so_far)
        if run is None:
            return False
        untouched = no_touch(run, after_s) if after_s == TOUCHED_AFTER_S else ""
        if untouched:
            self._watch.log("warning", "touch", untouched)
        dark = no_edges(run, self._options.beam, self._options.screen)
        if dark:
            self._watch.log("warning", "laser", dark)
        return bool(dark)

    def _preview(self, end_s: float) -> None:
        self._time.advance_to(end_s + PREVIEW_S)
        patience_s = TAIL_S if self._time.realtime else STUCK_S
        if self._saver.wait_past(end_s + PREVIEW_S, RUN_ROLES, patience_s):
            return
        run = self._saver.call(self._saver.so_far)
        if run is not None:
            self._emit(events.RunPreviewed(run, self._saver.clocks))

    def _empty_run(self, planned: PlannedRun, run_id: str, start_s: float) -> Run:
        return Run(
            id=run_id,
            protocol=planned.kind,
            start_s=start_s,
            duration_s=planned.duration_s,
            touch=replace(empty_touch(), axes=self.axes),
            laser=empty_laser(),
            nominal_speed_mm_s=planned.nominal_speed_mm_s,
            radius_mm=planned.radius_mm,
            target=planned.target.parameters(),
            seed=self._protocol.seed if self._options.seed is None else self._options.seed,
        )

    # --- taps, clocks, rests --------------------------------------------------------------------------------

    def _taps(self, count: int, interval_s: float) -> None:
        missing = [role for role in TAP_ROLES if role not in self._roles or role in self._saver.lost]
        if missing:
            self._watch.log(
                "warning",
                "protocol",
                message(
                    "taps were left out: there is no {roles} source",
                    roles=chained("{before} and no {next}", (message("{role}", role=role) for role in missing)),
                ),
            )
            return
        screen = self._options.screen
        tap = Tap(screen.width_mm / 2, screen.height_mm / 2, count, interval_s)
        self._control.take_abort()
        # Waited for, as a WALT keeps one shock only while it is asked for other things.
        self._display.prompt(message("Comparing clocks: leave the screen alone"))
        self._compare.wait(TAP_ROLES)
        already = self._saver.tap_count
        start_s = self._time.now() + self._options.countdown_s
        self._display.prompt(message("Tap the spot {n} times", n=count))
        self._display.show(tap, start_s)
        self._saver.call(self._saver.begin_taps)
        self._stage.begin_taps(tap, start_s)
        # A person may need longer than planned; whoever taps in time is done when the last tap was paired.
        patience_s = tap.duration_s * (2.0 if self._time.realtime else 1.0) + 1.0
        self._watch.wait_until(
            start_s + patience_s,
            TAP_ROLES,
            condition=lambda: self._time.realtime and self._saver.tap_count - already >= count,
        )
        self._watch.drain(self._time.now(), TAP_ROLES)
        with suppress(DraglagError):  # the saver keeps the failure; the session ends because of it
            self._saver.call(self._saver.end_taps)
        self._compare.wait(TAP_ROLES)
        self._stage.stop()
        self._display.hide()

    def _clock_check(self, duration_s: float) -> None:
        self._control.take_abort()
        self._display.prompt(message("Comparing clocks: leave the screen alone"))
        self._watch.wait_until(self._time.now() + duration_s, ())
        self._display.prompt("")

    def _rest(self, coming: str = "run") -> bool:
        self._control.take_abort()
        self._display.prompt(message("Rest"))
        by_hand = not self._control.auto
        until_s = self._time.now() + (np.inf if by_hand else self._protocol.rest_s)
        self._emit(events.Resting(until_s - self._time.now(), coming, self._last is not None))
        # Who asks for the run again has said what is next; who aborts between runs has nothing to abort.
        self._watch.wait_until(
            until_s,
            (),
            condition=lambda: (
                self._control.take_proceed() or (by_hand and self._last is not None and self._control.repeating)
            ),
            abortable=False,
        )
        return not self._over()
