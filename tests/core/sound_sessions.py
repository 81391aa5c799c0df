"""Sessions that several tests judge, change or compare with, and their reports, each made once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from draglag.exchange import read_exchange
from draglag.gap import GapReport, close_gap
from draglag.protocol.runs import Protocol, load_protocol
from draglag.recording import Session, TouchTrace
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect

SAMPLES = Path(__file__).parents[1] / "data" / "exchange"


@lru_cache
def recorded() -> Session:
    """A recorded session without an effect."""
    return read_exchange(SAMPLES / "none-A")


@lru_cache
def with_plateau() -> Session:
    """A recorded session whose law has a plateau."""
    return read_exchange(SAMPLES / "low_speed_plateau")


@lru_cache
def demo(seed: int = 5) -> Session:
    """The demo protocol on the simulated Screen 1."""
    return simulate_session("screen-1", load_protocol("demo"), seed=seed)


def brief_protocol() -> Protocol:
    """The demo's circles and chirp, 15 s each, without taps."""
    demo = load_protocol("demo")
    runs = tuple(r.model_copy(update={"duration_s": 15.0}) for r in demo.runs if r.kind in ("circle", "chirp"))
    return demo.model_copy(update={"runs": runs, "taps": None})


@lru_cache
def brief(*effects: str) -> Session:
    """The brief protocol on the simulated Screen 1 with these effects."""
    return simulate_session("screen-1", brief_protocol(), effects=[parse_effect(e) for e in effects], seed=3)


@lru_cache
def report_of_recorded() -> GapReport:
    return close_gap(recorded())


@lru_cache
def report_of_plateau() -> GapReport:
    return close_gap(with_plateau())


@lru_cache
def report_of_demo(seed: int = 5) -> GapReport:
    return close_gap(demo(seed))


@lru_cache
def report_of_unnamed_skew() -> GapReport:
    """Of the brief session with a skew of 30 ms, for which the library holds no name."""
    return close_gap(brief("scan_skew=0.03"), candidates=["laser_bounce"])


def gap_mm(report: GapReport) -> float:
    """The last gap of a report that has one."""
    assert report.gap_last_mm is not None
    return report.gap_last_mm


def with_touch(session: Session, change: Callable[[TouchTrace], TouchTrace]) -> Session:
    """The session with every touch trace changed."""
    return replace(session, runs=tuple(replace(run, touch=change(run.touch)) for run in session.runs))


def in_steps(touch: TouchTrace, step_mm: float, across_mm: float | None = None) -> TouchTrace:
    """The trace in whole steps; across_mm: of y, where they differ."""
    y_step_mm = across_mm or step_mm
    x_mm, y_mm = np.round(touch.x_mm / step_mm) * step_mm, np.round(touch.y_mm / y_step_mm) * y_step_mm
    return replace(touch, x_mm=x_mm, y_mm=y_mm)
