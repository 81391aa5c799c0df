"""The paper's own gap: Eq. 5 lacks the plateau of Screen 2 in Fig. 5."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from draglag.errors import DraglagError
from draglag.gap import GapReport, close_gap
from draglag.gap.replaying.replay import Replay, replays
from draglag.gap.results import stated
from draglag.protocol.runs import Protocol, load_protocol
from draglag.recording import Session
from draglag.reproduction.published import PLATEAU_MM_S
from draglag.simulation import simulate_session
from draglag.simulation.effects.low_speed_plateau import LowSpeedPlateau

Progress = Callable[[float, str], None]
PLATEAU = LowSpeedPlateau.id


@dataclass(frozen=True)
class OwnGap:
    """The result on simulated Screen 2. truth_mm_s: the simulated plateau."""

    truth_mm_s: float
    session: Session = field(repr=False)
    report: GapReport = field(repr=False)
    replays: tuple[Replay, ...] = field(default=(), repr=False)

    @property
    def plateau_mm_s(self) -> tuple[float, tuple[float, float]] | None:
        """The plateau found and its 95 % interval."""
        step = next((s for s in self.report.steps if s.effect == PLATEAU), None)
        return None if step is None else step.parameters["speed_mm_s"]

    @property
    def closed(self) -> bool:
        """Whether the plateau alone was named and nothing remains."""
        return self.report.verdict == "explained" and [s.effect for s in self.report.steps] == [PLATEAU]

    def to_dict(self) -> dict[str, object]:
        return {
            "screen": "Screen 2",
            "simulated_plateau_mm_s": self.truth_mm_s,
            "closed": self.closed,
            "gap": self.report.to_dict(),
            "replays": [replay.to_dict() for replay in self.replays],
        }


def own_gap(seed: int = 3, protocol: Protocol | None = None, progress: Progress | None = None) -> OwnGap:
    """The gap workflow on Screen 2, simulated with that plateau."""
    effects = (LowSpeedPlateau(PLATEAU_MM_S),)
    session = simulate_session("screen-2", protocol or load_protocol("latency-sweep"), effects=effects, seed=seed)
    report = close_gap(session, progress=progress)
    try:
        again = replays(session, report)
    except DraglagError:
        again = ()
    return OwnGap(PLATEAU_MM_S, session, report, again)


def gap_words(found: OwnGap) -> Iterator[str]:
    """The result in sentences."""
    report, plateau = found.report, found.plateau_mm_s
    if report.verdict is None:
        yield f"The paper's own gap could not be judged: {'; '.join(report.missing)}."
        return
    yield (
        f"The paper's own gap: Screen 2 simulated with the plateau of Fig. 5 below {found.truth_mm_s:g} mm/s, which "
        f"Eq. 5 lacks. With Eq. 5 alone the held-out gap is {report.gap_first_mm:.3f} mm where noise leaves "
        f"{report.noise_floor_mm:.3f} mm."
    )
    if plateau is None:
        yield f"The plateau was not named (verdict: {report.verdict}, following {report.unexplained_by or 'nothing'})."
        return
    value, (low, high) = plateau
    step = next(s for s in report.steps if s.effect == PLATEAU)
    others = [s.effect for s in report.steps if s.effect != PLATEAU]
    yield (
        f"Found and named: {PLATEAU} at {value:.1f} mm/s (95 %: {low:.1f} to {high:.1f}; simulated "
        f"{found.truth_mm_s:g}), probability {stated(step.probability)}"
        + (f"; also named: {', '.join(others)}." if others else "; nothing else was named.")
    )
    left = f"; what remains follows {report.unexplained_by}" if report.unexplained_by else ""
    yield f"Closed to: {report.gap_last_mm:.3f} mm held-out gap, verdict {report.verdict}{left}."
    if len(found.replays) > 1:
        first, last = found.replays[0], found.replays[-1]
        yield (
            "Simulated again with the measured hand, edges are off by "
            f"{first.rms_ms:.2f} ms ({first.rms_ms_ci95[0]:.2f} to {first.rms_ms_ci95[1]:.2f}) before and "
            f"{last.rms_ms:.2f} ms ({last.rms_ms_ci95[0]:.2f} to {last.rms_ms_ci95[1]:.2f}) after; the latency of "
            f"{last.runs_that_agree[0]} of {last.runs_that_agree[1]} runs agrees within its interval."
        )


def gap_figures(found: OwnGap) -> Iterator[tuple[str, str, Any]]:
    """Name, caption and figure."""
    from draglag.report import replayed
    from draglag.report.gap_figures import waterfall

    if found.report.verdict is None:
        return
    yield "own-gap-steps", "The paper's own gap, step by step", waterfall(found.report)
    if found.replays:
        first, last = found.replays[0], found.replays[-1]
        caption = "Latency of every run of Screen 2, measured and simulated without and with the plateau"
        yield "own-gap-latency", caption, replayed.latencies_figure(first, last)
        yield "own-gap-edges", "Edges of Screen 2, simulated and measured", replayed.edges_figure(first, last)
