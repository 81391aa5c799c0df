"""What ``analyze`` prints for people next to its numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from bench.strokes import even_strokes
from draglag.exchange import read_exchange, write_exchange
from draglag.latency.flags import MEANING
from draglag.recording import Run, Session
from draglag.simulation import rig_for_screen
from draglag.simulation.law import LatencyLaw
from draglag_app.cli import cli

SAMPLE = Path(__file__).parent.parent / "data" / "exchange" / "none-A"


def leaping() -> Run:
    """Even strokes whose trace is uneven at the beam, by a steep law."""
    rig = replace(rig_for_screen("screen-1"), law=LatencyLaw(300.0, 0.01, 0.0, 0.03, 40.0), run_latency_sd_s=0.0)
    return even_strokes(rig, 450.0, 90.0, turn_s=0.15, off_middle=0.2, run_id="leaping")[0]


@pytest.fixture(scope="module")
def session() -> Session:
    """Two sound circles, an aborted one, a stepping target, and even strokes with an uneven trace."""
    whole = read_exchange(SAMPLE)
    kept = [whole.run(run_id) for run_id in ("run-04", "run-10", "run-15")]
    return replace(whole, runs=(replace(whole.run("run-05"), outcome="aborted"), *kept, leaping()), taps=None)


@pytest.fixture(scope="module")
def blocks(session: Session, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """What is printed, block by block."""
    folder = write_exchange(session, tmp_path_factory.mktemp("words") / "in")
    result = CliRunner().invoke(cli, ["analyze", str(folder), "--form", "constant"])
    assert result.exit_code == 0, result.output
    return result.stdout.split("\n\n")


def test_every_flag_is_explained_below_its_table(blocks: list[str]) -> None:
    for table, flags in (("run ", {"aborted", "uneven_trace", "excess_scatter"}), ("validation ", {"extrapolated"})):
        (place,) = [k for k, block in enumerate(blocks) if block.startswith(table)]
        title, *lines = blocks[place + 1].splitlines()
        assert title == "Flags"
        assert {tuple(line.split(maxsplit=1)) for line in lines} == {(flag, MEANING[flag]) for flag in flags}
        assert flags <= set(blocks[place].replace(",", " ").split())


def test_a_run_of_a_wrong_speed_is_to_be_recorded_again_not_included(blocks: list[str]) -> None:
    listed = [block for block in blocks if block.startswith("Not in the curve")]
    (may_be,) = [block for block in listed if "--include" in block]
    (again,) = [block for block in listed if "record again" in block]
    assert may_be.splitlines()[1:] == ["  run-05: aborted"]
    assert again.splitlines()[1:] == ["  leaping: uneven trace"]
    assert len(listed) == 2


def test_touches_off_the_screen_are_pointed_out_once(session: Session, tmp_path: Path) -> None:
    run = session.run("run-04")
    far = replace(run, touch=replace(run.touch, x_mm=3 * run.touch.x_mm))
    folder = write_exchange(replace(session, runs=(far,)), tmp_path / "in")
    result = CliRunner().invoke(
        cli, ["analyze", str(folder), "--form", "constant", "--report", str(tmp_path / "report")]
    )
    assert result.exit_code == 0, result.output
    assert (result.stdout + result.stderr).count("The touches of run-04 reach from") == 1
    assert "\nWarnings\n  The touches of run-04 reach from" in result.stdout
    assert (tmp_path / "report" / "report.html").read_text("utf-8").count("The touches of run-04 reach from") == 1
