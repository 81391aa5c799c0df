"""Measurement protocols in TOML, and their runs on a screen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from draglag.messages import message
from draglag.protocol.presets import Length, Positive, Strict, load_screen, load_screen_file, read_toml
from draglag.protocol.targets import SIDEWAYS_PX_S, Chirp, Circle, MultiSine, Step, Target, check_on_screen
from draglag.reading.limits import RUNS, SIZE_MM, WHOLE_MOST
from draglag.recording import Beam, Screen

__all__ = ["PlannedRun", "Protocol", "RunPlan", "expand", "load_protocol", "load_screen", "load_screen_file"]

MARGIN_MM = 4.0
"""Distance of the target from the edges of the screen, so that the stylus stays on it."""

MULTISINE_PEAK = 2.3402
"""Largest excursion of the multi-sine of Table 1 for an amplitude of one."""


Speed = Annotated[Positive, Field(le=20_000)]  # mm/s; no hand is faster than some metres a second


class RunPlan(Strict):
    """One ``[[runs]]`` table, for one or more speeds."""

    kind: Literal["circle", "chirp", "multisine", "step"]
    speed_mm_s: Speed | None = None
    speeds_mm_s: Annotated[tuple[Speed, ...], Field(max_length=RUNS)] = ()
    radius_mm: Length | None = None
    radius_fraction: Annotated[float, Field(gt=0, le=0.5)] = 0.1  # of the screen's width
    duration_s: Annotated[float, Field(gt=0, le=3600)] | None = None
    repeats: Annotated[int, Field(ge=1, le=100)] = 1
    practice: bool = False
    sideways_px_s: Annotated[float, Field(ge=0, allow_inf_nan=False)] = SIDEWAYS_PX_S
    beam_offset_mm: Annotated[float, Field(ge=-SIZE_MM, le=SIZE_MM)] = 0.0  # of the target's centre, down
    start_hz: Positive = 0.05
    end_hz: Positive = 1.0
    peak_fraction: Annotated[float, Field(gt=0, le=0.5)] = 0.25  # multi-sine's peak, of the screen's height
    step_fraction: Annotated[float, Field(gt=0, lt=0.9)] = 0.4  # of the screen's height (the paper, II.D)
    move_s: Positive = 0.4
    step_rest_s: Positive = 0.6
    turn: Literal[1, -1] = 1

    @model_validator(mode="after")
    def _speeds(self) -> RunPlan:
        given = (self.speed_mm_s is not None) + bool(self.speeds_mm_s)
        if self.kind == "circle" and given != 1:
            raise ValueError(message("a circle needs either speed_mm_s or speeds_mm_s"))
        if self.kind != "circle" and given:
            raise ValueError(message("a {kind} has no speed_mm_s: its speed varies", kind=self.kind))
        return self

    @property
    def all_speeds_mm_s(self) -> tuple[float | None, ...]:
        """One ``None`` where the speed varies."""
        return self.speeds_mm_s or (self.speed_mm_s,)


class TapPlan(Strict):
    count: Annotated[int, Field(ge=1, le=10000)] = 100
    when: Literal["start", "end", "both"] = "end"
    interval_s: Annotated[float, Field(ge=0.3, le=60)] = 0.8


class ClockCheck(Strict):
    """Comparisons of clocks, before and after the runs."""

    duration_s: Positive = 10.0
    interval_s: Positive = 1.0


class Protocol(Strict):
    """A whole session as planned; ``source``: its text, for the session file."""

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    seed: Annotated[int, Field(ge=0, le=WHOLE_MOST)] = 0
    shuffle: bool = False
    rest_s: Annotated[float, Field(ge=0, le=3600)] = 10.0
    runs: tuple[RunPlan, ...] = ()
    taps: TapPlan | None = None
    clock_check: ClockCheck | None = None
    source: Annotated[str, Field(exclude=True, repr=False)] = ""

    @model_validator(mode="after")
    def _something(self) -> Protocol:
        if not (self.runs or self.taps or self.clock_check):
            raise ValueError(message("a protocol needs at least one of [[runs]], [taps] and [clock_check]"))
        if sum(plan.repeats * len(plan.all_speeds_mm_s) for plan in self.runs) > RUNS:
            raise ValueError(message("a protocol has at most {most} runs", most=RUNS))
        return self

    @property
    def checks_clocks_twice(self) -> bool:
        """Before and after; once if the protocol holds nothing else."""
        return bool(self.clock_check and (self.runs or self.taps))


@dataclass(frozen=True)
class PlannedRun:
    """One run to record; ``note``: where it gave way to the screen."""

    id: str
    target: Target
    nominal_speed_mm_s: float | None = None
    radius_mm: float | None = None
    practice: bool = False
    note: str = ""

    @property
    def kind(self) -> str:
        return self.target.kind

    @property
    def duration_s(self) -> float:
        return self.target.duration_s


def load_protocol(name_or_path: str | Path) -> Protocol:
    """A protocol by preset name or path of a TOML file. Raises DataError."""
    protocol, text = read_toml(name_or_path, "protocols", Protocol)
    return protocol.model_copy(update={"source": text})


def _sideways(plan: RunPlan, screen: Screen, half_width_mm: float, duration_s: float) -> tuple[float, float, str]:
    """(start x, speed, note), slower than asked if the screen is narrow."""
    asked = plan.sideways_px_s * screen.mm_per_px[0]
    room = screen.width_mm - 2 * (half_width_mm + MARGIN_MM)
    speed = max(0.0, min(asked, room / duration_s))
    note = ""
    if speed < asked:
        note = message(
            "sideways speed lowered from {asked:.2f} to {speed:.2f} mm/s to stay on {screen}",
            asked=asked,
            speed=speed,
            screen=screen.name,
        )
    return (screen.width_mm - speed * duration_s) / 2, speed, note


def _plan_run(plan: RunPlan, speed: float | None, screen: Screen, beam: Beam) -> PlannedRun:
    middle = beam.slope * screen.width_mm / 2 + beam.intercept_mm + plan.beam_offset_mm
    radius = plan.radius_mm or plan.radius_fraction * screen.width_mm
    round_kind = plan.kind in ("circle", "chirp")
    duration = plan.duration_s or {"chirp": 80.0, "multisine": 45.0}.get(plan.kind, 40.0)
    x, drift, note = _sideways(plan, screen, radius if round_kind else 0.0, duration)
    target: Target
    if plan.kind == "circle":
        assert speed is not None  # the model demands it
        target = Circle(x, middle, radius, speed, duration, drift, -math.pi / 2, plan.turn)
    elif plan.kind == "chirp":
        target = Chirp(
            centre_x_mm=x,
            centre_y_mm=middle,
            radius_mm=radius,
            duration_s=duration,
            start_hz=plan.start_hz,
            end_hz=plan.end_hz,
            sideways_mm_s=drift,
            phase_rad=-math.pi / 2,
            turn=plan.turn,
        )
    elif plan.kind == "multisine":
        scale = plan.peak_fraction * screen.height_mm / MULTISINE_PEAK
        target = MultiSine(x, middle, scale, duration, drift)
    else:
        distance = plan.step_fraction * screen.height_mm
        intercept = beam.intercept_mm + plan.beam_offset_mm
        target = Step(x, intercept, distance, beam.slope, duration, drift, plan.move_s, plan.step_rest_s)
    check_on_screen(target, screen, MARGIN_MM)
    return PlannedRun("", target, speed, radius if round_kind else None, plan.practice, note)


def expand(
    protocol: Protocol, screen: Screen, seed: int | None = None, *, beam: Beam | None = None
) -> tuple[PlannedRun, ...]:
    """A protocol's runs on a screen, in the order of recording, with ids run-01, run-02, …

    Args:
        seed: of the order of the circles; the protocol's own if None.
        beam: for targets centred on it; the middle of the screen if None.

    Raises DataError if a target would leave the screen.
    """
    beam = beam or Beam(0.0, screen.height_mm / 2)
    runs = [
        _plan_run(plan, speed, screen, beam)
        for plan in protocol.runs
        for _ in range(plan.repeats)
        for speed in plan.all_speeds_mm_s
    ]
    if protocol.shuffle:
        places = [i for i, run in enumerate(runs) if run.kind == "circle" and not run.practice]
        order = np.random.default_rng(protocol.seed if seed is None else seed).permutation(len(places))
        circles = [runs[places[k]] for k in order]
        for place, run in zip(places, circles, strict=True):
            runs[place] = run
    digits = max(2, len(str(len(runs))))
    return tuple(
        PlannedRun(f"run-{i:0{digits}d}", r.target, r.nominal_speed_mm_s, r.radius_mm, r.practice, r.note)
        for i, r in enumerate(runs, 1)
    )


def first_target_after_s(protocol: Protocol, countdown_s: float) -> float:
    """Time from the start of a session to the first moving target; infinite without runs."""
    if not protocol.runs:
        return math.inf
    before_s = _before_runs_s(protocol, countdown_s)
    return sum(before_s) + len(before_s) * protocol.rest_s + countdown_s


def planned_after_s(protocol: Protocol, runs: Sequence[PlannedRun], countdown_s: float) -> float:
    """Duration of ``runs`` and of the protocol's end, each after a rest."""
    parts_s = [countdown_s + run.duration_s for run in runs] + _after_runs_s(protocol, countdown_s)
    return sum(parts_s) + len(parts_s) * protocol.rest_s


def session_duration_s(protocol: Protocol, runs: Sequence[PlannedRun], countdown_s: float) -> float:
    """Duration of a whole session with countdowns and rests."""
    before_s = _before_runs_s(protocol, countdown_s)
    after_s = planned_after_s(protocol, runs, countdown_s)
    return max(0.0, sum(before_s) + len(before_s) * protocol.rest_s + after_s - protocol.rest_s)


def _before_runs_s(protocol: Protocol, countdown_s: float) -> list[float]:
    parts_s = []
    if protocol.clock_check is not None:
        parts_s.append(protocol.clock_check.duration_s)
    if protocol.taps is not None and protocol.taps.when in ("start", "both"):
        parts_s.append(countdown_s + protocol.taps.count * protocol.taps.interval_s)
    return parts_s


def _after_runs_s(protocol: Protocol, countdown_s: float) -> list[float]:
    parts_s = []
    if protocol.taps is not None and protocol.taps.when in ("end", "both"):
        parts_s.append(countdown_s + protocol.taps.count * protocol.taps.interval_s)
    if protocol.clock_check is not None and protocol.checks_clocks_twice:
        parts_s.append(protocol.clock_check.duration_s)
    return parts_s
