"""Whatever leaves the program says which session, date and version it is from, and whether it was simulated."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

import draglag
from draglag.analysis import analyze
from draglag.drawing import style
from draglag.gap import close_gap
from draglag.gap.replaying.extended import extended_model
from draglag.protocol.runs import load_protocol
from draglag.provenance import Source, joint_source, source_of
from draglag.recording import Session
from draglag.report import figures
from draglag.report.gap import write_gap_report
from draglag.report.write import write_report
from draglag.simulation import simulate_session
from draglag.store import write_session
from draglag_app.cli import cli


@pytest.fixture(scope="module")
def simulated() -> Session:
    """Five runs: what is marked is marked whatever their number."""
    whole = simulate_session("screen-1", load_protocol("demo"), seed=3)
    return replace(whole, runs=whole.runs[:5])


@pytest.fixture(scope="module")
def measured(simulated: Session) -> Session:
    """The same data from instruments that exist."""
    devices = {"touch": "evdev:/dev/input/event3 · panel", "laser": "ethercat:eth1 · EL1252"}
    return replace(simulated, name="lab", devices=devices, started_utc="2026-11-24T10:31:05+00:00")


def test_the_line_says_session_date_and_version(simulated: Session, measured: Session) -> None:
    assert source_of(measured).line() == f"lab · 2026-11-24 10:31 UTC · draglag {draglag.__version__}"
    assert source_of(simulated).line() == f"SIMULATED · {simulated.name} · draglag {draglag.__version__}"
    assert "date unknown" in source_of(replace(measured, started_utc="")).line()


def test_a_figure_of_several_sessions_is_simulated_where_one_of_them_is() -> None:
    both = joint_source([Source("a", "2026-11-24T10", False), Source("b", "", True)])
    assert (both.session, both.simulated) == ("a, b", True)
    assert "SIMULATED" in both.line()


def test_reports_and_their_figures_are_marked(simulated: Session, measured: Session, tmp_path: Path) -> None:
    for session, marked in ((simulated, True), (measured, False)):
        analysis = analyze(session)
        with style.house_style():
            drawn = figures.latency_figure(analysis)
            style.sign(drawn, source_of(session))
        texts = [text.get_text() for text in drawn.texts]
        assert source_of(session).line() in texts
        assert ("SIMULATED" in texts) is marked
        page = write_report(session, analysis, tmp_path / session.name).read_text("utf-8")
        assert ("<title>SIMULATED – " in page) is marked
        assert ("no touchscreen was measured" in page) is marked


def test_the_gap_report_and_its_model_are_marked(simulated: Session, measured: Session, tmp_path: Path) -> None:
    for session, marked in ((simulated, True), (measured, False)):
        report = close_gap(session, max_effects=0)
        page = write_gap_report(session, report, tmp_path / f"{session.name}.html").read_text("utf-8")
        assert ("<title>SIMULATED – " in page) is marked
        assert source_of(session).line() in page
        assert report.to_dict()["simulated"] is marked
        assert extended_model(session, report).provenance.simulated is marked


@pytest.mark.parametrize("command", [["analyze"], ["gap", "--max-effects", "0"]])
def test_json_says_whether_it_was_simulated(simulated: Session, tmp_path: Path, command: list[str]) -> None:
    write_session(simulated, tmp_path / "s.h5")
    ran = CliRunner().invoke(cli, [command[0], str(tmp_path / "s.h5"), *command[1:], "--json"])
    assert json.loads(ran.stdout)["simulated"] is True


def test_the_terminal_says_whether_it_was_simulated(simulated: Session, measured: Session, tmp_path: Path) -> None:
    for session, marked in ((simulated, True), (measured, False)):
        write_session(session, tmp_path / f"{marked}.h5")
        ran = CliRunner().invoke(cli, ["analyze", str(tmp_path / f"{marked}.h5")])
        assert ran.stdout.startswith("SIMULATED · ") is marked
