"""Sessions that several tests judge or compare with, and their reports, each made once: nobody changes them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from draglag.exchange import read_exchange
from draglag.gap import GapReport, close_gap
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.simulation import simulate_session

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


@lru_cache
def report_of_recorded() -> GapReport:
    return close_gap(recorded())


@lru_cache
def report_of_plateau() -> GapReport:
    return close_gap(with_plateau())


@lru_cache
def report_of_demo(seed: int = 5) -> GapReport:
    return close_gap(demo(seed))


def gap_mm(report: GapReport) -> float:
    """The last gap of a report that has one."""
    assert report.gap_last_mm is not None
    return report.gap_last_mm
