"""Models of what ``--json`` prints; their docstrings are descriptions in the published schemas."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

Number = float | None
Interval = tuple[Number, Number] | None


class _Output(BaseModel):
    model_config = ConfigDict(extra="forbid")


class RunOutput(_Output):
    """One run."""

    id: str
    protocol: str
    nominal_speed_mm_s: Number
    speed_mm_s: Number
    speed_filtered_mm_s: Number
    latency_ms: Number
    latency_ci95_ms: Interval
    latency_random_ms: Number
    latency_systematic_ms: Number
    correction_ms: Number
    clock_uncertainty_ms: Number
    stamps: str
    n_edges: int
    n_rejected: int
    J0_per_edge_mm2: Number
    J_per_edge_mm2: Number
    stylus_diameter_mm: Number
    travel_per_diameter: Number
    flags: list[str]
    in_curve: bool


class RivalOutput(_Output):
    """Another form of the curve."""

    form: str
    aicc: Number
    held_out_rms_ms: Number


class CurveOutput(_Output):
    """Latency against speed; parameters in the units of their names."""

    form: str
    parameters: dict[str, Number]
    standard_errors: dict[str, Number]
    rms_ms: Number
    between_runs_ms: Number
    speed_range_mm_s: tuple[float, float]
    n_points: int
    tied_asymptote_ms: Number
    rivals: list[RivalOutput]


class TapsOutput(_Output):
    """Taps of one kind."""

    n: int
    n_rejected: int
    median_ms: Number
    median_ci95_ms: Interval
    iqr_ms: Interval
    clock_uncertainty_ms: Number


class ValidationOutput(_Output):
    """Eq. 4 on one run."""

    run: str
    protocol: str
    n_edges: int
    J0_per_edge_mm2: Number
    J_per_edge_mm2: Number
    delta_J_percent: Number
    mean_latency_ms: Number
    n_extrapolated: int
    flags: list[str]


class ValidationMeanOutput(_Output):
    """Eq. 4, the mean of a protocol's runs."""

    protocol: str
    n_runs: int
    J0_per_edge_mm2: Number
    J_per_edge_mm2: Number
    delta_J_percent: Number


class AsymptoteOutput(_Output):
    """Tap median against the curve's asymptote."""

    taps: str
    difference_ms: Number
    difference_ci95_ms: Interval
    margin_ms: Number
    p_value: Number
    equivalent: bool


class WidthOutput(_Output):
    """Width of the stylus against the known one."""

    n: int
    mean_mm: Number
    mean_ci95_mm: Interval
    known_mm: Number
    difference_mm: Number


class DriftOutput(_Output):
    """A device's clock against the host's."""

    stream: str
    drift_ppm: Number
    drift_se_ppm: Number
    ms_per_minute: Number
    residual_ms: Number
    span_s: Number
    within_1_ms_per_minute: bool


class VerificationOutput(_Output):
    """The sanity checks."""

    asymptote: list[AsymptoteOutput]
    stylus_width: WidthOutput | None
    clocks: list[DriftOutput]


class AnalyzeOutput(_Output):
    """``draglag analyze SESSION --json``, without ``--model``; also ``result_json`` of a session file."""

    session: str
    simulated: bool
    estimator: str
    update_rate_hz: Number
    runs: list[RunOutput]
    curve: CurveOutput | None
    taps: dict[str, TapsOutput]
    validation: list[ValidationOutput]
    validation_mean: list[ValidationMeanOutput]
    verification: VerificationOutput
    excluded: dict[str, str] = Field(description="run → why it is not in the curve")
    repeated: dict[str, str] = Field(description="run that gave nothing → the run recorded in its place")
    problems: list[str]
    warnings: list[str]


class ParameterOutput(_Output):
    """A parameter of an effect."""

    value: Number
    ci95: Interval


class EvidenceOutput(_Output):
    """What speaks for an effect."""

    p_value: Number
    held_out_gain: Number
    text: str


class StepOutput(_Output):
    """One effect that was added to the model."""

    effect: str
    probability: Number
    indistinguishable_from: list[str]
    parameters: dict[str, ParameterOutput]
    where: str
    covariate: str
    evidence: EvidenceOutput
    gap_before_mm: Number
    gap_after_mm: Number
    extra_run: str


class ExplanationOutput(_Output):
    """A set of effects."""

    effects: list[str]
    probability: Number


class LawOutput(_Output):
    """Whether Eq. 5 describes the curve."""

    form: str
    adequate: bool
    probability_other: Number
    misses_ms: Number


class ToleratedOutput(_Output):
    """Structure beyond chance that is smaller than the size of interest."""

    follows: str
    probability: Number
    size_mm: Number


class NoisePartOutput(_Output):
    """A part of the noise, in the unit of its name, and what it makes of the noise floor."""

    name: str
    level: Number
    size_mm: Number


class StatisticOutput(_Output):
    """One statistic of the posterior predictive check."""

    name: str
    follows: str
    measured: Number
    simulated: Number
    unit: str
    agrees: bool


class GapOutput(_Output):
    """``draglag gap SESSION --json``, without ``--provisional``."""

    session: str
    simulated: bool
    verdict: str | None
    noise_floor_mm: Number
    steps: list[StepOutput]
    unexplained_by: str | None
    gap_first_mm: Number
    gap_last_mm: Number
    probability: Number
    explanations: list[ExplanationOutput]
    law: LawOutput
    tolerated: list[ToleratedOutput]
    noise: list[NoisePartOutput]
    check: list[StatisticOutput]
    missing: list[str]
    not_seen: dict[str, str] = Field(description="effect → the recording that would show it")
    excluded: dict[str, str] = Field(description="run → why it was left out")
    flagged: dict[str, str] = Field(description="run → flags of its edges, where it is judged by")


class ComparedCurveOutput(CurveOutput):
    """The curve of one session."""

    session: str
    simulated: bool


class DifferenceAtOutput(_Output):
    """The difference at one speed."""

    speed_mm_s: float
    difference_ms: Number
    difference_ci95_ms: Interval


class DifferenceOutput(_Output):
    """A session's curve minus the first one's; without numbers where they share no speeds."""

    session: str
    p_value: Number = None
    differ: bool | None = None
    rms_ms: Number = None
    at: list[DifferenceAtOutput]


class RankedOutput(_Output):
    """The place of one session by its mean latency."""

    session: str
    mean_latency_ms: float
    mean_latency_ci95_ms: Interval
    rank: int
    rank_ci95: list[int]


class RankingOutput(_Output):
    """All sessions, least mean latency first, over the speeds that all share."""

    speed_range_mm_s: list[float]
    places: list[RankedOutput]


class CompareOutput(_Output):
    """``draglag compare SESSION SESSION … --json``."""

    first: str
    curves: list[ComparedCurveOutput]
    differences: list[DifferenceOutput]
    ranking: RankingOutput | None
    failed: dict[str, str]
