"""What counts as a fair answer, whether stated probabilities hold, and sessions that are kept for several engines."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from blind import kept, making, workflow
from blind.answers import answers
from blind.conditions import Task
from blind.displacement import Displacement
from blind.figure import draw_reliability
from blind.judge import Outcome, judge, run_task
from blind.known import Known
from blind.physics.rig import Profile
from blind.reliability import lines, reliability
from blind.score import score_worlds, table
from draglag_app.cli import cli

LARGE, SMALL = Displacement(2.0, 0.3), Displacement(2.0, 0.04)


def report(*names, verdict="explained", probability=None, alike_to=()):
    steps = [{"effect": name, "indistinguishable_from": list(alike_to)} for name in names]
    if probability is not None:
        steps[0]["probability"] = probability
    return {"verdict": verdict, "steps": steps}


QUIET, UNEXPLAINED = report(verdict="no_gap"), report(verdict="unexplained")


def judged(said, kind="single", hidden=("deadband",), moved=LARGE):
    known = Known(dict.fromkeys(hidden, 0.3), together=moved if hidden else None)
    return judge(Task(kind, "+".join(hidden) or "sound_power", 1.0, 1, world="realistic"), known, said)


@pytest.mark.parametrize(
    ("said", "moved", "answer", "right", "fair"),
    [
        (report("deadband"), LARGE, "right name", True, True),
        (report("deadband", "beam_bow"), LARGE, "right name", True, True),
        (report("beam_bow", "deadband"), LARGE, "wrong name", False, False),
        (report("beam_bow", verdict="unexplained"), LARGE, "wrong name", False, False),
        (UNEXPLAINED, LARGE, "unexplained", False, False),
        (QUIET, LARGE, "quiet", False, False),
        (QUIET, SMALL, "quiet", False, True),
        (report("deadband"), SMALL, "right name", True, True),
        (report("beam_bow"), SMALL, "wrong name", False, False),
        (UNEXPLAINED, SMALL, "unexplained", False, False),
        (report(verdict="refused"), SMALL, "refused", False, False),
        (QUIET, Displacement(8.0, 0.04, taps_show=True), "quiet", False, False),
    ],
)
def test_answers_on_one_effect(said, moved, answer, right, fair):
    o = judged(said, moved=moved)
    assert (o.answer, o.right, o.fair) == (answer, right, fair)
    assert o.left_mm == moved.gap_mm


def test_answers_on_sound_and_unknown_screens():
    assert judged(QUIET, "none", ()).right
    for said in (UNEXPLAINED, report("beam_bow"), report(verdict="refused")):
        o = judged(said, "none", (), None)
        assert not o.right
        assert not o.fair
    assert judged(UNEXPLAINED, "unknown", ("alpha_beta_tracker",)).right
    assert judged(report("deadband"), "unknown", ("alpha_beta_tracker",)).answer == "wrong name"
    assert judged(QUIET, "unknown", ("alpha_beta_tracker",), SMALL).fair
    assert not judged(QUIET, "unknown", ("alpha_beta_tracker",)).fair
    # a first-order low-pass under the name that the library has for it
    o = judged(report("smoothing_shrink"), "unknown", ("first_order_iir",))
    assert (o.answer, o.right, o.spurious) == ("right name", True, ())
    assert judged(report("deadband"), "below").right
    assert judged(QUIET, "below", moved=SMALL).right


def test_a_report_needs_no_more_than_verdict_and_steps():
    o = judged({"verdict": "explained", "steps": [{"effect": "deadband", "probability": 0.9}]})
    assert (o.answer, o.probability, o.seconds) == ("right name", 0.9, 0.0)
    assert judged(report("deadband")).probability is None


def many(n, right, probability):
    """`n` outcomes at one stated probability, `right` of which have the right name."""
    names = ["deadband"] * right + ["beam_bow"] * (n - right)
    return [judged(report(name, probability=probability)) for name in names]


def test_reliability_of_constructed_cases():
    outcomes = [*many(20, 19, 0.96), *many(10, 6, 0.6), *many(4, 0, 1.0), judged(QUIET), judged(report("deadband"))]
    found = reliability(outcomes)
    assert (found["named"], found["stated"]) == (35, 34)
    low, middle, high = found["bins"]
    assert (low["from"], low["to"], low["n"], low["hits"]) == (0.5, 0.7, 10, 6)
    assert low["ci95"] == pytest.approx([0.262, 0.878], abs=1e-3)
    assert (middle["n"], middle["hits"], middle["stated"]) == (20, 19, pytest.approx(0.96))
    assert (high["from"], high["rate"]) == (0.99, 0.0)  # certain, and wrong: its interval excludes what was stated
    assert high["ci95"][1] < high["stated"]
    brier = (19 * 0.04**2 + 0.96**2 + 6 * 0.4**2 + 4 * 0.6**2 + 4) / 34
    assert found["brier"] == pytest.approx(brier)
    text = "\n".join(lines(found))
    assert "19 of   20 = 95.0%" in text
    assert "34 of 35 names" in text


def test_nothing_stated_is_said(tmp_path):
    found = reliability([judged(report("deadband")), judged(QUIET)])
    assert (found["named"], found["stated"], found["bins"], found["brier"]) == (1, 0, [], None)
    assert "None stated" in "\n".join(lines(found))
    summary = score_worlds([*many(8, 6, 0.8), judged(report("deadband"))])
    draw_reliability(tmp_path / "some.png", summary["worlds"])
    draw_reliability(tmp_path / "none.png", {"plain": {"reliability": found}})
    assert all((tmp_path / name).stat().st_size > 1000 for name in ("some.png", "none.png"))


def test_worlds_are_reported_apart():
    plain = judge(Task("none", "none", 1.0, 1), Known({}), UNEXPLAINED)
    other = judge(Task("none", "none_other_law", 1.0, 1, law_form="power"), Known({}, law_form="power"), UNEXPLAINED)
    summary = score_worlds([plain, other, judged(QUIET), judged(report("deadband"))])
    assert (summary["worlds"]["plain"]["sessions"], summary["worlds"]["realistic"]["sessions"]) == (2, 2)
    assert summary["worlds"]["plain"]["false_alarms"]["n"] == 1
    assert summary["worlds"]["plain"]["other_law"]["hits"] == 1
    assert summary["worlds"]["realistic"]["fair"]["hits"] == 1
    small = score_worlds([judged(QUIET, "below", moved=SMALL)])["worlds"]["realistic"]
    assert small["confusion"] == {"deadband, small": {"nothing": 1}}
    (row,) = summary["worlds"]["realistic"]["answers"]
    assert row["answers"] == {"right name": 1, "wrong name": 0, "unexplained": 0, "quiet": 1, "refused": 0}
    text = table(summary)
    assert text.index("World: plain, 2 sessions") < text.index("World: realistic, 2 sessions")
    assert json.loads(json.dumps(summary)) == summary


def test_answers_have_one_row_a_kind_and_row():
    rows = answers([judged(QUIET), judged(report("deadband")), judged(QUIET, "below", moved=SMALL)])
    assert [(row["kind"], row["fair"]["hits"], row["fair"]["n"]) for row in rows] == [("below", 1, 1), ("single", 1, 2)]
    assert rows[1]["gap_mm"] == pytest.approx(0.3)


def engine(folder):
    """An engine of another kind: names by what it finds in the folder."""
    assert (folder / "session.json").is_file()
    assert not list(folder.glob("*truth*"))
    return report("beam_bow", probability=0.7)


@pytest.fixture
def short(monkeypatch):
    """Sessions of two short runs."""
    profile = Profile(world="realistic", law_form="power", protocol="speeds", n_speeds=2, run_s=25.0, varied_runs=False)
    monkeypatch.setattr(making, "_profile", lambda task: profile)


TASK = Task("single", "beam_bow", 1.0, 4, {"beam_bow": 0.8}, world="realistic", law_form="power")


def test_kept_sessions_are_used_again_and_judged_by_any_engine(short, tmp_path, monkeypatch, capsys):
    name = making.name_of(TASK)
    first = run_task(TASK, tmp_path, engine=f"{__name__}:engine")
    assert (first.answer, first.probability, first.law_form) == ("right name", 0.7, "power")
    truth = json.loads((tmp_path / "truth" / f"{name}.json").read_text())
    assert truth["world"] == "realistic"
    assert truth["law_form"] == "power"
    assert truth["hidden_effects"] == {"beam_bow": 0.8}
    assert truth["displacement"]["beam_bow"]["rms_mm"] > truth["displacement"]["beam_bow"]["gap_mm"] > 0.05
    assert truth["accepted_names"] == ["beam_bow"]

    monkeypatch.setattr(making, "make", lambda *_: pytest.fail("made again"))
    again = run_task(TASK, tmp_path, engine=f"{__name__}:engine")
    assert np.isclose(again.left_mm, first.left_mm)
    assert again.size == pytest.approx(first.size)
    assert kept.kept_names(tmp_path) == [name]
    assert kept.judge_kept(tmp_path, name, engine=f"{__name__}:engine").right

    said = tmp_path / "reports"
    said.mkdir()
    (said / f"{name}.json").write_text(json.dumps(QUIET))
    assert kept.main([str(tmp_path), "--reports", str(said), "--out", str(tmp_path / "out")]) == 0
    assert f"{name}: quiet" in capsys.readouterr().out
    assert (tmp_path / "out" / "reliability.png").is_file()


def test_another_task_of_the_same_name_is_made_itself(short, tmp_path):
    other = Task("single", "beam_bow", 1.0, 4, {"beam_bow": 0.5}, world="realistic", law_form="power")
    for task in (TASK, other):
        made = making.kept_or_made(task, tmp_path / "scratch", tmp_path)
        assert made.known.effects == task.effects


@pytest.mark.parametrize(("gap_mm", "grows"), [(0.15, True), (0.03, False)])
def test_what_cannot_matter_keeps_its_size(short, tmp_path, monkeypatch, gap_mm, grows):
    def displaced(seed, effects, profile):
        moved = Displacement(1.0, gap_mm if effects["beam_bow"] > 0.5 else 0.02)
        return {"beam_bow": moved}, moved

    monkeypatch.setattr(making, "displacements", displaced)
    task = Task("single", "beam_bow", 1.0, 4, {"beam_bow": 0.4}, world="realistic", law_form="power")
    made, truth = making.make(task, tmp_path)
    assert (made.known.effects["beam_bow"] > 0.5) == grows
    assert truth.effects == made.known.effects
    assert made.known.matters == grows


def test_command_line_takes_world_keep_and_engine(tmp_path, monkeypatch):
    from blind import benchmark

    seen = {}

    def ran(chosen, jobs, scheduler, keep, engine):
        seen.update(worlds={task.world for task in chosen}, keep=keep, engine=engine)
        yield judged(report("deadband", probability=0.9))

    monkeypatch.setattr(benchmark, "run_all", ran)
    line = ["blind", "--quick", "--world", "realistic", "--keep", str(tmp_path / "kept"), "--engine", "a:b"]
    result = CliRunner().invoke(cli, [*line, "--out", str(tmp_path / "out")])
    assert seen == {"worlds": {"realistic"}, "keep": tmp_path / "kept", "engine": "a:b"}
    assert "World: realistic" in result.stdout
    assert "stated 0.900" in result.stdout
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"blind.json", "blind-realistic.png", "reliability.png"}
    written = json.loads((tmp_path / "out" / "blind.json").read_text())
    assert Outcome(**written["outcomes"][0]).answer == "right name"


def test_engine_is_handed_the_folder(tmp_path):
    (tmp_path / "session.json").write_text("{}")
    found = workflow.close(tmp_path, engine=f"{__name__}:engine")
    assert found["steps"][0]["effect"] == "beam_bow"
    assert found["seconds"] >= 0


@pytest.mark.parametrize(("own_mm", "covered"), [({}, False), ({"beam_width": -0.06}, True)])
def test_a_size_is_that_of_the_rig_and_of_what_is_hidden_together(own_mm, covered):
    known = Known({"beam_width": 0.86}, together=LARGE, own=own_mm)
    said = report("beam_width")
    said["steps"][0]["parameters"] = {"extra_mm": {"value": 0.804, "ci95": [0.795, 0.813]}}
    assert judge(Task("single", "beam_width", 1.0, 1, world="realistic"), known, said).covered is covered
