"""Table 2 from simulated sweeps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from draglag.analysis import Analysis, AnalysisOptions, analyze
from draglag.curve import CurveFit
from draglag.errors import EstimateError
from draglag.messages import message
from draglag.numerics import student_t
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.reproduction.published import PLATEAU_MM_S, PRESETS, TABLE_2
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effects


@dataclass(frozen=True)
class Coefficient:
    """One cell of Table 2; ``ci95`` None if the data do not determine it."""

    name: str
    paper: float
    value: float
    ci95: tuple[float, float] | None

    @property
    def agrees(self) -> bool | None:
        return None if self.ci95 is None else self.ci95[0] <= self.paper <= self.ci95[1]


@dataclass(frozen=True)
class Row2:
    screen: str
    coefficients: tuple[Coefficient, ...]
    rms_ms: float
    paper_rms_ms: float
    curve: CurveFit
    analysis: Analysis
    session: Session
    sample_hold_rms_ms: float | None = None


def sample_hold_rms_ms(row: Row2) -> float | None:
    """RMS of the row measured as the paper does (sample-and-hold at 100 Hz, Eq. 2)."""
    options = replace(row.analysis.options, estimator="paper", update_rate_hz=100.0)
    curve = analyze(row.session, options).curve
    return None if curve is None else 1e3 * curve.rms_s


def effects_of(screen: str) -> list[str]:
    """Effects of a screen of the paper in addition to Eq. 5."""
    return [] if screen == "Screen 1" else [f"low_speed_plateau={PLATEAU_MM_S:g}"]


def measured_row(screen: str, seed: int) -> Row2:
    """The simulated and analysed sweep of one row. Raises EstimateError without a curve."""
    protocol = load_protocol("latency-sweep")
    taps = load_protocol("taps-100").taps
    session = simulate_session(
        PRESETS[screen],
        protocol.model_copy(update={"taps": taps}),
        effects=parse_effects(effects_of(screen)),
        seed=seed,
    )
    exclude = {}
    if screen != "Screen 1":
        exclude = {
            run.id: "on the plateau"
            for run in session.runs
            if run.nominal_speed_mm_s is not None and run.nominal_speed_mm_s < PLATEAU_MM_S
        }
    tied = screen.endswith("(corrected)")
    analysis = analyze(session, AnalysisOptions(form="double_exponential", tie_asymptote=tied, exclude=exclude))
    if analysis.curve is None:
        raise EstimateError(message("{screen}: no curve from the simulated sweep", screen=screen), "Try another --seed")
    paper = TABLE_2[screen]
    return Row2(
        screen,
        _coefficients(analysis.curve, paper),
        1e3 * analysis.curve.rms_s,
        paper["rms_ms"],
        analysis.curve,
        analysis,
        session,
    )


def _coefficients(curve: CurveFit, paper: dict[str, float]) -> tuple[Coefficient, ...]:
    """Our coefficients under the paper's names: its a4 is the larger amplitude."""
    values, errors = curve.parameters, curve.standard_errors
    names = {name: name for name in values}
    free = 5 - (curve.tied_asymptote_s is not None)
    reach = student_t(max(curve.n_points - free, 1), 0.975)
    sure = {name: values[name] > reach * errors[name] for name in ("a1_ms", "a4_ms")}
    # An amplitude that may be nothing is not the larger one, whatever its value.
    if (sure["a1_ms"], values["a1_ms"]) > (sure["a4_ms"], values["a4_ms"]):
        names |= {"a1_ms": "a4_ms", "a4_ms": "a1_ms", "a2_s_per_mm": "a5_s_per_mm", "a5_s_per_mm": "a2_s_per_mm"}
    out = []
    for name, published in paper.items():
        if name == "rms_ms":
            continue
        ours = names[name]
        amplitude = {"a2_s_per_mm": "a1_ms", "a5_s_per_mm": "a4_ms"}.get(ours, ours)
        gone = not sure.get(amplitude, True)
        error = errors[ours]
        known = not gone and np.isfinite(error) and error > 0
        interval = (values[ours] - reach * error, values[ours] + reach * error) if known else None
        out.append(Coefficient(name, published, values[ours], interval))
    return tuple(out)
