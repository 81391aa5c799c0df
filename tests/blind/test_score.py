"""Judging and scoring against reports whose worth is known."""

import math

import pytest

from blind.conditions import Task, alike, quick_tasks, tasks
from blind.interval import interval
from blind.judge import judge
from blind.known import known_of
from blind.physics.effects import LIBRARY
from blind.physics.rig import Profile
from blind.physics.session import make_session
from blind.score import failures, score, score_worlds, table


def report(*names, verdict="explained", follows=None, alike_to=(), value=1.0):
    parameters = {"x": {"value": value, "ci95": [0.5, 1.5]}}
    steps = [{"effect": name, "indistinguishable_from": list(alike_to), "parameters": parameters} for name in names]
    gaps = {"gap_first_mm": 1.0, "gap_last_mm": 0.3}
    return {"verdict": verdict, "steps": steps, "unexplained_by": follows, "seconds": 1.0} | gaps


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """Truths of short sessions by hidden effects; taps at the end only."""
    profile = Profile(protocol="speeds", n_speeds=2, run_s=25.0, varied_runs=False, taps="end")
    return {
        names: make_session(tmp_path_factory.mktemp("s"), 5, dict.fromkeys(names, 1.0), profile)
        for names in ((), ("beam_width",), ("clock_drift",), ("scan_skew", "beam_wedge"), ("split_panel",))
    }


def outcome(sessions, kind, names, said, size=10.0):
    known = known_of(sessions[names], size=size)
    return judge(Task(kind, "+".join(names) or "none", 1.0, 5), known, said, {"gap_last_mm": 0.25})


def test_judgement_of_one_effect(sessions):
    assert outcome(sessions, "single", ("beam_width",), report("beam_width")).right
    assert not outcome(sessions, "single", ("beam_width",), report("beam_wedge", "beam_width")).right
    assert not outcome(sessions, "single", ("beam_width",), report()).right
    wrong = outcome(sessions, "single", ("beam_width",), report("beam_wedge"))
    assert wrong.spurious == ("beam_wedge",)
    found = outcome(sessions, "single", ("beam_width",), report("beam_width", value=1.2))
    assert found.parameter_error == pytest.approx(0.2)
    assert found.covered


def test_a_law_that_follows_what_moves_now_has_no_delay_to_compare(tmp_path):
    profile = Profile(protocol="speeds", n_speeds=2, run_s=25.0, varied_runs=False, taps="end")
    errors = {}
    for seed in range(1, 12):
        truth = make_session(tmp_path / str(seed), seed, {"lagging_law": 1.0}, profile)
        task = Task("single", "lagging_law", 1.0, seed)
        made = judge(task, known_of(truth), report("lagging_law", value=1.2), {"gap_last_mm": 0.25})
        assert made.right
        errors.setdefault(truth.variants["lagging_law"]["present"], set()).add(made.parameter_error)
        if len(errors) == 2:
            break
    assert errors[True] == {None}
    assert list(errors[False]) == [pytest.approx(0.2)]


def test_a_twin_name_counts_only_when_the_step_says_so(sessions):
    assert outcome(sessions, "single", ("clock_drift",), report("thermal_drift", alike_to=["clock_drift"])).right
    assert not outcome(sessions, "single", ("clock_drift",), report("thermal_drift")).right
    # saying that everything may be anything does not help
    assert not outcome(sessions, "single", ("clock_drift",), report("scan_skew", alike_to=["clock_drift"])).right
    assert "thermal_drift" not in alike("clock_drift", taps_before=True)


def test_other_kinds(sessions):
    pair = ("scan_skew", "beam_wedge")
    assert outcome(sessions, "pair", pair, report("beam_wedge", "scan_skew")).right
    assert not outcome(sessions, "pair", pair, report("beam_wedge")).right
    unknown = ("split_panel",)
    assert outcome(sessions, "unknown", unknown, report(verdict="unexplained", follows="x")).right
    assert not outcome(sessions, "unknown", unknown, report("scan_skew")).right
    assert not outcome(sessions, "unknown", unknown, report(verdict="no_gap")).right
    assert outcome(sessions, "none", (), report(verdict="no_gap")).right
    assert not outcome(sessions, "none", (), report(verdict="unexplained", follows="x")).right


def test_interval_is_clopper_pearson():
    # known: 0 of n has the upper bound 1 - (α/2)^(1/n)
    assert interval(0, 30)[0] == 0.0
    assert interval(0, 30)[1] == pytest.approx(1 - 0.025 ** (1 / 30))
    assert interval(30, 30)[1] == 1.0
    low, high = interval(8, 10)
    assert (low, high) == pytest.approx((0.4439, 0.9748), abs=2e-4)


def test_failures_only_when_chance_cannot_excuse_them(sessions):
    good = [outcome(sessions, "single", ("beam_width",), report("beam_width"))] * 19
    bad = outcome(sessions, "single", ("beam_width",), report())
    assert failures([*good, bad]) == []
    said = failures([*good, *[bad] * 8])
    assert len(said) == 1
    assert "19 of 27" in said[0]
    alarms = [outcome(sessions, "none", (), report("pitch_ripple"))] * 4
    assert failures([*[outcome(sessions, "none", (), report(verdict="no_gap"))] * 6, *alarms])
    faint = outcome(sessions, "single", ("beam_width",), report(), size=0.5)
    assert failures([*good, *[faint] * 9]) == []


def test_score_and_table(sessions):
    outcomes = [
        outcome(sessions, "none", (), report(verdict="no_gap")),
        outcome(sessions, "single", ("beam_width",), report("beam_width")),
        outcome(sessions, "single", ("beam_width",), report("beam_wedge"), size=0.8),
        outcome(sessions, "unknown", ("split_panel",), report("scan_skew")),
    ]
    summary = score(outcomes)
    assert summary["false_alarms"]["hits"] == 0
    assert summary["recall"] == {"n": 1, "hits": 1, "rate": 1.0, "ci95": pytest.approx([0.025, 1.0])}
    assert summary["gap_over_floor"][1] == pytest.approx(0.3 / 0.25)
    assert summary["confusion"]["beam_width"] == {"beam_width": 1, "beam_wedge": 1}
    assert [p["hits"] for p in summary["power"]] == [0, 1]
    assert all(math.isfinite(p["rate"]) for p in summary["power"])
    assert "beam_width" in table(score_worlds(outcomes))


def test_tasks_cover_every_effect_and_repeat_with_the_seed():
    many = tasks(2, seed=1)
    assert {task.row for task in many if task.kind == "single"} == set(LIBRARY)
    assert {task.scale for task in many if task.kind == "single"} == {0.7, 1.0, 2.0}
    assert many == tasks(2, seed=1)
    assert len({task.seed for task in many}) == len(many)
    for task in many:
        if task.kind == "left_out":
            assert set(task.effects) <= set(task.excluded)
    assert {task.kind for task in quick_tasks(1)} == {"none", "single", "unknown", "left_out", "pair"}
