"""The model a gap report ends with: as a file, and put to work on other sessions."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from core import sound_sessions
from draglag.analysis import AnalysisOptions, analyze
from draglag.errors import DataError
from draglag.exchange import read_exchange
from draglag.gap import close_gap
from draglag.gap.correction import corrected, corrected_touch, realise
from draglag.gap.fitting.joint import fit_session
from draglag.gap.fitting.state import Term
from draglag.gap.replaying.extended import extended_model, law_of_fit
from draglag.gap.replaying.realised import rig_with_law
from draglag.gap.traces.run_data import gather
from draglag.model.file import LatencyModel, ModelEffect, left_unexplained, load_model, save_model
from draglag.protocol.runs import load_protocol
from draglag.recording import Session
from draglag.simulation import rig_for_screen, simulate_session
from draglag.simulation.effects import parse_effect
from draglag.store import write_session
from draglag_app.cli import cli

SAMPLE = Path(__file__).parents[2] / "data" / "exchange" / "low_speed_plateau"


@pytest.fixture(scope="module")
def compared() -> Session:
    return sound_sessions.brief("clock_drift=100")


@pytest.fixture(scope="module")
def drifting(compared: Session) -> Session:
    """As a rig without clock comparisons records it."""
    runs = tuple(replace(r, sync=(), laser=replace(r.laser, device_t_s=np.empty(0))) for r in compared.runs)
    return replace(compared, runs=runs, clocks=())


@pytest.fixture(scope="module")
def model(drifting: Session) -> LatencyModel:
    report = close_gap(drifting, candidates=["clock_drift"], max_effects=1)
    return extended_model(drifting, report, "2026-01-02T03:04:05+00:00", "ab" * 32)


def with_effects(model: LatencyModel, *effects: ModelEffect) -> LatencyModel:
    return model.model_copy(update={"effects": effects})


def test_a_saved_model_says_what_it_holds_and_where_it_comes_from(
    model: LatencyModel, drifting: Session, tmp_path: Path
) -> None:
    save_model(model, tmp_path / "m.json")
    back = load_model(tmp_path / "m.json")
    assert back == model
    (effect,) = back.effects
    assert effect.id == "clock_drift"
    low, high = effect.ci95["drift_ppm"]
    assert low - 3 < 100 < high + 3
    assert effect.where
    source = back.provenance
    assert (source.session, source.input_sha256, source.created_utc[:4]) == (drifting.name, "ab" * 32, "2026")
    assert source.software.startswith("draglag ")
    assert source.gap_mm is not None
    assert source.gap_mm[1] < source.gap_mm[0]
    assert source.noise_floor_mm
    # Runs of 15 s know their latency to some 0.5 ms, the slowest to 2 ms; the clock drifts by 20 ms meanwhile.
    assert 0 < back.rms_ms < 2


def test_the_law_of_a_fit_is_the_same_law_as_a_file() -> None:
    session = read_exchange(SAMPLE)
    circles = [r for r in session.runs if r.protocol == "circle"][:9]
    session = Session(session.name, session.screen, session.stylus, tuple(circles))
    fit = fit_session(session, gather(session), plateau=True)
    curve = law_of_fit(fit)
    speed = np.geomspace(40, 900, 50)
    corner = np.abs(np.log(speed / fit.law.plateau_mm_s)) < 0.2
    assert curve.predict_s(speed[~corner]) == pytest.approx(fit.law(speed[~corner]), abs=1e-6)
    # The file's corner is sharp; the fit's is rounded by 2 % of its speed, 1.4 % where they differ most.
    slope = np.ptp(curve.predict_s(fit.law.plateau_mm_s * np.array([1.0, 1.05]))) / 0.05
    assert curve.predict_s(speed) == pytest.approx(fit.law(speed), abs=0.016 * slope)
    low, high = curve.band_s(np.array([200.0]))
    assert 0 < high[0] - low[0] < 0.01


def test_a_clock_s_drift_is_taken_out_before_runs_are_estimated(model: LatencyModel, drifting: Session) -> None:
    law = rig_for_screen("screen-1").law
    fixed, correction = corrected(drifting, model)
    assert "corrected for clock drift" in correction.words()
    assert " ppm (" in correction.words()

    def off_s(session: Session) -> float:
        runs = analyze(session, AnalysisOptions(form="double_exponential")).runs
        pairs = [(r.latency_s, r.speed_mm_s) for r in runs if r.latency_s is not None and (r.speed_mm_s or 0) > 120]
        return float(np.max([abs(late - law.latency_s(v)) for late, v in pairs if v is not None]))

    assert off_s(drifting) > 0.01
    assert off_s(fixed) < 0.003


def test_a_drift_that_clock_comparisons_show_is_not_taken_out_twice(model: LatencyModel, compared: Session) -> None:
    fixed, correction = corrected(compared, model)
    assert correction.left == {"clock_drift": "the session's own clock comparisons take it out"}
    true_s = np.concatenate([run.laser.t_s for run in sound_sessions.brief().runs])
    shown_s = np.concatenate([run.laser.t_s for run in fixed.runs])
    assert shown_s - true_s == pytest.approx(0, abs=5e-4)


@pytest.mark.parametrize(
    ("effect", "sizes"),
    [
        ("scan_skew", {"across_s": 0.02}),
        ("direction_asymmetry", {"difference_s": 0.012}),
        ("laser_hysteresis", {"delay_s": 0.003}),
        ("beam_wedge", {"across_mm": 2.0}),
        ("warm_up", {"amplitude_s": 0.03, "time_constant_s": 500.0}),
    ],
)
def test_what_is_taken_out_is_no_longer_found(effect: str, sizes: dict[str, float], model: LatencyModel) -> None:
    session = sound_sessions.brief(f"{effect}={next(iter(sizes.values()))}")
    fixed, correction = corrected(session, with_effects(model, ModelEffect(id=effect, parameters=sizes)))
    assert [e.id for e in correction.applied] == [effect]

    def size(of: Session) -> float:
        runs = gather(of)
        return float(fit_session(of, runs, [Term(effect)], start=fit_session(of, runs)).terms[0].sizes[0])

    assert abs(size(fixed)) < 0.15 * abs(size(session))


def test_a_bowed_beam_is_straightened(model: LatencyModel) -> None:
    straight, bowed = sound_sessions.brief(), sound_sessions.brief("beam_bow=2")
    fixed, correction = corrected(bowed, with_effects(model, ModelEffect(id="beam_bow", parameters={"bow_mm": 2.0})))
    assert [e.id for e in correction.applied] == ["beam_bow"]

    def off_s(of: Session) -> float:
        pairs = [(a.laser.t_s, b.laser.t_s) for a, b in zip(of.runs, straight.runs, strict=True)]
        alike = [np.abs(a - b) for a, b in pairs if a.size == b.size]
        return float(np.median(np.concatenate(alike)))

    assert off_s(bowed) > 1e-3
    assert off_s(fixed) < 0.2 * off_s(bowed)


def test_laser_and_clock_leave_the_compensation_of_touch_alone(model: LatencyModel, drifting: Session) -> None:
    touch = drifting.runs[0].touch
    t_s, x_mm, y_mm, correction = corrected_touch(touch.t_s, touch.x_mm, touch.y_mm, model)
    assert np.array_equal(t_s, touch.t_s)
    assert np.array_equal(x_mm, touch.x_mm)
    assert np.array_equal(y_mm, touch.y_mm)
    assert correction.left == {"clock_drift": "it does not act on touch"}
    skewed = with_effects(model, ModelEffect(id="scan_skew", parameters={"across_s": 0.02}))
    moved_s = touch.t_s - corrected_touch(touch.t_s, touch.x_mm, touch.y_mm, skewed)[0]
    expected_s = 0.02 * (touch.x_mm / drifting.screen.width_mm - 0.5)
    assert moved_s == pytest.approx(expected_s, abs=0.001)


def test_a_second_filter_is_part_of_the_law(model: LatencyModel) -> None:
    second = ModelEffect(id="second_filter_mode", parameters={"extra_s": 0.006, "threshold_mm_s": 300.0})
    speed = np.array([200.0, 400.0])
    added = with_effects(model, second).latency_s(speed) - with_effects(model).latency_s(speed)
    assert added == pytest.approx([0.0, 0.006])


def test_an_unknown_effect_in_a_model_file_is_refused_in_one_sentence(model: LatencyModel, tmp_path: Path) -> None:
    content = model.model_dump(mode="json")
    content["effects"] = [{"id": "gremlins", "parameters": {}}]
    (tmp_path / "m.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match="the effect gremlins is not known here"):
        load_model(tmp_path / "m.json")
    del content["effects"], content["provenance"]
    (tmp_path / "old.json").write_text(json.dumps(content))
    assert load_model(tmp_path / "old.json").effects == ()


def test_commands_say_what_they_corrected_for(model: LatencyModel, drifting: Session, tmp_path: Path) -> None:
    save_model(model, tmp_path / "m.json")
    write_session(drifting, tmp_path / "s.h5")
    touch = drifting.runs[0].touch
    rows = np.column_stack([touch.t_s, touch.x_mm, touch.y_mm])
    np.savetxt(tmp_path / "in.csv", rows, delimiter=",", header="t_s,x_mm,y_mm", comments="")

    def said(*arguments: str) -> str:
        result = CliRunner().invoke(cli, list(arguments))
        assert result.exit_code == 0, result.output
        return result.output

    m, s = str(tmp_path / "m.json"), str(tmp_path / "s.h5")
    assert "corrected for clock drift" in said("validate", s, "--model", m)
    assert "corrected for clock drift" in said("analyze", s, "--model", m)
    assert json.loads(said("analyze", s, "--model", m, "--json"))["corrected_for"][0]["effect"] == "clock_drift"
    text = said("compensate", m, str(tmp_path / "in.csv"), str(tmp_path / "out.csv"))
    assert "clock drift (it does not act on touch)" in text
    assert "clock drift" in said("simulate", "--screen", "screen-1", "--model", m, "--out", str(tmp_path / "new.h5"))
    by_hand = ("--effect", "clock_drift=10", "--out", str(tmp_path / "other.h5"))
    assert "clock_drift as given by hand" in said("simulate", "--screen", "screen-1", "--model", m, *by_hand)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda effects: effects + effects, "the effect clock_drift is named twice"),
        (lambda effects: [effects[0] | {"parameters": {}}], "the effect clock_drift has no size"),
        (lambda effects: [effects[0] | {"parameters": {"drift_ppm": 1e9}}], "has drift_ppm 1e+09"),
    ],
)
def test_a_model_file_whose_effects_no_rig_has_is_refused(
    model: LatencyModel, tmp_path: Path, change: object, said: str
) -> None:
    content = model.model_dump(mode="json")
    path = tmp_path / "model.json"
    path.write_text(json.dumps(content | {"effects": change(content["effects"])}), "utf-8")  # type: ignore[operator]
    with pytest.raises(DataError, match=re.escape(said)):
        load_model(path)


@pytest.mark.parametrize(
    ("effect", "parameter", "size"),
    [("clock_offset", "offset_s", 0.008), (None, "", 0.0)],
)
def test_a_model_s_law_is_the_panel_s_and_comes_back_when_simulated(
    effect: str | None, parameter: str, size: float
) -> None:
    """The clock's offset is not the law's; taps go with the law. Taps of a sound rig lie within 0.9 ms (one standard
    deviation) of an asymptote known to some 0.5 ms."""
    effects = [] if effect is None else [parse_effect(f"{effect}={size}")]
    session = simulate_session("screen-1", load_protocol("demo"), effects=effects, seed=4)
    model = extended_model(session, close_gap(session, candidates=["clock_offset"]))
    law = rig_for_screen("screen-1").law
    assert model.parameters["a7_ms"] == pytest.approx(law.a7_ms, abs=2.0)
    assert [e.id for e in model.effects] == ([] if effect is None else [effect])
    own = [realise(e) for e in model.effects]
    rig, _ = rig_with_law(rig_for_screen("screen-2"), model.form, model.parameters, own)
    again = close_gap(simulate_session(rig, load_protocol("demo"), effects=own, seed=5), candidates=["clock_offset"])
    assert [s.effect for s in again.steps] == [e.id for e in model.effects]
    for step in again.steps:
        low, high = step.parameters[parameter][1]
        assert low < size < high


def test_taps_of_a_simulated_law_are_its_own_s() -> None:
    """8 ms quicker than the screen's at every speed: that is no clock's doing."""
    screen = rig_for_screen("screen-1")
    quicker = vars(screen.law) | {"a7_ms": screen.law.a7_ms - 8.0}
    rig, _ = rig_with_law(screen, "double_exponential", quicker)
    assert not close_gap(simulate_session(rig, load_protocol("demo"), seed=5), candidates=["clock_offset"]).steps
    with_taps_left = replace(rig, tap_touch_s=screen.tap_touch_s, tap_release_s=screen.tap_release_s)
    (step,) = close_gap(
        simulate_session(with_taps_left, load_protocol("demo"), seed=5), candidates=["clock_offset"]
    ).steps
    assert step.effect == "clock_offset"


def test_a_model_that_leaves_its_own_session_unexplained_says_so(model: LatencyModel) -> None:
    assert left_unexplained(model) == ""
    left = replace_in(model, verdict="unexplained", gap_mm=(1.5, 0.8))
    assert "leaves a gap of 0.800 mm in its own session" in left_unexplained(left)


def replace_in(model: LatencyModel, **provenance: object) -> LatencyModel:
    return model.model_copy(update={"provenance": model.provenance.model_copy(update=provenance)})


def test_a_model_of_another_screen_is_reported_as_such(model: LatencyModel, compared: Session, tmp_path: Path) -> None:
    save_model(model, tmp_path / "model.json")
    for name, warned in (("screen-1", False), ("another", True)):
        write_session(replace(compared, screen=replace(compared.screen, name=name)), tmp_path / f"{name}.h5")
        for command in ("validate", "analyze"):
            path, file = str(tmp_path / f"{name}.h5"), str(tmp_path / "model.json")
            done = CliRunner().invoke(cli, [command, path, "--model", file])
            assert done.exit_code == 0, done.output
            assert ("warning: the model was fitted on screen-1, this is another" in done.output) is warned


def test_what_the_law_undoes_is_not_reported_as_left_in(model: LatencyModel, drifting: Session) -> None:
    plateau = ModelEffect(id="low_speed_plateau", parameters={"speed_mm_s": 118.0})
    touch = drifting.runs[0].touch
    held = model.model_copy(update={"effects": (plateau,)})
    words = corrected_touch(touch.t_s, touch.x_mm, touch.y_mm, held)[3].words()
    assert words == "low-speed plateau is part of the latency law, which undoes it"


def test_a_model_of_more_runs_than_any_session_has_is_refused(model: LatencyModel, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_text(json.dumps(model.model_dump(mode="json") | {"n_points": 2**100}), "utf-8")
    with pytest.raises(DataError, match="n_points"):
        load_model(path)
