"""What the functions of ``import draglag as dl`` cannot use is a DataError of one sentence, with the remedy."""

from __future__ import annotations

from collections.abc import Callable
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
    from dataclasses import replace

    (run, *_) = session.runs
    one = replace(session, runs=(replace(run, outcome="aborted"),))
    assert run.id in dl.analyze(one).excluded
    assert run.id not in dl.analyze(one, include="all").excluded
