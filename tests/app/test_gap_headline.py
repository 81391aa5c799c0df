"""What the terminal and the report say of a gap: causes, probabilities, what else is possible, the curve's form."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from draglag.gap.correction import size_words
from draglag.gap.fitting.state import Term
from draglag.gap.not_shown import not_shown
from draglag.gap.results import GapReport, LawStatement, Step, Tolerated, unjudged
from draglag.gap.wording import also_in_words, drift_in_analysis, headline, law_in_words
from draglag.model.file import ModelEffect
from draglag.protocol.runs import load_protocol
from draglag.report.gap import _explanations, _table
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS, parse_effect, title_of
from draglag.simulation.effects.parameter import amount, parameter_of
from draglag_app.cli import cli
from draglag_app.cli.gap import print_finding
from draglag_app.windows.wording.effect_words import size_words as shown_in_window
from draglag_app.windows.wording.gap_words import headline as in_window

SAMPLE = Path(__file__).parents[1] / "data" / "exchange" / "low_speed_plateau"

RIPPLE = Tolerated("pitch_ripple", 0.9, 0.03)


def report(verdict, *tolerated):
    numbers = {"noise_floor_mm": 0.2, "gap_first_mm": 0.18, "gap_last_mm": 0.18}
    return GapReport("s", verdict, unexplained_by="x", tolerated=tolerated, **numbers)


@pytest.mark.parametrize("verdict", ["no_gap", "explained"])
def test_only_noise_is_called_noise(verdict, capsys):
    for made in (report(verdict), report(verdict, RIPPLE)):
        made = replace(made, steps=(DRIFT,) if verdict == "explained" else ())
        print_finding(made, None)
        for said in (capsys.readouterr().out, headline(made)):
            if made.tolerated:
                assert "beyond chance" in said
                assert "noise." not in said.replace("noise floor", "").split("\n")[0]
            else:
                assert "noise" in said.split("\n")[0]


def test_what_is_tolerated_is_listed_with_its_size_in_one_line(capsys):
    print_finding(report("no_gap", RIPPLE, Tolerated("time_in_run", 0.7, 0.021)), None)
    said = capsys.readouterr().out.split("\n")
    assert "Tolerated, too small to matter: electrode ripple, 0.03 mm; the time in the run, 0.02 mm." in said


def test_what_stays_unexplained_stays_so():
    assert headline(report("unexplained", RIPPLE)) == headline(report("unexplained"))


def test_a_verdict_without_a_cause_has_its_probability():
    quiet = replace(report("no_gap"), explanations=(((), 0.951), (("beam_bow",), 0.03)))
    assert headline(quiet).startswith("No gap (probability 0.95): 0.18 mm, noise 0.20.")
    unnamed = replace(report("unexplained"), explanations=((("unexplained",), 0.93), ((), 0.05)))
    assert headline(unnamed).startswith("Unexplained (probability 0.93): a gap remains")


def test_sets_that_share_the_probability_are_all_named(capsys):
    three = ("beam_bow", "beam_width", "clock_drift")
    sets = ((("clock_drift",), 0.6), (three, 0.25), (("unexplained",), 0.11), ((), 0.03))
    made = replace(report("explained"), steps=(DRIFT,), explanations=sets)
    also = (
        "Also possible: beam bow, beam width and clock drift (probability 0.25), something without a name "
        "(probability 0.11)."
    )
    assert also_in_words(made) == also
    print_finding(made, None)
    assert also in capsys.readouterr().out
    table = _explanations(made)
    for words in (
        "clock drift",
        "beam bow, beam width and clock drift",
        "something without a name",
        "no effect",
        "0.60",
        "0.25",
    ):
        assert words in table


def test_effects_that_cannot_be_distinguished_come_with_the_run_that_would():
    either = replace(DRIFT, indistinguishable_from=("thermal_drift",), extra_run="taps before and after the runs")
    sets = ((("clock_drift",), 0.6), (("thermal_drift",), 0.36))
    made = replace(report("explained"), steps=(either,), explanations=sets)
    said = headline(made)
    assert said.startswith("Clock drift or thermal drift 24.9 ppm (23.7 to 26.2; probability 0.97) explains the gap")
    assert said.endswith("To separate clock drift from thermal drift: taps before and after the runs.")
    assert also_in_words(made) == ""  # it is said already
    assert "to separate them: taps before and after the runs" in _table(made)


def test_a_curve_of_another_form_is_a_statement_of_its_own(capsys):
    assert law_in_words(LawStatement(True, 0.3, 0.0)) == ""
    made = replace(report("no_gap"), law=LawStatement(False, 0.97, 0.0012))
    print_finding(made, None)
    said = capsys.readouterr().out
    assert said.startswith("No gap")
    words = "The curve is not Eq. 5: Eq. 5 misses it by 1.2 ms RMS (probability 0.97); see draglag analyze for the form"
    assert words in said


def test_no_probability_is_stated_beyond_what_was_counted():
    assert "(probability 0.99)" in law_in_words(LawStatement(False, 0.999999, 0.001))
    assert LawStatement(False, 0.999999, 0.001).to_dict()["probability_other"] == 0.99
    assert "probability < 0.01" in headline(replace(report("explained"), steps=(replace(DRIFT, probability=1e-4),)))


def test_what_a_gap_follows_is_reported_in_words(capsys):
    made = replace(report("unexplained"), unexplained_by="normal_acceleration")
    print_finding(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert said.startswith("Unexplained: a gap remains that follows the normal acceleration;")


def test_a_probable_cause_that_is_not_in_the_model_is_named(capsys):
    """It is not true that no known effect makes the gap."""
    sets = ((("clock_drift", "smoothing_shrink"), 0.97),)
    made = replace(report("unexplained"), steps=(DRIFT,), unexplained_by="normal_acceleration", explanations=sets)
    words = (
        "Unexplained: a gap remains that follows the normal acceleration; the most probable cause, smoothing that "
        "shrinks (probability 0.97), is not in the model: held-out runs have to support an effect."
    )
    print_finding(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert words in said
        assert "no known effect" not in said
    either = replace(DRIFT, effect="thermal_drift", indistinguishable_from=("clock_drift",))
    known = replace(made, steps=(either,), explanations=((("clock_drift",), 0.9),))
    assert "no known effect makes it" in headline(known)


def test_scatter_is_not_reported_as_something_that_a_gap_follows(capsys):
    made = replace(report("unexplained"), unexplained_by="scatter")
    print_finding(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert said.startswith("Unexplained: single edges scatter more than those of a sound rig")


def test_a_wider_shadow_is_not_reported_twice():
    """An effect that a step names as one it may be is not listed as one that could not have been seen."""
    session = SimpleNamespace(taps=None, runs=())
    view = SimpleNamespace(x_mm=np.array([0.0, 400.0]))
    law = SimpleNamespace(plateau_mm_s=0.0)
    for terms, listed in (((), True), ((Term("beam_width", ()),), False)):
        fit = SimpleNamespace(terms=terms, runs=(), view=view, width_mm=500.0, run_index=np.zeros(0, int), law=law)
        lacking = not_shown(session, fit)
        assert ("scale_error" in lacking) is listed
        assert all(lacking.values())  # each with the recording that would show it


@pytest.mark.parametrize("follows", ["speed", "scatter"])
def test_a_limit_of_effects_is_reported_instead_of_that_none_is_known(follows, capsys):
    made = replace(report("unexplained"), unexplained_by=follows, stopped_at=0)
    print_finding(made, None)
    for said in (capsys.readouterr().out, headline(made)):
        assert "effects were limited to 0" in said
        assert "no known effect" not in said
        assert "follows scatter" not in said


DRIFT = Step("clock_drift", {"drift_ppm": (24.9, (23.7, 26.2))}, "", "session_time", 1e-9, "", 2.7, 0.22, 0.97)
OFFSET = Step(
    "clock_offset", {"offset_s": (0.006, (0.005, 0.007))}, "", "taps", 1e-9, "taps lie +6.0 ms off", 0.18, 0.18, 0.95
)


def test_the_headline_names_cause_size_and_what_the_gap_becomes(capsys):
    numbers = {"steps": (DRIFT,), "gap_first_mm": 2.7, "gap_last_mm": 0.22, "noise_floor_mm": 0.19}
    print_finding(replace(report("explained"), **numbers), None)
    assert capsys.readouterr().out.split("\n")[0] == (
        "Clock drift 24.9 ppm (23.7 to 26.2; probability 0.97) explains the gap: 2.70 → 0.22 mm, noise 0.19."
    )
    part = headline(replace(report("unexplained"), **numbers))
    named, rest = part.split(" is part of the gap: 2.70 → 0.22 mm, noise 0.19. ")
    assert named == "Clock drift 24.9 ppm (23.7 to 26.2; probability 0.97)"
    assert rest.startswith("Unexplained")


def test_what_is_less_probable_than_not_may_be_part_of_the_gap():
    """The same in the window; one that is probable makes the sentence sure again."""
    numbers = {"gap_first_mm": 2.7, "gap_last_mm": 0.22, "noise_floor_mm": 0.19}
    doubted = replace(DRIFT, probability=0.25)
    may_be = " (23.7 to 26.2; probability 0.25) may be part of the gap: 2.70 → 0.22 mm, noise 0.19. Unexplained"
    made = replace(report("unexplained"), steps=(doubted,), **numbers)
    assert may_be in headline(made)
    assert may_be in in_window(made.to_dict())
    both = replace(made, steps=(DRIFT, doubted))
    assert " are part of the gap: 2.70 → 0.22 mm" in headline(both)
    assert " are part of the gap: 2.70 → 0.22 mm" in in_window(both.to_dict())


def test_an_effect_added_by_hand_is_no_part_of_a_gap_that_is_not_there():
    """The same in the window."""
    made = replace(report("no_gap"), steps=(replace(DRIFT, probability=0.19),))
    tried = "With clock drift 24.9 ppm (23.7 to 26.2; probability 0.19): 0.18 → 0.18 mm, noise 0.20. No gap"
    assert headline(made).startswith(tried)
    assert in_window(made.to_dict()).startswith(tried)


def test_an_offset_shown_by_taps_has_no_gap_of_its_own(capsys):
    """No held-out run shows it: no gap figure is made up for it, and what the taps say is in the words."""
    made = replace(report("explained"), steps=(OFFSET,))
    assert headline(made).startswith("Clock offset 6 ms (5 to 7; probability 0.95), by the taps. Edges do not show it")
    print_finding(made, None)
    for said in (capsys.readouterr().out, _table(made)):
        assert OFFSET.evidence in said


@pytest.mark.parametrize("effect", EFFECTS)
def test_names_and_sizes_are_the_same_in_terminal_report_window_and_correction(effect, capsys):
    """In words and in the unit people read, without an id."""
    sizes = {spec.name: (spec.typical, (0.9 * spec.typical, 1.1 * spec.typical)) for spec in EFFECTS[effect].parameters}
    step = Step(effect, sizes, "", "session_time", 1e-9, "", 2.7, 0.22, 0.97, indistinguishable_from=("thermal_drift",))
    made = replace(report("explained"), steps=(step,), not_seen={effect: "more runs"})
    print_finding(made, None)
    terminal = " ".join(capsys.readouterr().out.split())
    corrected = size_words(ModelEffect(id=effect, parameters={name: size for name, (size, _) in sizes.items()}))
    assert title_of(effect) in terminal
    for spec in EFFECTS[effect].parameters:
        shown = f"{spec.in_words} {amount(spec, spec.typical)}"
        assert shown in _table(made)
        assert shown in shown_in_window(effect, spec.name, spec.typical)
        assert shown in corrected
    for said in (terminal, _table(made), corrected):
        assert not re.search(r"\b[a-z]+_[a-z]", re.sub(r"<[^>]*>", " ", said))


@pytest.mark.parametrize(
    ("effect", "parameter", "value", "shown"),
    [
        ("clock_drift", "drift_ppm", -24.94, "−24.94 ppm"),
        ("frame_drop", "share", 0.1234, "12.34 %"),
        ("poll_grid", "jitter_s", 4e-5, "40 µs"),
        ("acceleration_lag", "lag_s_per_mm_s2", 2e-6, "2 ms/(m/s²)"),
        ("loss_of_contact", "losses_per_min", 6.0, "6/min"),
        ("second_filter_mode", "threshold_mm_s2", 3000.0, "3000 mm/s²"),  # which its fit adds
    ],
)
def test_a_size_has_the_unit_people_read(effect, parameter, value, shown):
    assert amount(parameter_of(EFFECTS[effect].parameters, parameter), value) == shown


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


def test_runs_that_the_fit_does_not_judge_by_are_reported_with_the_reason():
    runs = [SimpleNamespace(id=f"run-0{k}", protocol=kind) for k, kind in ((1, "circle"), (2, "circle"), (3, "step"))]
    session, of_runs = SimpleNamespace(runs=runs), [SimpleNamespace(run=run) for run in runs]
    first, last = (SimpleNamespace(runs=of_runs, run_index=np.array(used)) for used in ([0, 0, 1, 1], [0, 0]))
    said = unjudged(session, replace(report("no_gap"), first=first, last=last))
    assert said == "Not judged by: run-02 (circle, left out with an effect), run-03 (step, too few edges or events)."
    last.run_index = np.array([0, 1, 2])
    assert unjudged(session, replace(report("no_gap"), first=first, last=last)) == ""


def test_what_was_left_out_of_the_library_may_be_what_is_unexplained():
    ran = CliRunner().invoke(cli, ["gap", str(SAMPLE), "--without", "low_speed_plateau"])
    assert ran.exit_code == 0, ran.output
    assert "Unexplained" in ran.output.split("\n")[0]  # and nothing else of the speed is named for it
    assert "It may be what was left out of the library: low_speed_plateau." in ran.output
    limited = CliRunner().invoke(cli, ["gap", str(SAMPLE), "--without", "scan_skew", "--max-effects", "0"])
    assert "left out of the library" not in limited.output
