"""The headline of a gap report does not call noise what the line below it says is beyond chance."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from draglag.gap.finding.separate import not_seen
from draglag.gap.fitting.state import Term
from draglag.gap.results import GapReport, PassedOver, Step, unjudged
from draglag.gap.wording import drift_in_analysis, headline
from draglag.protocols import load_protocol
from draglag.report.gap import _table
from draglag.simulation import simulate_session
from draglag.simulation.effects import parse_effect
from draglag_app.cli import cli
from draglag_app.cli.gap import _say

SAMPLE = Path(__file__).parents[1] / "data" / "exchange" / "low_speed_plateau"

RIPPLE = PassedOver("pitch_ripple", 6e-6, "amplitude_mm 0.02 (0.01 to 0.03): too little for a name")


def report(verdict, *left):
    numbers = {"noise_floor_mm": 0.2, "gap_first_mm": 0.18, "gap_last_mm": 0.18}
    return GapReport("s", verdict, unexplained_by="x", passed_over=left, **numbers)


@pytest.mark.parametrize("verdict", ["no_gap", "explained"])
def test_only_noise_is_called_noise(verdict, capsys):
    for made in (report(verdict), report(verdict, RIPPLE)):
        made = replace(made, steps=(DRIFT,) if verdict == "explained" else ())
        _say(made, None)
        for said in (capsys.readouterr().out, headline(made)):
            if made.passed_over:
                assert "beyond chance" in said
                assert "noise." not in said.replace("noise floor", "").split("\n")[0]
            else:
                assert "noise" in said.split("\n")[0]


def test_what_stays_unexplained_stays_so():
    assert headline(report("unexplained", RIPPLE)) == headline(report("unexplained"))


def test_what_a_gap_follows_is_told_in_words(capsys):
    made = replace(report("unexplained"), unexplained_by="normal_acceleration")
    _say(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert said.startswith("Unexplained: a gap remains that follows the normal acceleration;")


def test_scatter_is_not_told_as_something_that_a_gap_follows(capsys):
    made = replace(report("unexplained"), unexplained_by="scatter")
    _say(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert said.startswith("Unexplained: single edges scatter more than those of a sound rig")


def test_what_is_left_of_a_covariate_is_told_in_words(capsys):
    _say(report("no_gap", PassedOver("time_in_run", 1e-5, "too little")), None)
    assert "but left: the time in the run, too little." in capsys.readouterr().out


def test_a_wider_shadow_is_not_told_twice():
    """An effect that a step names as one it may be is not listed as one that could not have been seen."""
    session = SimpleNamespace(taps=None, runs=())
    view = SimpleNamespace(x_mm=np.array([0.0, 400.0]))
    for terms, listed in (((), True), ((Term("beam_width", ()),), False)):
        fit = SimpleNamespace(terms=terms, runs=(), view=view, width_mm=500.0, run_index=np.zeros(0, int))
        assert ("scale_error" in not_seen(session, fit)) is listed


@pytest.mark.parametrize("follows", ["speed", "scatter"])
def test_a_limit_of_effects_is_told_instead_of_that_none_is_known(follows, capsys):
    made = replace(report("unexplained"), unexplained_by=follows, stopped_at=0)
    _say(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert "effects were limited to 0" in said
        assert "no known effect" not in said
        assert "follows scatter" not in said


DRIFT = Step("clock_drift", {"drift_ppm": (24.9, (23.7, 26.2))}, "", "session_time", 1e-9, "", 2.7, 0.22)
OFFSET = Step(
    "clock_offset", {"offset_s": (0.006, (0.005, 0.007))}, "", "taps", 1e-9, "taps lie +6.0 ms off", 0.18, 0.18
)


def test_the_headline_names_cause_size_and_what_the_gap_becomes(capsys):
    numbers = {"steps": (DRIFT,), "gap_first_mm": 2.7, "gap_last_mm": 0.22, "noise_floor_mm": 0.19}
    _say(replace(report("explained"), **numbers), None)
    assert capsys.readouterr().out.split("\n")[0] == (
        "Clock drift 24.9 ppm (23.7 to 26.2) explains the gap: 2.70 → 0.22 mm, noise 0.19."
    )
    part = headline(replace(report("unexplained"), **numbers))
    assert part.startswith("Clock drift 24.9 ppm (23.7 to 26.2) is part of the gap: 2.70 → 0.22 mm, noise 0.19. Unexpl")


def test_an_offset_shown_by_taps_has_no_gap_of_its_own(capsys):
    """No held-out run shows it: no gap figure is made up for it, and what the taps say is in the words."""
    made = replace(report("explained"), steps=(OFFSET,))
    assert headline(made).startswith("Clock offset 6 ms (5 to 7), by the taps. Edges do not show it")
    _say(made, None)
    for said in (capsys.readouterr().out, _table(made)):
        assert OFFSET.evidence in said


def test_a_drift_refers_to_what_analyze_makes_of_it():
    made = simulate_session("screen-1", load_protocol("demo"), effects=[parse_effect("clock_drift=25")], seed=4)
    found = replace(report("explained"), steps=(DRIFT,))  # 23.7 to 26.2 ppm
    assert "sees the same drift" in drift_in_analysis(made, found)
    assert re.search(r"stamps run 2[45]\.\d ppm fast", drift_in_analysis(made, found))
    sound = simulate_session("screen-1", load_protocol("demo"), seed=4)
    assert "sees another drift" in drift_in_analysis(sound, found)
    bare = replace(made, clocks=(), runs=tuple(replace(run, sync=()) for run in made.runs))
    assert "no comparison" in drift_in_analysis(bare, found)
    assert drift_in_analysis(made, report("no_gap")) == ""


def test_runs_that_the_fit_does_not_judge_by_are_told_with_the_reason():
    runs = [SimpleNamespace(id=f"run-0{k}", protocol=kind) for k, kind in ((1, "circle"), (2, "circle"), (3, "step"))]
    session, of_runs = SimpleNamespace(runs=runs), [SimpleNamespace(run=run) for run in runs]
    first, last = (SimpleNamespace(runs=of_runs, run_index=np.array(used)) for used in ([0, 0, 1, 1], [0, 0]))
    said = unjudged(session, replace(report("no_gap"), first=first, last=last))
    assert said == "Not judged by: run-02 (circle, left out beside an effect), run-03 (step, too few edges or events)."
    last.run_index = np.array([0, 1, 2])
    assert unjudged(session, replace(report("no_gap"), first=first, last=last)) == ""


def test_what_was_left_out_of_the_library_may_be_what_is_unexplained():
    ran = CliRunner().invoke(cli, ["gap", str(SAMPLE), "--without", "low_speed_plateau"])
    assert ran.exit_code == 0, ran.output
    assert "Unexplained" in ran.output.split("\n")[0]  # and nothing else of the speed is named for it
    assert "It may be what was left out of the library: low_speed_plateau." in ran.output
    limited = CliRunner().invoke(cli, ["gap", str(SAMPLE), "--without", "scan_skew", "--max-effects", "0"])
    assert "left out of the library" not in limited.output
