"""The quick variant of the benchmark: 41 sessions, seed 2024, against the promised rates and their binomial limits."""

import os

import pytest

from blind import workflow
from blind.benchmark import run_benchmark, table
from blind.conditions import Task
from blind.judge import run_task
from blind.making import kept_or_made

WHY = workflow.missing()

pytestmark = [
    pytest.mark.blind,
    pytest.mark.skipif(WHY is not None, reason=f"no workflow to judge yet: {WHY}"),
]


@pytest.fixture(scope="module")
def summary():
    # The seed is fixed: the same forty sessions every time, so a failure comes from a change and not from the draw.
    jobs = int(os.environ.get("DRAGLAG_TEST_JOBS", min(2, os.cpu_count() or 1)))  # one where other tests run next to it
    found = run_benchmark(quick=True, world="plain", jobs=jobs, seed=2024)
    print(table(found))
    return found


def test_the_promised_rates_are_met(summary):
    assert summary["failures"] == []


def test_behind_a_causal_low_pass_no_law_follows_another_moment():
    """The law is of the speed that the stylus has when the low-pass shows it: nothing of that is left for a name."""
    sizes = {"smoothing_shrink": 0.037015410441269}
    outcome = run_task(
        Task("single", "smoothing_shrink", 1.0, 1712356866, sizes, floor=False, world="realistic", law_form="double")
    )
    assert (outcome.named, outcome.unexplained_by) == (("smoothing_shrink",), None)


def test_three_speeds_above_a_plateau_show_no_clock():
    """The end of a curve that so few speeds show is no asymptote that taps could be off."""
    sizes = {"low_speed_plateau": 136.89780118459964}
    outcome = run_task(
        Task("single", "low_speed_plateau", 1.0, 1276973015, sizes, floor=False, world="realistic", law_form="adaptive")
    )
    assert (outcome.named, outcome.verdict) == (("low_speed_plateau",), "explained")


@pytest.mark.parametrize("seed", [1056727220, 1329026291])
def test_a_drift_in_no_library_is_not_taken_for_one_that_settles(seed):
    """A latency that settles differs from a straight line by a twentieth of its size: more than noise."""
    excluded = ("clock_drift", "thermal_drift")
    outcome = run_task(Task("left_out", "clock_drift", 1.0, seed, {"clock_drift": 31.0}, excluded, floor=False))
    assert (outcome.answer, outcome.unexplained_by, outcome.spurious) == ("unexplained", "session_time", ())


def test_what_predicts_held_out_runs_is_kept_although_their_rms_is_larger_by_chance():
    """The RMS rests on the fastest runs: here it grows by 4 % with the right effect, which predicts all runs better."""
    outcome = run_task(Task("single", "lagging_law", 1.0, 331424274, {"lagging_law": 0.0658}, floor=False))
    assert (outcome.answer, outcome.verdict) == ("right name", "explained")


def test_a_name_whose_refit_is_less_likely_than_none_is_not_given():
    """A moving average that is shorter at speed: the columns of a second filter promise what its refit cannot be."""
    sizes = {"moving_average_by_speed": 0.19267436627145829}
    outcome = run_task(
        Task(
            "unknown",
            "moving_average_by_speed",
            1.0,
            657157248,
            sizes,
            floor=False,
            world="realistic",
            law_form="transport",
        )
    )
    assert (outcome.named, outcome.verdict) == ((), "unexplained")


def test_edges_that_a_refuted_filter_left_open_count_again():
    """A step at one speed on another law: without the edges about it, which the filter leaves open, there is no gap."""
    sizes = {"second_filter_mode": 0.012920380309177372}
    outcome = run_task(
        Task("single", "second_filter_mode", 1.0, 1649206756, sizes, floor=False, world="realistic", law_form="power")
    )
    assert outcome.answer in ("right name", "unexplained")


@pytest.mark.parametrize(
    ("effect", "size", "seed", "law_form"),
    [
        # At the refit of a lagging law its columns promise both, and with both nothing is gained.
        ("speed_adaptive_filter", 0.9824655224171522, 277732169, "transport"),
        # A second filter of 0.2 ms is less than runs differ by.
        ("frame_drop", 0.15574927913885225, 281063182, "constant"),
    ],
)
def test_no_second_name_stands_next_to_the_hidden_effect(effect, size, seed, law_form):
    outcome = run_task(
        Task("single", effect, 1.0, seed, {effect: size}, floor=False, world="realistic", law_form=law_form)
    )
    assert (outcome.named, outcome.verdict) == ((effect,), "explained")


def test_a_filter_of_no_size_is_not_named_for_the_edges_that_it_leaves_unsure():
    """Two of three slow runs scatter: a filter of 1.9 ± 2.1 ms, whose speed is theirs, makes their edges weigh less."""
    sizes = {"contact_trail": 1.0512700431405126}
    outcome = run_task(
        Task("single", "contact_trail", 1.0, 742663741, sizes, floor=False, world="realistic", law_form="logistic")
    )
    assert outcome.named == ()


def test_a_session_simulated_again_is_as_late_as_measured(tmp_path):
    """A tracker that averages velocities is quicker than its law by 0.2 ms, which a fit's nuisances hold."""
    task = Task(
        "single",
        "beam_width",
        1.0,
        269302471,
        {"beam_width": 0.7957535045004022},
        floor=False,
        world="realistic",
        law_form="adaptive",
    )
    report = workflow.close(kept_or_made(task, tmp_path, None).folder)
    found = next(one for one in report["check"] if one["name"] == "latency by run")
    assert found["agrees"]
    assert found["measured"] < 0.05
