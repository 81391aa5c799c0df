"""The paper's screens, simulated and measured as published."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from draglag.latency.estimate import prepare
from draglag.path.inversion import Law
from draglag.protocol.runs import Protocol, RunPlan, load_protocol
from draglag.recording import FloatArray, Session
from draglag.reproduction.curves import Row2, effects_of, measured_row, sample_hold_rms_ms
from draglag.reproduction.further import FurtherSeeds, further_seeds
from draglag.reproduction.own_gap import OwnGap, own_gap
from draglag.reproduction.published import PLATEAU_MM_S, PRESETS, TABLE_2, TABLE_3
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effects
from draglag.validation.misalignment import Validation, validate_run

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Cell3:
    """One cell of Table 3, over three repeats; ``reading``: how the chirp's size was read."""

    screen: str
    target: str
    reading: str
    j0_per_edge_mm2: float
    delta_j_percent: float
    paper_j0_mm2: float
    paper_delta_j_percent: float
    expected_j0_mm2: float | None
    j0_fixed_lines_mm2: float
    runs: tuple[Validation, ...]

    @property
    def as_good(self) -> bool:
        return self.delta_j_percent >= self.paper_delta_j_percent


@dataclass(frozen=True)
class Reproduction:
    table_2: tuple[Row2, ...]
    table_3: tuple[Cell3, ...]
    validation_sessions: dict[str, Session]
    seed: int
    own_gap: OwnGap | None = None
    further: FurtherSeeds | None = None

    def to_dict(self) -> dict[str, object]:
        return {
            "seed": self.seed,
            "simulated": True,
            "table_2": [
                {
                    "screen": row.screen,
                    "rms_ms": row.rms_ms,
                    "paper_rms_ms": row.paper_rms_ms,
                    "rms_held_at_100_hz_ms": row.sample_hold_rms_ms,
                    "rms_no_worse": row.rms_ms <= row.paper_rms_ms,
                    "coefficients": [
                        {
                            "name": c.name,
                            "paper": c.paper,
                            "value": c.value,
                            "value_ci95": None if c.ci95 is None else list(c.ci95),
                            "paper_inside": c.agrees,
                        }
                        for c in row.coefficients
                    ],
                }
                for row in self.table_2
            ],
            "table_3": [
                {
                    "screen": cell.screen,
                    "target": cell.target,
                    "reading": cell.reading,
                    "J0_per_edge_mm2": cell.j0_per_edge_mm2,
                    "paper_J0_per_edge_mm2": cell.paper_j0_mm2,
                    "expected_J0_per_edge_mm2": cell.expected_j0_mm2,
                    "J0_about_corrected_lines_mm2": cell.j0_fixed_lines_mm2,
                    "delta_J_percent": cell.delta_j_percent,
                    "paper_delta_J_percent": cell.paper_delta_j_percent,
                    "at_least_the_papers": cell.as_good,
                }
                for cell in self.table_3
            ],
            "own_gap": None if self.own_gap is None else self.own_gap.to_dict(),
            "further_seeds": None if self.further is None else self.further.to_dict(),
        }


def reproduce(seed: int = 3, progress: Progress | None = None, n_further: int = 20) -> Reproduction:
    """Tables 2 and 3 from simulated sessions; ``n_further`` seeds for the coverage of Table 2."""
    on_progress = progress or (lambda fraction, text: None)
    rows = []
    for k, screen in enumerate(TABLE_2):
        on_progress(0.02 * k, f"{screen}: sweep")
        row = measured_row(screen, seed)
        rows.append(replace(row, sample_hold_rms_ms=sample_hold_rms_ms(row)))
    further = further_seeds(
        range(seed + 1, seed + 1 + n_further), lambda fraction, text: on_progress(0.06 + 0.29 * fraction, text)
    )
    cells: list[Cell3] = []
    sessions: dict[str, Session] = {}
    for k, screen in enumerate(TABLE_3):
        row = next(r for r in rows if r.screen == ("Screen 1" if screen == "Screen 1" else "Screen 2 (corrected)"))
        on_progress(0.35 + 0.2 * k, f"{screen}: validation")
        session, found = _cells(screen, row, seed)
        sessions[screen] = session
        cells += found
    gap = own_gap(seed, progress=lambda fraction, text: on_progress(0.75 + 0.25 * fraction, f"own gap: {text}"))
    on_progress(1.0, "done")
    return Reproduction(tuple(rows), tuple(cells), sessions, seed, gap, further)


def _cells(screen: str, row: Row2, seed: int) -> tuple[Session, list[Cell3]]:
    preset = PRESETS[row.screen]
    base = load_protocol("validation-x3")
    chirps = tuple(RunPlan(kind="chirp", radius_fraction=share, duration_s=80.0, repeats=3) for share in (0.1, 0.2))
    rest = tuple(plan for plan in base.runs if plan.kind != "chirp")
    protocol: Protocol = base.model_copy(update={"runs": chirps + rest})
    session = simulate_session(preset, protocol, effects=parse_effects(effects_of(screen)), seed=seed)
    law = _law(row, screen)
    width_mm = session.screen.width_mm
    true_law = rig_for_screen(preset).law
    groups: dict[tuple[str, str], list[Validation]] = {}
    for run in session.runs:
        reading = ""
        if run.protocol == "chirp":
            reading = "diameter" if (run.radius_mm or 0.0) < 0.15 * width_mm else "radius"
        one = validate_run(prepare(run, session.stylus.diameter_mm), law)
        groups.setdefault((run.protocol, reading), []).append(one)
    cells = []
    for (target, reading), same in groups.items():
        j0, gained = TABLE_3[screen][target]
        share = {"diameter": 0.1, "radius": 0.2}.get(reading)
        cells.append(
            Cell3(
                screen=screen,
                target=target,
                reading=reading,
                j0_per_edge_mm2=float(np.mean([v.j0_per_edge_mm2 for v in same])),
                delta_j_percent=float(np.mean([v.delta_j_percent for v in same])),
                paper_j0_mm2=j0,
                paper_delta_j_percent=gained,
                expected_j0_mm2=None
                if share is None
                else chirp_j0_mm2(lambda v: np.asarray(true_law.latency_s(v)), share * width_mm),
                j0_fixed_lines_mm2=float(np.mean([_j0_about_corrected_lines(v) for v in same])),
                runs=tuple(same),
            )
        )
    return session, cells


def _j0_about_corrected_lines(one: Validation) -> float:
    """J(0)/N about the corrected edges' lines: on a circle a free slope absorbs part of the lag."""
    a, lines = one.alignment, one.alignment.lines
    top = a.side < 0
    slope = np.where(top, lines.slope_top, lines.slope_bottom)
    intercept = np.where(top, lines.intercept_top_mm, lines.intercept_bottom_mm)
    return float(np.mean((a.y_raw_mm - slope * a.x_raw_mm - intercept) ** 2))


def _law(row: Row2, screen: str) -> Law:
    def law(speed_mm_s: FloatArray) -> FloatArray:
        floor = PLATEAU_MM_S if screen == "Screen 2" else 0.0
        return row.curve.predict_s(np.maximum(speed_mm_s, floor))

    return law


def chirp_j0_mm2(law: Law, radius_mm: float, start_hz: float = 0.05, end_hz: float = 1.0) -> float:
    """J(0)/N of a perfect chirp under a law: the mean of (v · L(v))² over its crossings, as frequent as revolutions."""
    f_hz = np.linspace(start_hz, end_hz, 2001)
    shift_mm = radius_mm * np.sin(np.minimum(2 * np.pi * f_hz * law(2 * np.pi * f_hz * radius_mm), np.pi / 2))
    return float(np.sum(f_hz * shift_mm**2) / np.sum(f_hz))
