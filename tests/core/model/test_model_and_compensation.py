from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from draglag.curve import CurvePoints, fit_form
from draglag.errors import DataError
from draglag.model.compensation import compensate
from draglag.model.file import LatencyModel, load_model, lookup_table, model_of, save_lookup, save_model
from draglag.model.tracking import tracking_response
from draglag.protocol.runs import Protocol, RunPlan
from draglag.reading.limits import DOCUMENT_BYTES
from draglag.simulation import LatencyLaw
from draglag.simulation.chain import simulate_session
from draglag.simulation.rig import rig_for_screen

LAW = LatencyLaw(90.53, 4e-3, 182.9, 2.9e-2, 28.49)
SPEEDS = np.geomspace(44, 1000, 16)


@pytest.fixture
def model() -> LatencyModel:
    points = CurvePoints(SPEEDS, LAW.latency_s(SPEEDS), np.full(16, 1e-4))
    return model_of(fit_form(points, "double_exponential"), effects=[("clock_drift", {"ppm": 60.0})])


def test_a_model_survives_its_file(model: LatencyModel, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    save_model(model, path)
    back = load_model(path)
    assert back == model
    assert back.latency_s(SPEEDS) == pytest.approx(LAW.latency_s(SPEEDS), abs=3e-5)
    assert back.curve.band_s(SPEEDS)[0] == pytest.approx(model.curve.band_s(SPEEDS)[0])
    assert back.not_compensated == ("clock_drift",)
    with pytest.raises(DataError, match="not overwritten"):
        save_model(model, path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"version": 9}, "version 9"),
        ({"form": "cubic"}, "unknown curve form"),
        ({"parameters": {"a1_ms": 1.0}}, "has the parameters"),
        ({"covariance": [[1.0]]}, "covariance"),
        ({"extra": 1}, "extra"),
        ({"speed_range_mm_s": [100, 10]}, "low to high"),
        (
            {"parameters": dict.fromkeys(("a1_ms", "a2_s_per_mm", "a4_ms", "a5_s_per_mm", "a7_ms"), 1e308)},
            "beyond 60 s",
        ),
        (
            {"parameters": {"a1_ms": 90.0, "a2_s_per_mm": -0.03, "a4_ms": 9.0, "a5_s_per_mm": -0.3, "a7_ms": 30.0}},
            "beyond 60 s",
        ),
    ],
)
def test_a_wrong_model_is_refused_by_name(
    model: LatencyModel, tmp_path: Path, change: dict[str, object], words: str
) -> None:
    path = tmp_path / "bad.json"
    path.write_text(json.dumps({**model.model_dump(mode="json"), **change}))
    with pytest.raises(DataError, match=words):
        load_model(path)


def test_an_effect_of_a_package_that_is_gone_is_said_as_such(model: LatencyModel, tmp_path: Path) -> None:
    path = tmp_path / "left_half.json"
    own = {"id": "left_half", "parameters": {"late_s": 0.02}}
    path.write_text(json.dumps({**model.model_dump(mode="json"), "effects": [own]}))
    with pytest.raises(DataError, match="left_half is not known here") as caught:
        load_model(path)
    assert "package" in caught.value.remedy


def test_a_large_file_of_another_kind_is_answered_with_what_a_model_is(tmp_path: Path) -> None:
    path = tmp_path / "session.h5"
    path.write_bytes(b"0" * (DOCUMENT_BYTES + 1))
    with pytest.raises(DataError) as caught:
        load_model(path)
    assert "--save-model" in caught.value.remedy


def test_what_is_no_json_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text("{nonsense")
    with pytest.raises(DataError, match="not JSON"):
        load_model(path)


def test_outside_its_range_a_model_holds_its_ends(model: LatencyModel) -> None:
    assert model.latency_s(np.array([1.0])) == pytest.approx(model.latency_s(np.array([44.0])))
    assert model.latency_s(np.array([1.0]), extrapolate=True)[0] > 0.25


def test_lookup_tables(model: LatencyModel, tmp_path: Path) -> None:
    from scipy.io import loadmat

    table = lookup_table(model)
    save_lookup(model, tmp_path / "t.mat")
    save_lookup(model, tmp_path / "t.csv")
    mat = loadmat(tmp_path / "t.mat")
    csv = np.genfromtxt(tmp_path / "t.csv", delimiter=",", names=True)
    assert np.all(np.diff(table["speed_mm_s"]) > 0)
    assert mat["latency_s"].ravel() == pytest.approx(table["latency_s"])
    assert csv["latency_s"] == pytest.approx(table["latency_s"], rel=1e-7)
    with pytest.raises(DataError, match="neither"):
        save_lookup(model, tmp_path / "t.xls")
    with pytest.raises(DataError, match="there is no such folder"):
        save_lookup(model, tmp_path / "none" / "t.mat")


def drag(latency_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    t_s = np.arange(0, 5, 1 / 120)
    angle = 4 * (t_s - latency_s)
    return t_s, 50 * np.cos(angle), 50 * np.sin(angle)


def test_a_known_lag_is_taken_out() -> None:
    t_s, x_mm, y_mm = drag(0.08)
    done = compensate(t_s, x_mm, y_mm, lambda v: np.full(np.shape(v), 0.08))
    known = np.isfinite(done.x_stylus_mm)
    assert known.mean() > 0.95
    assert done.x_stylus_mm[known] == pytest.approx(50 * np.cos(4 * t_s[known]), abs=0.05)
    assert done.latency_s == pytest.approx(0.08)
    # 200 mm/s for 80 ms is 16 mm along the path.
    assert done.report()["moved_mm_min_median_max"][1] == pytest.approx(16, abs=0.3)  # type: ignore[index]


def test_time_never_runs_backwards_and_nan_stays_nan() -> None:
    rng = np.random.default_rng(0)
    t_s, x_mm, y_mm = drag(0.0)
    stop = t_s > 2.5
    x_mm[stop], y_mm[stop] = x_mm[~stop][-1], y_mm[~stop][-1]
    x_mm = x_mm + 0.1 * rng.standard_normal(x_mm.size)
    x_mm[100:103] = np.nan
    done = compensate(t_s, x_mm, y_mm, LAW.latency_s, (44.0, 1000.0))
    good = np.isfinite(done.stylus_t_s)
    assert not good[100:103].any()
    assert good.sum() == t_s.size - 3
    assert np.all(np.diff(done.stylus_t_s[good]) >= 0)
    assert done.extrapolated[-100:-5].all()  # the last few events have no speed


def circle_plan(speed_mm_s: float) -> RunPlan:
    return RunPlan(kind="circle", speed_mm_s=speed_mm_s, duration_s=15.0)


@pytest.mark.parametrize(
    ("screen", "plan", "least_lag_mm", "most_mm"),
    [
        ("screen-1", circle_plan(77.0), 7.0, 0.35),
        ("screen-1", circle_plan(135.0), 7.0, 0.35),
        ("screen-1", circle_plan(750.0), 7.0, 0.5),
        ("screen-2", circle_plan(44.0), 7.0, 0.35),
        ("screen-2", circle_plan(77.0), 7.0, 0.3),
        # The trace jumps here: fresh news of a fast stylus overtakes older of a slow one.
        ("screen-2", RunPlan(kind="multisine", duration_s=45.0), 4.0, 1.5),
    ],
)
def test_compensation_of_a_hand_brings_the_trace_to_the_stylus(
    screen: str, plan: RunPlan, least_lag_mm: float, most_mm: float
) -> None:
    """The same hand on a screen without lag shows where the stylus was; positions there scatter by 0.15 mm an axis."""
    rig = rig_for_screen(screen)
    protocol = Protocol(name="one", runs=(plan,))
    shown = simulate_session(rig, protocol, seed=11).runs[0].touch
    at_once = LatencyLaw(0.0, 4e-3, 0.0, 2.9e-2, 0.0)
    true = simulate_session(replace(rig, law=at_once), protocol, seed=11).runs[0].touch
    done = compensate(shown.t_s, shown.x_mm, shown.y_mm, rig.law.latency_s)
    away_mm = np.hypot(
        done.x_stylus_mm - np.interp(shown.t_s, true.t_s, true.x_mm),
        done.y_stylus_mm - np.interp(shown.t_s, true.t_s, true.y_mm),
    )
    lag_mm = np.hypot(
        shown.x_mm - np.interp(shown.t_s, true.t_s, true.x_mm), shown.y_mm - np.interp(shown.t_s, true.t_s, true.y_mm)
    )
    placed = np.isfinite(away_mm)
    assert np.sqrt(np.mean(lag_mm**2)) > least_lag_mm
    assert placed.mean() > 0.97
    assert np.sqrt(np.mean(away_mm[placed] ** 2)) < most_mm


def test_a_pause_of_days_between_events_is_two_movements() -> None:
    t_s, x_mm, y_mm = drag(0.05)
    both = compensate(np.append(t_s, t_s + 3e8), np.append(x_mm, x_mm), np.append(y_mm, y_mm), lambda v: 0 * v + 0.05)
    assert both.latency_s[10:-10] == pytest.approx(0.05, abs=1e-3)


def test_too_few_events_are_refused() -> None:
    with pytest.raises(DataError, match="too few"):
        compensate(np.arange(4.0), np.arange(4.0), np.arange(4.0), LAW.latency_s)


def test_a_constant_lag_is_pure_delay_in_tracking() -> None:
    response = tracking_response(lambda v: np.full(np.shape(v), 0.1))
    assert response.gain == pytest.approx(1, abs=1e-3)
    assert response.delay_ms == pytest.approx(100, abs=0.1)
    assert response.phase_deg[-1] == pytest.approx(-np.degrees(24.083 * 0.1), rel=1e-3)
