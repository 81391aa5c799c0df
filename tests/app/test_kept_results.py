"""``draglag analyze`` keeps its result in the session file, unless it is asked not to or cannot."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from core.store_sessions import assert_same
from draglag.exchange import read_exchange
from draglag.store import read_analyses, read_session, write_session
from draglag_app.cli.main import cli

SAMPLE = Path(__file__).parents[1] / "data" / "exchange" / "none-A"


def analyze(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["analyze", *map(str, arguments)])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_session(read_exchange(SAMPLE), tmp_path_factory.mktemp("made") / "s.h5")


def test_a_result_is_kept_once_and_the_raw_data_stay(made: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(made, tmp_path / "s.h5"))
    before = read_session(path)
    assert analyze(path, "--json").exit_code == 0
    assert analyze(path, "--json").exit_code == 0
    (stored,) = read_analyses(path)
    assert stored.options["estimator"] == "efficient"
    assert {run["id"] for run in stored.result["runs"]} <= {run.id for run in before.runs}
    assert all(run["latency_ms"] for run in stored.result["runs"])
    assert analyze(path, "--json", "--form", "constant").exit_code == 0
    assert [one.options["form"] for one in read_analyses(path)] == ["best", "constant"]
    assert_same(read_session(path), before)


def test_asked_not_to_nothing_is_written(made: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(made, tmp_path / "s.h5"))
    before = path.read_bytes()
    assert analyze(path, "--json", "--no-save").exit_code == 0
    assert path.read_bytes() == before


def test_a_file_that_may_not_be_written_costs_a_warning_and_no_result(made: Path, tmp_path: Path) -> None:
    path = Path(shutil.copy(made, tmp_path / "s.h5"))
    path.chmod(0o444)
    before = path.read_bytes()
    done = analyze(path)
    assert done.exit_code == 0
    assert "latency ms" in done.stdout
    assert done.stderr.count("\n") == 1
    assert "the result is not stored: " in done.stderr
    assert "is write-protected" in done.stderr
    assert path.read_bytes() == before
    asked = analyze(path, "--save")
    assert asked.exit_code == 1
    assert "is write-protected" in asked.stderr


def test_an_exchange_folder_is_analysed_and_keeps_nothing(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(SAMPLE, tmp_path / "x"))
    before = sorted(path.name for path in folder.iterdir())
    done = analyze(folder)
    assert (done.exit_code, done.stderr) == (0, "")
    assert sorted(path.name for path in folder.iterdir()) == before
