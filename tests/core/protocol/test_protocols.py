"""Protocols and screens: presets load, runs fit the screen, malformed files are refused by line."""

import numpy as np
import pytest

from draglag.errors import DataError
from draglag.protocol.presets import load_screen_file
from draglag.protocol.runs import expand, load_protocol, load_screen, session_duration_s
from draglag.protocol.targets import check_on_screen
from draglag.recording import Beam
from draglag_resources import presets


@pytest.mark.parametrize("protocol", presets("protocols"))
@pytest.mark.parametrize("screen", presets("screens"))
def test_every_preset_fits_every_screen(protocol, screen):
    panel = load_screen(screen)
    plan = load_protocol(protocol)
    assert plan.name == protocol
    runs = expand(plan, panel)
    assert [run.id for run in runs] == [f"run-{i:02d}" for i in range(1, len(runs) + 1)]
    for run in runs:
        check_on_screen(run.target, panel, 4.0)


def test_a_session_takes_its_parts_with_a_rest_between_each_two():
    quick, demo, check = (load_protocol(name) for name in ("quick", "demo", "clock-check"))
    screen = load_screen("screen-1")
    parts_s = [run.duration_s + 3.0 for run in expand(quick, screen)]
    assert session_duration_s(quick, expand(quick, screen), 3.0) == sum(parts_s) + (len(parts_s) - 1) * quick.rest_s
    parts_s = [run.duration_s + 3.0 for run in expand(demo, screen)]
    parts_s += [3.0 + demo.taps.count * demo.taps.interval_s] + 2 * [demo.clock_check.duration_s]
    assert session_duration_s(demo, expand(demo, screen), 3.0) == sum(parts_s) + (len(parts_s) - 1) * demo.rest_s
    assert session_duration_s(check, (), 3.0) == check.clock_check.duration_s  # "Two minutes", as it says


def test_screens_are_those_of_the_paper():
    one, two, raw = (load_screen_file(n) for n in ("screen-1", "screen-2", "screen-2-uncorrected"))
    assert (one.screen.width_mm, one.screen.height_mm, one.screen.width_px) == (509.2, 286.4, 1920)
    assert (two.screen.width_mm, two.screen.height_mm, two.screen.height_px) == (304.1, 228.1, 768)
    assert tuple(one.law.model_dump().values()) == (90.53, 4.00e-3, 182.9, 2.90e-2, 28.49)
    assert tuple(two.law.model_dump().values()) == (9.57, 3.30e-3, 440.7, 1.98e-2, 28.22)
    assert tuple(raw.law.model_dump().values()) == (9.90, 7.92e-2, 313.7, 1.88e-2, 23.65)
    assert (one.taps.release_median_s, two.taps.release_median_s) == (0.02875, 0.02814)


def test_latency_sweep_covers_44_to_1000_in_an_order_that_the_seed_shuffles():
    plan, screen = load_protocol("latency-sweep"), load_screen("screen-1")
    speeds = [run.nominal_speed_mm_s for run in expand(plan, screen)]
    assert len(speeds) >= 13
    assert (min(speeds), max(speeds)) == (44, 1000)
    assert speeds != sorted(speeds)
    assert [run.nominal_speed_mm_s for run in expand(plan, screen)] == speeds
    other = [run.nominal_speed_mm_s for run in expand(plan, screen, seed=99)]
    assert other != speeds
    assert sorted(other) == sorted(speeds)


def test_demo_measures_circles_chirp_multisine_step_and_taps():
    plan, screen = load_protocol("demo"), load_screen("screen-1")
    kinds = [run.kind for run in expand(plan, screen)]
    assert kinds.count("circle") >= 9
    assert kinds[-3:] == ["chirp", "multisine", "step"]
    assert plan.taps.count == 100


def test_circles_travel_more_than_their_diameter_sideways_and_pass_over_the_beam():
    screen = load_screen("screen-1")
    beam = Beam(0.01, 120.0)
    for run in expand(load_protocol("latency-sweep"), screen, beam=beam):
        travel = run.target.sideways_mm_s * run.duration_s
        px_s = 15 if run.radius_mm < 60 else 20
        assert run.target.sideways_mm_s == pytest.approx(px_s * 509.2 / 1920)
        assert travel / (2 * run.radius_mm) > 1
        assert run.target.centre_y_mm == pytest.approx(120 + 0.01 * 509.2 / 2)


def test_a_narrow_screen_slows_the_sideways_speed_and_says_so():
    runs = expand(load_protocol("validation-x3"), load_screen("screen-2"))
    assert runs[0].kind == "chirp"
    assert "lowered" in runs[0].note
    assert runs[3].note == ""


def _write(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text, "utf-8")
    return path


GOOD = 'name = "mine"\n\n[[runs]]\nkind = "chirp"\n\n[[runs]]\nkind = "circle"\nspeed_mm_s = 100\nrepeats = 3\n'


def test_a_file_of_ones_own_works_like_a_preset(tmp_path):
    plan = load_protocol(_write(tmp_path, GOOD))
    assert plan.source == GOOD
    assert [run.kind for run in expand(plan, load_screen("screen-1"))] == ["chirp", "circle", "circle", "circle"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("= 100", "= -100", r"mine.toml, line 8: runs.2.speed_mm_s: expected a number greater than 0"),
        ("= 100", '= "fast"', r"line 8: runs.2.speed_mm_s: expected a number"),
        ("repeats", "repeat", r"line 9: runs.2.repeat: there is no such key"),
        ('"chirp"', '"spiral"', r"line 4: runs.1.kind: expected one of 'circle', 'chirp', 'multisine', 'step'"),
        ("speed_mm_s = 100\n", "", r"line 6: runs.2: a circle needs either speed_mm_s or speeds_mm_s"),
        ('kind = "chirp"', "kind = ", r"mine.toml is not valid TOML: .*line 4"),
        ('name = "mine"', "", r"line 1: name: is missing"),
        ("speed_mm_s = 100", "speed_mm_s = 1e12", r"runs.2.speed_mm_s: expected a number of at most 20000"),
        ("speed_mm_s = 100", "speed_mm_s = true", r"runs.2.speed_mm_s: expected a number"),
    ],
)
def test_a_malformed_file_is_refused_by_line(tmp_path, old, new, words):
    with pytest.raises(DataError, match=words):
        load_protocol(_write(tmp_path, GOOD.replace(old, new, 1)))


def test_an_empty_protocol_and_an_unknown_name_are_refused(tmp_path):
    with pytest.raises(DataError, match="at least one of"):
        load_protocol(_write(tmp_path, 'name = "x"\n'))
    with pytest.raises(DataError, match=r"no protocol preset or file 'nope'.*latency-sweep"):
        load_protocol("nope")
    with pytest.raises(DataError, match=r"no screen preset or file 'tv'.*screen-1"):
        load_screen("tv")


def test_a_file_that_is_no_text_is_refused_with_a_remedy(tmp_path):
    (tmp_path / "x.toml").write_bytes(b"\x89HDF")
    with pytest.raises(DataError, match=r"is not UTF-8 text \(byte 0\). Save it as UTF-8"):
        load_protocol(tmp_path / "x.toml")


def test_a_circle_too_big_for_the_screen_is_refused(tmp_path):
    plan = load_protocol(_write(tmp_path, GOOD.replace("repeats = 3", "radius_mm = 140")))
    assert np.isclose(plan.runs[1].radius_mm, 140)
    with pytest.raises(DataError, match="leaves the screen"):
        expand(plan, load_screen("screen-2"))
