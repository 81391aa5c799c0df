"""Exports hold stored results, and no more of a session in memory than a piece."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat

from core.store_sessions import assert_same, bare_session, full_session, laser
from draglag.exchange import read_exchange, write_csv, write_exchange, write_mat, write_netcdf
from draglag.recording import Run, Session, TouchTrace
from draglag.store import add_analysis, open_columns, read_analyses, read_session, write_session

RESULT = {
    "session": "Prüfling",
    "runs": [
        {
            "id": "run-01",
            "speed_mm_s": 90.0,
            "latency_ms": 70.0,
            "latency_ci95_ms": [68.0, 72.0],
            "flags": ["few_edges"],
        },
        {"id": "run-02", "speed_mm_s": 50.0, "latency_ms": None, "latency_ci95_ms": None, "flags": []},
    ],
}


def test_stored_results_are_in_every_export(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray", reason="xarray is not installed")
    pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    path = tmp_path / "s.h5"
    write_session(full_session(), path)
    add_analysis(path, RESULT, {"estimator": "paper"}, "2026-03-01T11:00:00+00:00")
    session, results = read_session(path), read_analyses(path)

    for folder in (
        write_csv(session, tmp_path / "csv", results),
        write_exchange(session, tmp_path / "x", results=results),
    ):
        first, second = csv.DictReader((folder / "results.csv").open(encoding="utf-8"))
        assert (first["id"], float(first["latency_ms"]), float(first["latency_ci95_high_ms"])) == ("run-01", 70.0, 72.0)
        assert (first["analysis"], first["created_utc"]) == ("1", "2026-03-01T11:00:00+00:00")
        assert second["latency_ms"] == ""
        (whole,) = json.loads((folder / "results.json").read_text("utf-8"))
        assert (whole["result"], whole["options"]) == (results[0].result, {"estimator": "paper"})
    assert_same(read_exchange(tmp_path / "x"), session)

    with xarray.open_datatree(write_netcdf(session, tmp_path / "s.nc", results), engine="h5netcdf") as tree:
        latency = tree["analysis/1/runs/latency_ms"]
        assert (latency.values[0], latency.attrs["units"]) == (70.0, "ms")
        assert json.loads(tree["analysis/1"].attrs["result_json"]) == results[0].result

    loaded = loadmat(write_mat(session, tmp_path / "s.mat", results), squeeze_me=True, simplify_cells=True)["session"]
    runs = loaded["analysis"]["x1"]["runs"]
    assert (runs["latency_ms"][0], runs["units"]["latency_ms"]) == (70.0, "ms")
    assert loaded["runs"]["run_01"]["touch"]["units"]["x_mm"] == "mm"


@pytest.mark.parametrize("name", ["é µ 中 𝄞 Prüfling, whole", "plain"])
def test_octave_and_scipy_read_every_letter_of_a_text(tmp_path: Path, name: str) -> None:
    path = write_mat(replace(full_session(), name=name), tmp_path / "s.mat")
    session = loadmat(path, squeeze_me=True, simplify_cells=True)["session"]
    assert session["name"].rstrip() == name
    # Octave takes as many bytes as the file counts characters.
    assert len(session["name"]) == len(name.encode())
    if shutil.which("octave-cli") is None:
        pytest.skip("octave is not installed")
    said = subprocess.run(
        ["octave-cli", "--eval", f"load('{path}'); printf('[%s]', strtrim(session.name));"], capture_output=True
    )
    assert said.stdout.decode() == f"[{name}]"


@pytest.mark.parametrize("write", [write_exchange, write_csv, write_mat, write_netcdf])
def test_an_export_from_the_file_piece_by_piece_is_that_of_the_whole(
    tmp_path: Path, write: Callable[[Any, Path], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    if write is write_netcdf:
        pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")
    monkeypatch.setattr("draglag.store.stored.BLOCK_ROWS", 7)
    write_session(full_session(), tmp_path / "s.h5")
    whole = write(read_session(tmp_path / "s.h5"), tmp_path / "whole")
    with open_columns(tmp_path / "s.h5") as session:
        pieces = write(session, tmp_path / "pieces")
    if whole.is_dir():
        assert sorted(path.name for path in whole.iterdir()) == sorted(path.name for path in pieces.iterdir())
        pairs = [(path, pieces / path.name) for path in whole.iterdir()]
    else:
        pairs = [(whole, pieces)]
    for one, two in pairs:
        # A MATLAB file begins with the time it was made, and HDF5 may lay the same data out in another way.
        if write is write_mat:
            assert one.read_bytes()[128:] == two.read_bytes()[128:]
        elif write is write_netcdf:
            assert subprocess.run(["h5diff", one, two], check=False).returncode == 0
        else:
            assert one.read_bytes() == two.read_bytes(), one.name


_MEASURE = """
import resource, sys
from pathlib import Path
from draglag_app.cli import main
try:
    main(["export", sys.argv[1], "--to", sys.argv[2], "--out", sys.argv[3]])
except SystemExit as end:
    assert not end.code
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)
"""


@pytest.mark.parametrize(
    ("kind", "events"), [("exchange", 40_000), ("csv", 40_000), ("netcdf", 100_000), ("mat", 100_000)]
)
def test_an_export_takes_no_more_memory_for_a_longer_session(tmp_path: Path, kind: str, events: int) -> None:
    if kind == "netcdf":
        pytest.importorskip("h5netcdf", reason="h5netcdf is not installed")

    def peak_mib(runs: int) -> int:
        path = tmp_path / f"{runs}.h5"
        write_session(long_session(runs, events), path)
        done = subprocess.run(
            [sys.executable, "-c", _MEASURE, path, kind, tmp_path / f"out-{runs}"], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return int(done.stdout.split()[-1])

    # 50 MB of columns more; where they become text, 20 MB, which as text in memory are ten times that.
    assert peak_mib(10) - peak_mib(1) < 30


def long_session(runs: int, events: int) -> Session:
    """``runs`` runs of 1 kHz touch."""
    rng = np.random.default_rng(1)
    parts = []
    for k in range(runs):
        start_s = 1e4 * k
        t_s = 1e-3 * np.arange(events)
        (x_mm, y_mm), (x_raw, y_raw) = rng.uniform(0, 200, (2, events)), rng.uniform(0, 4000, (2, events))
        trace = TouchTrace(start_s + t_s, x_mm, y_mm, rng.integers(0, 9, events), x_raw, y_raw, t_s)
        parts.append(Run(f"run-{k + 1:02}", "circle", start_s, 1e-3 * events, trace, laser(12, start_s)))
    return replace(bare_session(), runs=tuple(parts))
