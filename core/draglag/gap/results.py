"""Results of the workflow."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

from draglag.gap.constants import NEXT_TO_UNNAMED, STATED_AT_MOST
from draglag.gap.fitting.joint import Fit
from draglag.gap.posterior.judge import Judgement
from draglag.recording import Session
from draglag.shown import table_html
from draglag.simulation.effects import effect_class

FLOOR_REACHES = "in a single session noise leaves 0.7 to 1.6 times that"
"""The gap of a sound session over the floor: 95 % of 237 generated ones."""

BY_TAPS = "taps"
"""Covariate of a step that taps show and edges do not."""

FOLLOWS = {
    "speed": "the drag speed", "session_time": "the session time", "x": "the place along x",
    "time_in_run": "the time in the run", "acceleration": "the acceleration",
    "normal_acceleration": "the normal acceleration", "kind_of_edge": "the kind of edge",
    "direction": "the direction of travel", "direction_angle": "the direction of travel", "taps": "the taps",
    "host_tick": "the ticks of the host", "frame": "the frames of the panel",
    "turn": "the way round of the circle", "run": "the run, by more than panels differ from one to the next",
}  # fmt: skip
"""What a gap may follow, in words."""


UNEXPLAINED = ("unexplained",)
"""In ``GapReport.explanations``: whatever has no name."""


def stated(probability: float) -> str:
    """Probability with two digits, at most ``STATED_AT_MOST``."""
    return f"{min(probability, STATED_AT_MOST):.2f}" if probability >= 0.005 else "< 0.01"


def followed(covariate: str) -> str:
    """In words; an effect's id unchanged."""
    return FOLLOWS.get(covariate, covariate)


def unexplained_in_words(
    covariate: str | None, stopped_at: int | None = None, probability: float | None = None, instead: str = ""
) -> str:
    """The verdict ``unexplained``. stopped_at: limit on effects that ended the search. instead: what to say in place of
    that no effect makes it."""
    word = "Unexplained" if probability is None else f"Unexplained (probability {stated(probability)})"
    scatter = covariate == "scatter"
    what = (
        "single edges scatter more than those of a sound rig"
        if scatter
        else (f"a gap remains that follows {followed(covariate or '')}")
    )
    if stopped_at is not None:
        return f"{word}: {what}; effects were limited to {stopped_at}."
    if instead:
        return f"{word}: {what}; {instead}."
    return f"{word}: {what}{', and no known effect makes them' if scatter else '; no known effect makes it'}."


@dataclass(frozen=True)
class Step:
    """One effect added.

    parameters: name → (value, 95 % interval). p_value: likelihood ratio; 1e-9 where the
    streams show it, 1 − probability by taps. gaps: on held-out runs. probability: of it or
    one indistinguishable from it.
    """

    effect: str
    parameters: dict[str, tuple[float, tuple[float, float]]]
    where: str
    covariate: str
    p_value: float
    evidence: str
    gap_before_mm: float
    gap_after_mm: float
    probability: float
    indistinguishable_from: tuple[str, ...] = ()
    extra_run: str = ""
    fit: Fit | None = field(default=None, repr=False)

    def to_dict(self) -> dict[str, object]:
        gain = 1 - self.gap_after_mm / self.gap_before_mm if self.gap_before_mm > 0 else 0.0
        return {
            "effect": self.effect,
            "probability": self.probability,
            "indistinguishable_from": list(self.indistinguishable_from),
            "parameters": {k: {"value": v, "ci95": list(ci)} for k, (v, ci) in self.parameters.items()},
            "where": self.where,
            "covariate": self.covariate,
            "evidence": {"p_value": self.p_value, "held_out_gain": gain, "text": self.evidence},
            "gap_before_mm": self.gap_before_mm,
            "gap_after_mm": self.gap_after_mm,
            "extra_run": self.extra_run,
        }


def next_to_unnamed(step: Step) -> Step:
    """Step at the lower probability next to something unnamed, unless streams show it."""
    in_streams = effect_class(step.effect).detected_by
    return step if in_streams else replace(step, probability=NEXT_TO_UNNAMED * step.probability)


@dataclass(frozen=True)
class LawStatement:
    """The curve's form. probability: that it is not Eq. 5; misses_s: RMS from the nearest."""

    adequate: bool = True
    probability: float = 0.0
    misses_s: float = 0.0

    def to_dict(self) -> dict[str, object]:
        form = "double_exponential" if self.adequate else "other"
        return {
            "form": form,
            "adequate": self.adequate,
            "probability_other": min(self.probability, STATED_AT_MOST),
            "misses_ms": 1e3 * self.misses_s,
        }


@dataclass(frozen=True)
class Tolerated:
    """Structure below the size of interest. follows: covariate or effect id."""

    follows: str
    probability: float
    size_mm: float


@dataclass(frozen=True)
class NoisePart:
    """Part of the noise: ``touch``, ``blur`` or of ``fitting.noise.Components``; size_mm: RMS over edges."""

    name: str
    level: float
    size_mm: float


@dataclass(frozen=True)
class Statistic:
    """Statistic of the predictive check. follows: covariate of a disagreement."""

    name: str
    follows: str
    measured: float
    simulated: float
    unit: str
    agrees: bool


@dataclass(frozen=True)
class GapReport:
    """Result of the workflow.

    verdict: explained | no_gap | unexplained, or None with ``missing``. explanations: 95 % of the mass, its own first.
    not_seen: effect → recording that would show it. first, last: fits without and with all steps. stopped_at: limit on
    effects that ended the search. excluded, flagged: run id → reason, flags of its edges.
    """

    session: str
    verdict: str | None
    steps: tuple[Step, ...] = ()
    noise_floor_mm: float | None = None
    gap_first_mm: float | None = None
    gap_last_mm: float | None = None
    unexplained_by: str | None = None
    probability: float | None = None
    explanations: tuple[tuple[tuple[str, ...], float], ...] = ()
    law: LawStatement = field(default_factory=LawStatement)
    tolerated: tuple[Tolerated, ...] = ()
    missing: tuple[str, ...] = ()
    not_seen: dict[str, str] = field(default_factory=dict)
    first: Fit | None = field(default=None, repr=False)
    last: Fit | None = field(default=None, repr=False)
    judgement: Judgement | None = field(default=None, repr=False)
    stopped_at: int | None = None
    excluded: dict[str, str] = field(default_factory=dict)
    flagged: dict[str, str] = field(default_factory=dict)
    simulated: bool = False
    noise: tuple[NoisePart, ...] = ()
    check: tuple[Statistic, ...] = ()

    def judged(self, session: Session) -> Session:
        """Session without excluded runs."""
        if not self.excluded:
            return session
        return replace(session, runs=tuple(run for run in session.runs if run.id not in self.excluded))

    def to_dict(self) -> dict[str, object]:
        return {
            "session": self.session,
            "simulated": self.simulated,
            "verdict": self.verdict,
            "noise_floor_mm": self.noise_floor_mm,
            "steps": [step.to_dict() for step in self.steps],
            "unexplained_by": self.unexplained_by,
            "gap_first_mm": self.gap_first_mm,
            "gap_last_mm": self.gap_last_mm,
            "probability": self.probability,
            "explanations": [{"effects": list(names), "probability": p} for names, p in self.explanations],
            "law": self.law.to_dict(),
            "tolerated": [asdict(item) for item in self.tolerated],
            "noise": [asdict(item) for item in self.noise],
            "check": [asdict(item) for item in self.check],
            "missing": list(self.missing),
            "not_seen": dict(self.not_seen),
            "excluded": dict(self.excluded),
            "flagged": dict(self.flagged),
        }

    def __repr__(self) -> str:
        names = ", ".join(step.effect for step in self.steps)
        sure = "" if self.probability is None else f", probability {stated(self.probability)}"
        return f"GapReport({self.session!r}: {self.verdict or 'no verdict'}{sure}{': ' + names if names else ''})"

    def _repr_html_(self) -> str:
        verdict = (self.verdict or "no verdict").replace("_", " ")
        if not self.steps:
            sure = None if self.probability is None else stated(self.probability)
            rows = [(self.gap_last_mm, self.noise_floor_mm, sure, self.unexplained_by or None)]
            head = ["gap, mm", "noise floor, mm", "probability", "follows"]
            return table_html(f"Gap of {self.session}: {verdict}", head, rows)
        head = ["effect", "parameter", "value", "low", "high", "probability", "where", "before, mm", "after, mm"]
        unknown = float("nan")
        effects = [
            (s.effect, name, value, *ci95, stated(s.probability), s.where, s.gap_before_mm, s.gap_after_mm)
            for s in self.steps
            for name, (value, ci95) in (s.parameters or {"": (unknown, (unknown, unknown))}).items()
        ]
        return table_html(f"Gap of {self.session}: {verdict}", head, effects)


def unjudged(session: Session, report: GapReport) -> str:
    """Runs not used, or in part, in sentences."""
    if report.last is None or report.first is None:
        return ""
    session = report.judged(session)
    first, last = ({fit.runs[k].run.id for k in set(fit.run_index.tolist())} for fit in (report.first, report.last))
    left = [
        f"{run.id} ({run.protocol}, {'left out with an effect' if run.id in first else 'too few edges or events'})"
        for run in session.runs
        if run.id not in last
    ]
    left = [f"{run} ({why})" for run, why in report.excluded.items()] + left
    part = [f"{run} ({flags})" for run, flags in report.flagged.items()]
    sentences = [("Not judged by", left), ("With edges excluded or scattered", part)]
    return " ".join(f"{words}: {', '.join(runs)}." for words, runs in sentences if runs)
