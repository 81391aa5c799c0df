"""What ``import draglag as dl`` offers; latencies are s in Python, ms in columns and figures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from operator import index
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from draglag.analysis import Analysis, AnalysisOptions
from draglag.analysis import analyze as analyze_session
from draglag.curve import CurveFit, CurvePoints, fit_best, fit_form
from draglag.errors import DataError, EstimateError
from draglag.latency.estimate import WINDOW_S
from draglag.messages import Message, joined, message
from draglag.reading.limits import WHOLE_MOST
from draglag.recording import FloatArray, Session

LONGEST_S = 5.0  # more is no drag latency: ms were given

if TYPE_CHECKING:
    from draglag.curve.compare import CurveDifference
    from draglag.gap.results import GapReport
    from draglag.model.compensation import Compensated
    from draglag.model.file import LatencyModel
    from draglag.simulation.effects import Effect


def read(path: str | Path) -> Session:
    """The session in a file (``.h5``) or an exchange folder. Raises DataError.

    >>> import draglag as dl
    >>> session = dl.read("session.h5")
    >>> len(session.runs), session.screen.name
    (15, 'A 23in')
    """
    path = _path(path)
    if path.is_dir() or path.name == "session.json":
        from draglag.exchange import read_exchange

        return read_exchange(path if path.is_dir() else path.parent)
    from draglag.store import read_session

    return read_session(path)


def write(session: Session, path: str | Path) -> Path:
    """The session file written. Raises DataError; nothing is overwritten.

    >>> import draglag as dl
    >>> dl.write(dl.read("session.h5"), "copy.h5").name
    'copy.h5'
    """
    from draglag.store import write_session

    return write_session(_session(session), _path(path))


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

    Runs without a latency carry flags. Raises EstimateError for an unknown name, DataError for what is no session.

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
    if not isinstance(exclude, Mapping | None):
        raise DataError("exclude names runs without a reason", 'Give one for each, as in exclude={"run-01": "slipped"}')
    kept = frozenset([include] if isinstance(include, str) else include)
    options = AnalysisOptions(
        estimator, update_rate_hz, window_s, form, tie_asymptote, dict(exclude or {}), kept, stylus_mm
    )
    return analyze_session(_session(session), options)


def find_gap(
    session: Session,
    *,
    max_effects: int | None = None,
    without: Collection[str] = (),
    include: Collection[str] = (),
) -> GapReport:
    """Where a session disagrees with the model, by which effects, how probably, and what remains.

    Args:
        max_effects: effects to add at most; None: as many as ``draglag gap`` adds.
        without: ids of effects not to name. include: ids of runs to keep although they went wrong.

    With too few data there is no verdict, and ``missing`` says why. Raises DataError for what is no session.

    >>> import draglag as dl
    >>> report = dl.find_gap(dl.read("session.h5"))
    >>> report.verdict
    'no_gap'
    """
    from draglag.gap.constants import MOST_EFFECTS
    from draglag.gap.workflow import close_gap
    from draglag.simulation.effects import EFFECTS, known_effects

    known_effects(without)
    most = MOST_EFFECTS if max_effects is None else max_effects
    return close_gap(_session(session), most, [e for e in EFFECTS if e not in without], None, include)


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
    from draglag.simulation.chain import simulate_session
    from draglag.simulation.effects import Effect, parse_effects

    if isinstance(effects, Mapping):
        effects = parse_effects(f"{name}={_size(name, value)!r}" for name, value in effects.items())
    elif isinstance(effects, str) or not all(isinstance(effect, Effect) for effect in effects):
        raise DataError("effects have no size", "Give one for each, as in effects={name: size}")
    return simulate_session(screen, protocol, effects=effects, seed=_seed(seed))


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
    standard errors that are not above 0, and latencies that are no numbers or above 5 s; EstimateError with too few
    speeds or an unknown form.

    >>> import draglag as dl
    >>> speed = [40, 80, 150, 250, 400, 600, 800, 1000]
    >>> latency = [0.101, 0.096, 0.089, 0.081, 0.073, 0.067, 0.064, 0.062]
    >>> curve = dl.fit_curve(speed, latency)
    >>> round(float(curve.predict_s(300.0)), 3)
    0.078
    """
    from draglag.curve import FORMS

    points = _points(speed_mm_s, latency_s, se_s)
    if form != "best" and form not in FORMS:
        raise EstimateError(
            message("unknown curve form {form}", form=repr(form)),
            message("Use best or one of {forms}", forms=", ".join(FORMS)),
        )
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
    writers[to](_session(session), _path(path))
    return Path(path)


def write_report(session: Session, analysis: Analysis, folder: str | Path) -> Path:
    """The page ``report.html``, with its figures. Raises DataError; DraglagError without matplotlib.

    >>> import draglag as dl
    >>> session = dl.read("session.h5")
    >>> dl.write_report(session, dl.analyze(session), "report").name
    'report.html'
    """
    from draglag.report import write_report as write
    from draglag.system.packages import need

    need("matplotlib")
    if not isinstance(analysis, Analysis):
        raise _other(message("an analysis"), analysis, message("Analyse the session first: dl.analyze(session)"))
    return write(_session(session), analysis, _path(folder))


def _other(wanted: Message, found: object, remedy: Message) -> DataError:
    return DataError(message("expected {wanted}, found {found}", wanted=wanted, found=type(found).__name__), remedy)


def _session(given: object) -> Session:
    if not isinstance(given, Session):
        raise _other(message("a session"), given, message("Read it first: dl.read(path)"))
    return given


def _path(given: object) -> Path:
    if not isinstance(given, str | PathLike):
        raise _other(message("the path of a file"), given, message("Give it as a text"))
    return Path(given)


def _curve(of: object) -> CurveFit:
    if isinstance(of, CurveFit):
        return of
    if isinstance(of, Session):
        raise _other(message("an analysis or a curve"), of, message("Analyse it first: dl.analyze(session)"))
    if not isinstance(of, Analysis):
        remedy = message("Read it first: dl.analyze(dl.read(path)), or dl.load_model(path) for dl.compensate")
        raise _other(message("an analysis or a curve"), of, remedy)
    if of.curve is None:
        raise EstimateError(message("{session}: there is no curve", session=of.session), joined("; ", of.problems))
    return of.curve


def _numbers(given: ArrayLike) -> FloatArray:
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        raise _other(message("numbers"), given, message("Give an array of numbers")) from None


def _points(speed_mm_s: ArrayLike, latency_s: ArrayLike, se_s: ArrayLike) -> CurvePoints:
    speed, latency = (np.atleast_1d(_numbers(values)) for values in (speed_mm_s, latency_s))
    se = _numbers(se_s)
    if speed.shape != latency.shape or speed.ndim != 1 or se.shape not in ((), (1,), speed.shape):
        raise DataError("speeds, latencies and their errors differ in number", "Give one latency for each speed")
    for name, values, sound, wanted in (
        ("speed_mm_s", speed, (speed > 0) & np.isfinite(speed), message("above 0 mm/s")),
        ("latency_s", latency, np.abs(latency) <= LONGEST_S, message("in seconds, {most:g} at most", most=LONGEST_S)),
        ("se_s", np.atleast_1d(se), np.atleast_1d((se > 0) & np.isfinite(se)), message("above 0 s")),
    ):
        if not sound.all():
            found = float(values[~sound][0])
            raise DataError(
                message("{name} holds {found:g}", name=name, found=found),
                message("Give numbers {wanted}", wanted=wanted),
            )
    return CurvePoints(speed, latency, np.broadcast_to(se, speed.shape).copy())


def _size(effect: str, value: object) -> float:
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise DataError(
            message("effect {effect}: {value} is not a number", effect=effect, value=repr(value)),
            "Give its size as a number",
        ) from None


def _seed(given: object) -> int:
    try:
        seed = index(given)  # type: ignore[arg-type]
    except TypeError:
        seed = -1
    if not 0 <= seed <= WHOLE_MOST:
        raise DataError(message("{seed} is no seed", seed=repr(given)), "Give a whole number from 0 on")
    return seed
