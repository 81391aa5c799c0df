"""What ``import draglag as dl`` offers; latencies are s in Python, ms in columns and figures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from numpy.typing import ArrayLike

from draglag.analysis import Analysis, AnalysisOptions
from draglag.analysis import analyze as analyze_session
from draglag.analysis.arguments import checked_options, kept_runs_of, of_session
from draglag.arguments import names_of, other, path_of, whole_in
from draglag.curve import CurveFit, fit_best, fit_form
from draglag.curve.arguments import numbers_of as _numbers
from draglag.curve.arguments import points_of
from draglag.errors import DataError, EstimateError
from draglag.latency.estimate import WINDOW_S
from draglag.messages import joined, message
from draglag.recording import Session

MOST_ADDED = 20  # effects of one search, as ``draglag gap --max-effects`` has it

if TYPE_CHECKING:
    from draglag.curve.compare import CurveDifference
    from draglag.gap.results import GapReport
    from draglag.model.compensation import Compensated
    from draglag.model.file import LatencyModel, ModelEffect, Provenance
    from draglag.simulation.effects import Effect


def read(path: str | Path) -> Session:
    """The session in a file (``.h5``) or an exchange folder. Raises DataError.

    >>> import draglag as dl
    >>> session = dl.read("session.h5")
    >>> len(session.runs), session.screen.name
    (15, 'A 23in')
    """
    path = path_of(path)
    if path.is_dir() or path.name == "session.json":
        from draglag.exchange import read_exchange, session_folder

        return read_exchange(session_folder(path))
    from draglag.store import read_session

    return read_session(path)


def write(session: Session, path: str | Path) -> Path:
    """The session file written. Raises DataError; nothing is overwritten.

    >>> import draglag as dl
    >>> dl.write(dl.read("session.h5"), "copy.h5").name
    'copy.h5'
    """
    from draglag.store import write_session

    return write_session(_session(session), path_of(path))


def analyze(
    session: Session,
    *,
    estimator: str = "efficient",
    update_rate_hz: float | None = None,
    window_s: tuple[float, float] = WINDOW_S,
    form: str = "best",
    tie_asymptote: bool = False,
    exclude: Mapping[str, str] | None = None,
    include: Collection[str] = (),
    stylus_mm: float | None = None,
) -> Analysis:
    """Latency of every run with its interval, the curve of latency against speed, taps and validation.

    Args:
        estimator: "efficient", "paper" (Eq. 1-3 as published), or another package's.
        update_rate_hz: emulate a loop that holds the last event; None: the kernel's stamps.
        window_s: latencies searched.
        form: "best" or a name of ``draglag.curve.FORMS``. tie_asymptote: hold a7 at the median release tap.
        exclude: run id → reason. include: ids of runs to keep although they went wrong, or "all".
        stylus_mm: diameter of the stylus, where the session was recorded with a wrong one.

    Runs without a latency carry flags. Raises EstimateError for an unknown name, DataError for what is no session, for
    an unknown run, and for a number beyond ``draglag.analysis.arguments``.

    >>> import draglag as dl
    >>> analysis = dl.analyze(dl.read("session.h5"))
    >>> analysis.curve.form
    'double_exponential'
    >>> analysis.to_dataframe()[["run", "latency_ms"]].shape
    (13, 2)
    >>> list(analysis.to_xarray().sizes)
    ['run', 'speed_mm_s']
    >>> axes = analysis.plot()
    >>> axes.get_xlabel()
    'drag speed, mm/s'
    """
    given = _session(session)
    options = AnalysisOptions(
        estimator,
        update_rate_hz,
        window_s,
        form,
        tie_asymptote,
        {} if exclude is None else exclude,
        include,  # type: ignore[arg-type]  # made a set of names with the rest
        stylus_mm,
    )
    return analyze_session(given, checked_options(given, options))


def find_gap(
    session: Session,
    *,
    max_effects: int | None = None,
    without: Collection[str] = (),
    include: Collection[str] = (),
) -> GapReport:
    """Where a session disagrees with the model, by which effects, how probably, and what remains.

    Args:
        max_effects: effects to add at most, up to 20; None: as many as ``draglag gap`` adds.
        without: ids of effects not to name. include: ids of runs to keep although they went wrong, or "all".

    With too few data there is no verdict, and ``missing`` says why. Raises DataError for what is no session, and for an
    unknown effect or run.

    >>> import draglag as dl
    >>> report = dl.find_gap(dl.read("session.h5"))
    >>> report.verdict
    'no_gap'
    """
    from draglag.gap.constants import MOST_EFFECTS
    from draglag.gap.workflow import close_gap
    from draglag.simulation.effects import EFFECTS, known_effects

    given = _session(session)
    most = MOST_EFFECTS if max_effects is None else whole_in("max_effects", max_effects, 0, MOST_ADDED)
    left_out = known_effects(names_of("without", without))
    return close_gap(given, most, [e for e in EFFECTS if e not in left_out], None, kept_runs_of(given, include))


def simulate(
    screen: str | Path = "screen-1",
    protocol: str | Path = "demo",
    *,
    effects: Mapping[str, float] | Sequence[Effect] = (),
    seed: int = 0,
) -> Session:
    """A session of a simulated screen, reproducible from its arguments.

    Args:
        screen, protocol: presets (``screen_names``, ``protocol_names``) or TOML files.
        effects: id → size (``draglag simulate --help``), or effects of your own.

    Raises DataError for unknown names, sizes that are no numbers, and a seed that is no whole number from 0 on.

    >>> import draglag as dl
    >>> dl.simulate("screen-1", seed=3).runs[0].protocol
    'circle'
    """
    from draglag.simulation.arguments import effects_of, preset_of, seed_of
    from draglag.simulation.chain import simulate_session

    panel = preset_of(screen, message("the name of a screen"))
    drawn = preset_of(protocol, message("the name of a protocol"))
    return simulate_session(panel, drawn, effects=effects_of(effects), seed=seed_of(seed))


def screen_names() -> list[str]:
    """Names of draglag's screens.

    >>> import draglag as dl
    >>> "screen-1" in dl.screen_names()
    True
    """
    from draglag_resources import presets

    return presets("screens")


def protocol_names() -> list[str]:
    """Names of draglag's protocols.

    >>> import draglag as dl
    >>> "latency-sweep" in dl.protocol_names()
    True
    """
    from draglag_resources import presets

    return presets("protocols")


def fit_curve(
    speed_mm_s: ArrayLike,
    latency_s: ArrayLike,
    se_s: ArrayLike | float = 1e-3,
    *,
    form: str = "best",
) -> CurveFit:
    """The curve of latency against speed through given points, (n,) each.

    ``form``: "best" or a name of ``draglag.curve.FORMS``. Raises DataError for arrays of different length, speeds and
    standard errors that are not above 0, latencies that are no numbers, above 5 s or all below 0, and speeds of 5 mm/s
    at most (m/s were given); EstimateError with too few speeds or an unknown form.

    >>> import draglag as dl
    >>> speed = [40, 80, 150, 250, 400, 600, 800, 1000]
    >>> latency = [0.101, 0.096, 0.089, 0.081, 0.073, 0.067, 0.064, 0.062]
    >>> curve = dl.fit_curve(speed, latency)
    >>> round(float(curve.predict_s(300.0)), 3)
    0.078
    """
    from draglag.curve import FORMS

    if form != "best" and form not in FORMS:
        raise EstimateError(
            message("unknown curve form {form}", form=repr(form)),
            message("Use best or one of {forms}", forms=", ".join(FORMS)),
        )
    points = points_of(speed_mm_s, latency_s, se_s)
    return fit_best(points) if form == "best" else fit_form(points, form)


def compare(first: Analysis | CurveFit, second: Analysis | CurveFit) -> CurveDifference:
    """Second curve less first, at speeds covered by both.

    Raises EstimateError if an analysis has no curve or they share no speeds, DataError for anything else.

    >>> import draglag as dl
    >>> analysis = dl.analyze(dl.read("session.h5"))
    >>> dl.compare(analysis, analysis).p_value
    1.0
    """
    from draglag.curve.compare import curve_difference

    difference = curve_difference(_curve(first), _curve(second))
    if difference is None:
        raise EstimateError("the curves share no speeds", "Measure both screens at the same speeds")
    return difference


def compensate(
    t_s: ArrayLike,
    x_mm: ArrayLike,
    y_mm: ArrayLike,
    law: Analysis | CurveFit | LatencyModel,
    contact_id: ArrayLike | None = None,
    *,
    extrapolate: bool = False,
) -> Compensated:
    """Where the stylus was behind recorded touch events (n,), as ``draglag compensate`` computes it; NaN where unknown.

    The last events of each contact, about one latency, have no place: the events that would show it were not recorded,
    as the contact had ended. Effects of a model are corrected for as far as events show them; ``notes`` of the result
    says which, and which are left.

    Args:
        t_s, x_mm, y_mm: seconds and mm, in any order.
        contact_id: (n,) numbers or texts, as contacts are taken one by one; None: all events are of one contact.
        extrapolate: follow the curve beyond its measured speeds, not hold its ends.

    Raises DataError with fewer than eight usable events in every contact, for times, positions or contacts that cannot
    be right, and for what is no law.

    >>> import draglag as dl
    >>> session = dl.read("session.h5")
    >>> touch = session.runs[0].touch
    >>> moved = dl.compensate(touch.t_s, touch.x_mm, touch.y_mm, dl.analyze(session))
    >>> moved.x_stylus_mm.shape == touch.x_mm.shape
    True
    """
    from draglag.gap.compensating import compensate_events
    from draglag.model.file import LatencyModel, model_of

    model = law if isinstance(law, LatencyModel) else model_of(_curve(law))
    t, x, y = (_numbers(values) for values in (t_s, x_mm, y_mm))
    return compensate_events(t, x, y, model, contact_id, extrapolate=extrapolate).noted()


def model_of(
    curve: CurveFit,
    provenance: Provenance | None = None,
    effects: Sequence[tuple[str, Mapping[str, float]] | ModelEffect] = (),
) -> LatencyModel:
    """The model of a fitted curve.

    ``effects``: id and sizes of each, as in ``[(id, {"across_s": 0.002})]``. Raises DataError for anything
    else, for an unknown effect and for one without a size.

    >>> import draglag as dl
    >>> model = dl.model_of(dl.analyze(dl.read("session.h5")).curve)
    >>> bool(0.13 < model.latency_s(50.0) < 0.15)
    True
    """
    from draglag.model.file import ModelEffect, Provenance
    from draglag.model.file import model_of as made_of
    from draglag.simulation.arguments import sized_effects

    if not isinstance(provenance, Provenance | None):
        raise other(message("a provenance"), provenance, message("Leave it out, or give that of another model"))
    return made_of(curve, provenance, sized_effects(effects, ModelEffect))


def save_model(model: LatencyModel, path: str | Path) -> None:
    """Write a model as JSON. Raises DataError if the file exists or cannot be written, and for what is no model.

    >>> import draglag as dl
    >>> dl.save_model(dl.model_of(dl.analyze(dl.read("session.h5")).curve), "saved.json")
    """
    from draglag.model.file import save_model as save

    save(model, path_of(path))


def load_model(path: str | Path) -> LatencyModel:
    """A model from its file. Raises DataError.

    >>> import draglag as dl
    >>> dl.load_model("model.json").form
    'double_exponential'
    """
    from draglag.model.file import load_model as load

    return load(path_of(path))


def export(session: Session, path: str | Path, to: Literal["exchange", "csv", "netcdf", "mat"] = "csv") -> Path:
    """The folder or file written for other programs. Raises DataError; nothing is overwritten.

    >>> import draglag as dl
    >>> dl.export(dl.read("session.h5"), "session.mat", to="mat").name
    'session.mat'
    """
    from draglag import exchange

    writers: dict[str, Callable[[Session, Path], object]] = {
        "exchange": exchange.write_exchange,
        "csv": exchange.write_csv,
        "netcdf": exchange.write_netcdf,
        "mat": exchange.write_mat,
    }
    if to not in writers:
        raise DataError(
            message("unknown format {to}", to=repr(to)), message("Use one of {formats}", formats=", ".join(writers))
        )
    writers[to](_session(session), path_of(path))
    return Path(path)


def write_report(session: Session, analysis: Analysis, folder: str | Path) -> Path:
    """The page ``report.html``, with its figures.

    Raises DataError, also for the analysis of another session; DraglagError without matplotlib.

    >>> import draglag as dl
    >>> session = dl.read("session.h5")
    >>> dl.write_report(session, dl.analyze(session), "report").name
    'report.html'
    """
    from draglag.report import write_report as write
    from draglag.system.packages import need

    need("matplotlib")
    if not isinstance(analysis, Analysis):
        raise other(message("an analysis"), analysis, message("Analyse the session first: dl.analyze(session)"))
    of_session(_session(session), analysis)
    return write(session, analysis, path_of(folder))


def _session(given: object) -> Session:
    if not isinstance(given, Session):
        raise other(message("a session"), given, message("Read it first: dl.read(path)"))
    return given


def _curve(of: object) -> CurveFit:
    if isinstance(of, CurveFit):
        return of
    if isinstance(of, Session):
        raise other(message("an analysis or a curve"), of, message("Analyse it first: dl.analyze(session)"))
    if not isinstance(of, Analysis):
        remedy = message("Read it first: dl.analyze(dl.read(path)), or dl.load_model(path) for dl.compensate")
        raise other(message("an analysis or a curve"), of, remedy)
    if of.curve is None:
        raise EstimateError(message("{session}: there is no curve", session=of.session), joined("; ", of.problems))
    return of.curve
