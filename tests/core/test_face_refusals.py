"""What the functions of ``import draglag as dl`` cannot use is a DataError of one sentence, with the remedy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import draglag as dl
from draglag.curve import CurvePoints, fit_form

SPEED = np.array([40.0, 80.0, 150.0, 250.0, 400.0, 600.0, 800.0, 1000.0])
LATENCY = np.array([0.101, 0.096, 0.089, 0.081, 0.073, 0.067, 0.064, 0.062])
T = 0.01 * np.arange(40)
READ = "expected a session, found str. Read it first: dl.read(path)."
ANALYSE = "expected an analysis or a curve, found Session. Analyse it first: dl.analyze(session)."


@pytest.fixture(scope="module")
def session() -> dl.Session:
    return dl.read(Path(__file__).parents[1] / "data" / "exchange" / "none-A")


@pytest.fixture(scope="module")
def curve() -> dl.CurveFit:
    return fit_form(CurvePoints(SPEED, LATENCY, np.full(8, 1e-3)), "constant")


Call = Callable[[dl.Session, dl.CurveFit], object]


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s, c: dl.analyze("file.h5"), READ),  # type: ignore[arg-type]
        (lambda s, c: dl.find_gap("file.h5"), READ),  # type: ignore[arg-type]
        (lambda s, c: dl.write("file.h5", "x.h5"), READ),  # type: ignore[arg-type]
        (lambda s, c: dl.export("file.h5", "x"), READ),  # type: ignore[arg-type]
        (lambda s, c: dl.write_report(s, c, "x"), "expected an analysis, found CurveFit. Analyse the session first"),
        (lambda s, c: dl.read(5), "expected the path of a file, found int. Give it as a text."),
        (lambda s, c: dl.compare(s, s), ANALYSE),
        (lambda s, c: dl.compare(c, None), "expected an analysis or a curve, found NoneType. Read it first"),
        (lambda s, c: dl.compensate(T, T, T, "mm.json"), "found str. Read it first: dl.analyze(dl.read(path)), or"),
        (lambda s, c: dl.compensate(T, T, ["a"] * 40, c), "expected numbers, found list. Give an array of numbers."),
        (lambda s, c: dl.model_of(None), "expected a curve, found NoneType. Give that of an analysis"),
        (lambda s, c: dl.model_of(s), "expected a curve, found Session. Give that of an analysis"),
        (lambda s, c: dl.save_model(c, "x.json"), "expected a model, found CurveFit. Make it first: dl.model_of("),
        (lambda s, c: dl.analyze(s, exclude=["run-01"]), 'exclude names runs without a reason. Give one for each'),
        (lambda s, c: dl.analyze(s, exclude="run-01"), 'as in exclude={"run-01": "slipped"}.'),
        (lambda s, c: dl.simulate(effects={"clock_drift": "x"}), "effect clock_drift: 'x' is not a number. Give"),
        (lambda s, c: dl.simulate(effects={"clock_drift": None}), "effect clock_drift: None is not a number."),
        (lambda s, c: dl.simulate(effects=["clock_drift"]), 'effects have no size. Give one for each, as in'),
        (lambda s, c: dl.simulate(effects="clock_drift"), "effects have no size."),
        (lambda s, c: dl.simulate(seed=-1), "-1 is no seed. Give a whole number from 0 on."),
        (lambda s, c: dl.simulate(seed=1.5), "1.5 is no seed."),
        (lambda s, c: dl.simulate(seed=2**200), "is no seed."),
        (lambda s, c: dl.simulate(effects={"foo": 1}), "unknown effect 'foo'; use one of clock_drift, clock_offset"),
        (lambda s, c: dl.simulate(effects=5), "expected effects, found int. Give their sizes, as in effects={name:"),
        (lambda s, c: dl.simulate(effects=None), "expected effects, found NoneType."),
        (lambda s, c: dl.simulate(5), "expected the name of a screen, found int. Give its name, or the path of its"),
        (lambda s, c: dl.simulate(None), "expected the name of a screen, found NoneType."),
        (lambda s, c: dl.simulate("screen-1", None), "expected the name of a protocol, found NoneType."),
        (lambda s, c: dl.load_model(5), "expected the path of a file, found int."),
        (lambda s, c: dl.load_model(None), "expected the path of a file, found NoneType."),
        (lambda s, c: dl.load_model(dl.model_of(c)), "expected the path of a file, found LatencyModel."),
        (lambda s, c: dl.save_model(dl.model_of(c), 5), "expected the path of a file, found int."),
        (lambda s, c: dl.model_of(c, effects=[("foo", {})]), "unknown effect 'foo'. Use one of clock_drift, clock_off"),
        (lambda s, c: dl.model_of(c, effects=[("clock_drift", {"drift_ppm": np.nan})]), "nan is not a number. Give"),
        (lambda s, c: dl.model_of(c, effects=[("clock_drift", {"drift_ppm": "x"})]), "'x' is not a number. Give its"),
        (lambda s, c: dl.model_of(c, effects=[("clock_drift", {})]), "effects have no size. Give each with its sizes"),
        (lambda s, c: dl.model_of(c, effects={"clock_drift": 60}), "as in effects=[(id, {name: size})]."),
        (lambda s, c: dl.model_of(c, effects="clock_drift"), "effects have no size."),
        (lambda s, c: dl.model_of(c, effects=["clock_drift"]), "effects have no size."),
        (lambda s, c: dl.model_of(c, effects=5), "effects have no size."),
        (lambda s, c: dl.model_of(c, 5), "expected a provenance, found int. Leave it out, or give that of another"),
        (lambda s, c: dl.read("a\0b"), "'a\\x00b': cannot be the name of a file. Check the name."),
        (lambda s, c: dl.read("."), ".: holds no session. Name a session file (.h5), or a folder that"),
        (lambda s, c: c.plot(5), "expected axes, found int. Give axes of matplotlib, or none."),
        (lambda s, c: c.predict_s(-5), "a speed of -5 mm/s is below 0. Give speeds from 0 mm/s on."),
        (lambda s, c: c.band_s([10, -5]), "a speed of -5 mm/s is below 0."),
        (lambda s, c: dl.find_gap(s, include=["foo"]), "there is no run 'foo'. Its runs are run-01, run-02"),
        (lambda s, c: dl.find_gap(s, include=5), 'include is 5. Give a list of texts, as in include=["a", "b"].'),
        (lambda s, c: dl.find_gap(s, without=5), "without is 5. Give a list of texts"),
        (lambda s, c: dl.find_gap(s, without="foo"), "unknown effect 'foo'. Use one of clock_drift"),
    ],
)  # fmt: skip
def test_what_is_of_the_wrong_kind_is_one_sentence(
    session: dl.Session, curve: dl.CurveFit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(dl.DataError) as refused:
        call(session, curve)
    assert said in str(refused.value)
    assert list(tmp_path.iterdir()) == []


WINDOW = "Give the smallest and the largest latency in seconds, from -2 to 5, as in window_s=(0, 0.4)."
RATE = "Give a number from 1 to 10000."
STYLUS = "Give a number above 0, 100 at most."


@pytest.mark.parametrize(
    ("name", "values", "remedy"),
    [
        ("update_rate_hz", ["120", -5, 0, np.nan, np.inf, 1e-9, [120], 1e9, True], RATE),
        ("window_s", [0.3, (0.3,), (0, np.nan), (0, np.inf), ("0", "0.3"), None, {0: 0, 1: 1}], WINDOW),
        ("window_s", [(0.3, 0.1), (0, 0), (0, 400), (0, 0.1, 0.2), "03", {0, 1}], WINDOW),
        ("stylus_mm", ["7", 700, 0, -7, np.nan, [7]], STYLUS),
        ("tie_asymptote", ["no", 1, None], "Give True or False."),
        ("include", [5, [5]], 'Give a list of texts, as in include=["a", "b"].'),
        ("estimator", [5, ["paper"]], "Give a text."),
        ("form", [None], "Give a text."),
    ],
)
def test_an_analysis_refuses_what_it_cannot_use(
    session: dl.Session, name: str, values: list[object], remedy: str
) -> None:
    for value in values:
        with pytest.raises(dl.DataError) as refused:
            dl.analyze(session, **{name: value})  # type: ignore[arg-type]
        assert str(refused.value) == f"{name} is {value!r}. {remedy}"


@pytest.mark.parametrize("most", ["1", -1, 1.5, np.nan, True, 21])
def test_a_search_adds_a_whole_number_of_effects(session: dl.Session, most: object) -> None:
    with pytest.raises(dl.DataError) as refused:
        dl.find_gap(session, max_effects=most)  # type: ignore[arg-type]
    assert str(refused.value) == f"max_effects is {most!r}. Give a whole number from 0 to 20."


@pytest.mark.parametrize(
    "arguments", [{"exclude": {"run-99": "x"}}, {"include": ["run-99"]}, {"include": "run-99"}, {"exclude": {9: "x"}}]
)
def test_a_run_that_is_none_is_refused(session: dl.Session, arguments: dict[str, object]) -> None:
    with pytest.raises(dl.DataError) as refused:
        dl.analyze(session, **arguments)  # type: ignore[arg-type]
    wrong = 9 if 9 in arguments.get("exclude", ()) else "run-99"  # type: ignore[operator]
    assert str(refused.value).startswith(f"{session.name}: there is no run {wrong!r}. Its runs are run-01, run-02, run")


def test_what_can_be_used_is_used(session: dl.Session) -> None:
    analysis = dl.analyze(
        session, update_rate_hz=np.float32(100), window_s=[0, np.float64(0.3)], stylus_mm=np.int64(7),  # type: ignore[arg-type]
        tie_asymptote=np.True_, exclude={"run-01": "slipped"}, include=iter(["run-02"]),  # type: ignore[arg-type]
    )  # fmt: skip
    assert analysis.excluded == {"run-01": "slipped"}
    assert (analysis.options.window_s, analysis.options.stylus_mm, analysis.options.tie_asymptote) == (
        (0, 0.3),
        7,
        True,
    )
    assert analysis.options.update_rate_hz == 100


def test_a_model_is_made_with_its_effects(curve: dl.CurveFit) -> None:
    first = dl.model_of(curve, effects=[("clock_drift", {"drift_ppm": 60})])
    assert dl.model_of(curve, effects=first.effects).effects[0].parameters == {"drift_ppm": 60.0}


def test_one_name_leaves_out_one_effect(session: dl.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []
    monkeypatch.setattr("draglag.gap.workflow.close_gap", lambda s, most, allowed, *more: asked.append(allowed))
    dl.find_gap(session, without="clock_drift")
    dl.find_gap(session, without=["clock_drift"])
    assert asked[0] == asked[1]
    assert "clock_drift" not in asked[0]
    assert "clock_offset" in asked[0]


def test_a_report_is_of_the_session_that_was_analysed(session: dl.Session, tmp_path: Path) -> None:
    analysis = dl.analyze(session)
    for other in (
        replace(session, name="tuesday"),
        replace(session, started_utc="2026-01-02T03:04:05Z"),
        replace(session, runs=session.runs[1:]),
    ):
        with pytest.raises(
            dl.DataError, match=r": the analysis is of another session, .* Analyse this one: dl\.analyze"
        ):
            dl.write_report(other, analysis, tmp_path / "report")
    assert list(tmp_path.iterdir()) == []


def changed(values: np.ndarray, to: float) -> np.ndarray:
    return np.where(np.arange(8) == 3, to, values)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((changed(SPEED, np.nan), LATENCY), "speed_mm_s holds nan. Give numbers above 0 mm/s."),
        ((changed(SPEED, np.inf), LATENCY), "speed_mm_s holds inf. Give numbers above 0 mm/s."),
        ((changed(SPEED, 0.0), LATENCY), "speed_mm_s holds 0. Give numbers above 0 mm/s."),
        ((-SPEED, LATENCY), "speed_mm_s holds -40. Give numbers above 0 mm/s."),
        ((SPEED, changed(LATENCY, np.nan)), "latency_s holds nan. Give numbers in seconds, 5 at most."),
        ((SPEED, 1e3 * LATENCY), "latency_s holds 101. Give numbers in seconds, 5 at most."),
        ((1e-3 * SPEED, LATENCY), "speed_mm_s holds 1 at most, which is no drag's in mm/s. Give mm/s: multiply m/s by"),
        ((SPEED, -LATENCY), "latency_s holds no number above 0. Give latencies as how far the touch lags, in seconds."),
        ((SPEED, LATENCY[:5]), "speeds, latencies and their errors differ in number. Give one latency for each speed."),
        ((SPEED, LATENCY, np.full(5, 1e-3)), "speeds, latencies and their errors differ in number."),
        ((SPEED, LATENCY, 0.0), "se_s holds 0. Give numbers above 0 s."),
        ((SPEED, LATENCY, changed(LATENCY, np.nan)), "se_s holds nan. Give numbers above 0 s."),
        ((SPEED, ["a"] * 8), "expected numbers, found list. Give an array of numbers."),
        ((SPEED[:, None], LATENCY[:, None]), "speeds, latencies and their errors differ in number."),
    ],
)
def test_points_that_are_none_are_refused(arguments: tuple[object, ...], said: str) -> None:
    with pytest.raises(dl.DataError) as refused:
        dl.fit_curve(*arguments)  # type: ignore[arg-type]
    assert said in str(refused.value)


def test_all_runs_are_included_by_one_word(session: dl.Session) -> None:
    (run, *_) = session.runs
    one = replace(session, runs=(replace(run, outcome="aborted"),))
    assert run.id in dl.analyze(one).excluded
    assert run.id not in dl.analyze(one, include="all").excluded
