"""A session file that was touched up is refused, or says so, before anything is computed from it."""

from pathlib import Path

import h5py
import pytest
from tests.realistic.session import make_session

from draglag.analysis import analyze
from draglag.errors import DataError
from draglag.store import read_session, write_session


@pytest.fixture
def path(tmp_path: Path) -> Path:
    session, _ = make_session(5, "double", 5.0)
    write_session(session, tmp_path / "session.h5")
    return tmp_path / "session.h5"


@pytest.mark.parametrize("stream", ["touch", "laser"])
@pytest.mark.parametrize(("value", "words"), [(1e12, "has a time of 1e\\+12 s"), (float("nan"), "is no number")])
def test_an_absurd_time_is_refused_by_run_and_sample(path: Path, stream: str, value: float, words: str) -> None:
    with h5py.File(path, "r+") as file:
        group = file[f"runs/run-03/{stream}"]
        group["time"][7] = value
    with pytest.raises(DataError, match=f"run-03: .*{stream} sample 7 {words}"):
        read_session(path)


def test_times_that_go_back_are_refused(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        group = file["runs/run-02/touch"]
        group["time"][100] = group["time"][50]
    with pytest.raises(DataError, match="run-02: touch sample 100 goes back in time"):
        read_session(path)


def test_changed_raw_data_are_reported_with_the_results(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        group = file["runs/run-02/touch"]
        group["x_mm"][100] += 1.0
    assert any("changed after recording" in text for text in analyze(read_session(path)).warnings)


def test_an_untouched_file_carries_no_warning(path: Path) -> None:
    assert not any("changed after recording" in text for text in analyze(read_session(path)).warnings)
