"""``draglag demo``: a whole simulated measurement finds what was simulated."""

import numpy as np
import pytest
from click.testing import CliRunner

import draglag.report
from draglag.errors import DataError
from draglag.gap import close_gap
from draglag.simulation import rig_for_screen
from draglag.store import read_analyses, read_session
from draglag_app.cli.demo import demo
from draglag_app.cli.main import cli
from draglag_app.cli.record import record

needs_report = pytest.mark.skipif(not hasattr(draglag.report, "write_report"), reason="no report in this version")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("demo") / "new"
    return out, CliRunner().invoke(demo, ["--out", str(out), "--no-window"])


@needs_report
def test_the_demo_makes_session_and_report_and_says_where(made):
    out, result = made
    assert result.exit_code == 0, result.output
    for name in ("session.h5", "report.html"):
        assert (out / name).stat().st_size > 10_000
        assert str(out / name) in result.output


@needs_report
def test_the_demo_finds_the_simulated_law(made):
    out, _ = made
    rig, analysis = rig_for_screen("screen-1"), read_analyses(out / "session.h5")[-1].result
    runs = [run for run in analysis["runs"] if run["latency_ms"] is not None]
    assert len(runs) >= 9
    for run in runs:
        low, high = run["latency_ci95_ms"]
        # The hand's speed is not even: over ± 15 % of speed the law itself bends by less than 2 ms.
        allowed_ms = 2.0 + 1.5 * (high - low)
        assert run["latency_ms"] == pytest.approx(1e3 * float(rig.law.latency_s(run["speed_mm_s"])), abs=allowed_ms)
    assert analysis["curve"]["rms_ms"] < 1.43  # the paper's
    assert {check["protocol"] for check in analysis["validation"]} == {"chirp", "multisine", "step"}
    assert all(check["delta_J_percent"] > 80 for check in analysis["validation"])
    # The median of 100 has a standard error of 1.25 · 2.5 ms / 10.
    for name, median_s in (("touch", rig.tap_touch_s), ("release", rig.tap_release_s)):
        assert analysis["taps"][name]["n"] == 100
        assert analysis["taps"][name]["median_ms"] == pytest.approx(1e3 * median_s, abs=4 * 0.31)


@needs_report
def test_the_demo_keeps_its_analysis_as_analyze_does(made):
    path = made[0] / "session.h5"
    assert CliRunner().invoke(cli, ["analyze", str(path), "--save"]).exit_code == 0
    assert len(read_analyses(path)) == 1  # an equal one is stored once


def test_nothing_is_missing_from_the_model_of_the_demo(made):
    report = close_gap(read_session(made[0] / "session.h5"))
    assert (report.verdict, report.steps) == ("no_gap", ())


@needs_report
def test_record_measures_the_same(made, tmp_path):
    words = ["demo", "--touch", "sim:", "--laser", "sim:", "--walt", "sim:", "--display", "offscreen"]
    result = CliRunner().invoke(record, [*words, "--out", str(tmp_path / "s.h5")])
    assert result.exit_code == 0, result.output
    one, other = read_session(made[0] / "session.h5"), read_session(tmp_path / "s.h5")
    assert [run.id for run in one.runs] == [run.id for run in other.runs]
    for a, b in zip(one.runs, other.runs, strict=True):
        np.testing.assert_array_equal(a.touch.x_mm, b.touch.x_mm)
        np.testing.assert_array_equal(a.laser.device_t_s, b.laser.device_t_s)


def test_the_demo_overwrites_nothing(tmp_path):
    (tmp_path / "session.h5").write_bytes(b"mine")
    result = CliRunner().invoke(demo, ["--out", str(tmp_path), "--no-window"])
    assert isinstance(result.exception, DataError)
    assert "not overwritten" in str(result.exception)
    assert (tmp_path / "session.h5").read_bytes() == b"mine"


def test_an_unknown_screen_is_refused_before_anything_is_made(tmp_path):
    result = CliRunner().invoke(demo, ["--out", str(tmp_path / "new"), "--screen", "screen-9", "--no-window"])
    assert isinstance(result.exception, DataError)
    assert "screen-9" in str(result.exception)
    assert not (tmp_path / "new").exists()
