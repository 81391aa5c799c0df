"""What the workflow finds: the effects added, step by step, and the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace

from draglag.gap.finding.scan import Finding
from draglag.gap.fitting.joint import Fit
from draglag.recording import Session

# The gap of a sound session over the floor: 95 % of 237 generated ones.
FLOOR_REACHES = "in a single session noise leaves 0.7 to 1.6 times that"
# What a gap may follow, as people call it.
FOLLOWS = {
    "speed": "the drag speed", "session_time": "the session time", "x": "the place along x",
    "time_in_run": "the time in the run", "acceleration": "the acceleration",
    "normal_acceleration": "the normal acceleration", "kind_of_edge": "the kind of edge",
    "direction": "the direction of travel", "direction_angle": "the direction of travel", "taps": "the taps",
    "host_tick": "the ticks of the host", "frame": "the frames of the panel",
    "turn": "the way round of the circle", "run": "the run, by more than panels differ from one to the next",
}  # fmt: skip


def followed(covariate: str) -> str:
    """What a gap follows, in words; an effect's id stays."""
    return FOLLOWS.get(covariate, covariate)


def unexplained_in_words(covariate: str | None, stopped_at: int | None = None) -> str:
    """The verdict ``unexplained`` in a sentence. ``scatter`` is no covariate: it follows none. stopped_at: as many
    effects as the workflow was allowed, where more might be known."""
    scatter = covariate == "scatter"
    what = (
        "single edges scatter more than those of a sound rig"
        if scatter
        else (f"a gap remains that follows {followed(covariate or '')}")
    )
    if stopped_at is not None:
        return f"Unexplained: {what}; effects were limited to {stopped_at}."
    return f"Unexplained: {what}{', and no known effect makes them' if scatter else '; no known effect makes it'}."


@dataclass(frozen=True)
class Step:
    """One effect added. parameters: name → (value, (low, high)); gaps on held-out runs, mm."""

    effect: str
    parameters: dict[str, tuple[float, tuple[float, float]]]
    where: str
    covariate: str
    p_value: float
    evidence: str
    gap_before_mm: float
    gap_after_mm: float
    indistinguishable_from: tuple[str, ...] = ()
    extra_run: str = ""
    gain: float = 0.0  # deviance it saved after its price
    fit: Fit | None = field(default=None, repr=False)
    probability: float | None = None  # that it is part of the explanation, where that is known

    def to_dict(self) -> dict[str, object]:
        gain = 1 - self.gap_after_mm / self.gap_before_mm if self.gap_before_mm > 0 else 0.0
        known = {} if self.probability is None else {"probability": self.probability}
        return {
            "effect": self.effect,
            "indistinguishable_from": list(self.indistinguishable_from),
            "parameters": {k: {"value": v, "ci95": list(ci)} for k, (v, ci) in self.parameters.items()},
            "where": self.where,
            "covariate": self.covariate,
            "evidence": {"p_value": self.p_value, "held_out_gain": gain, "text": self.evidence},
            "gap_before_mm": self.gap_before_mm,
            "gap_after_mm": self.gap_after_mm,
            "extra_run": self.extra_run,
            **known,
        }


@dataclass(frozen=True)
class PassedOver:
    """A structure beyond chance that was given no name: ``what`` it looks like, and in words why it was left."""

    what: str
    p_value: float
    text: str


@dataclass(frozen=True)
class GapReport:
    """The workflow's result. verdict: explained | no_gap | unexplained, or None with ``missing`` for a poor session.
    stopped_at: how many effects were allowed, where that ended the search. excluded: run id → why it was left out."""

    session: str
    verdict: str | None
    steps: tuple[Step, ...] = ()
    noise_floor_mm: float | None = None
    gap_first_mm: float | None = None
    gap_last_mm: float | None = None
    unexplained_by: str | None = None
    p_value: float | None = None
    missing: tuple[str, ...] = ()
    not_seen: dict[str, str] = field(default_factory=dict)
    passed_over: tuple[PassedOver, ...] = ()
    first: Fit | None = field(default=None, repr=False)
    last: Fit | None = field(default=None, repr=False)
    finding: Finding | None = field(default=None, repr=False)
    stopped_at: int | None = None
    excluded: dict[str, str] = field(default_factory=dict)
    simulated: bool = False

    def judged(self, session: Session) -> Session:
        """The session without the runs that the workflow left out."""
        if not self.excluded:
            return session
        return replace(session, runs=tuple(run for run in session.runs if run.id not in self.excluded))

    def to_dict(self) -> dict[str, object]:
        """The design's ``gap --json`` (section 5)."""
        return {
            "session": self.session,
            "simulated": self.simulated,
            "verdict": self.verdict,
            "noise_floor_mm": self.noise_floor_mm,
            "steps": [step.to_dict() for step in self.steps],
            "unexplained_by": self.unexplained_by,
            "gap_first_mm": self.gap_first_mm,
            "gap_last_mm": self.gap_last_mm,
            "p_value": self.p_value,
            "missing": list(self.missing),
            "not_seen": dict(self.not_seen),
            "passed_over": [asdict(item) for item in self.passed_over],
            "excluded": dict(self.excluded),
        }


def unjudged(session: Session, report: GapReport) -> str:
    """The session's runs that the fit does not judge by, in a sentence; or nothing."""
    if report.last is None or report.first is None:
        return ""
    session = report.judged(session)
    first, last = ({fit.runs[k].run.id for k in set(fit.run_index.tolist())} for fit in (report.first, report.last))
    left = [
        f"{run.id} ({run.protocol}, {'left out beside an effect' if run.id in first else 'too few edges or events'})"
        for run in session.runs
        if run.id not in last
    ]
    left = [f"{run} ({why})" for run, why in report.excluded.items()] + left
    return f"Not judged by: {', '.join(left)}." if left else ""
