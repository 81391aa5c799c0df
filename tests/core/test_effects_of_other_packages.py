"""An effect from a package of its own is simulated, found, named, sized, corrected for, saved and reported."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "draglag-edge-averaging"
TRUE_S = 0.012


def installed(folder: Path, entry_points: dict[str, str]) -> Path:
    """A folder for the module path that holds an installed package's metadata with these entry points."""
    info = folder / "stranger-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    lines = "".join(f"{name} = {value}\n" for name, value in entry_points.items())
    (info / "entry_points.txt").write_text(f"[draglag.effects]\n{lines}")
    return folder


def run(paths: list[Path], *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, with more folders on its module path."""
    known = os.environ.get("PYTHONPATH", "")
    path = os.pathsep.join([*map(str, paths), *filter(None, [known])])
    return subprocess.run(
        [sys.executable, "-c", "from draglag_app.cli.main import main; main()", *arguments],
        env={**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    made = tomllib.loads((EXAMPLE / "pyproject.toml").read_text("utf-8"))
    folder = tmp_path_factory.mktemp("site")
    return [EXAMPLE, installed(folder, made["project"]["entry-points"]["draglag.effects"])]


def test_the_example_goes_all_the_way(example: list[Path], tmp_path: Path) -> None:
    session, model, page = (str(tmp_path / name) for name in ("s.h5", "m.json", "gap.html"))
    made = run(example, "simulate", "--screen", "screen-1", "--effect", f"edge_averaging={TRUE_S}", "--seed", "5",
               "--out", session)  # fmt: skip
    assert made.returncode == 0, made.stderr
    found = run(example, "gap", session, "--json", "--save-model", model, "--report", page)
    assert found.returncode == 0, found.stderr
    report = json.loads(found.stdout)
    assert report["verdict"] == "explained"
    (step,) = report["steps"]
    assert step["effect"] == "edge_averaging"
    low, high = step["parameters"]["at_edge_s"]["ci95"]
    assert low < TRUE_S < high
    assert step["gap_after_mm"] < 0.7 * step["gap_before_mm"]
    text = Path(page).read_text("utf-8")
    assert "Edge averaging" in text
    assert "towards the side edges" in text
    corrected = run(example, "validate", session, "--model", model)
    assert "corrected for edge_averaging" in corrected.stdout + corrected.stderr
    without = run(example, "gap", session, "--json", "--without", "edge_averaging")
    assert [s["effect"] for s in json.loads(without.stdout)["steps"]] != ["edge_averaging"]


def test_without_its_package_a_model_says_which_effect_is_not_known(example: list[Path], tmp_path: Path) -> None:
    session = str(tmp_path / "s.h5")
    refused = run([], "simulate", "--screen", "screen-1", "--effect", f"edge_averaging={TRUE_S}", "--out", session)
    assert refused.returncode == 1
    assert "unknown effect 'edge_averaging'" in refused.stderr


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("raise RuntimeError('broken')", "RuntimeError: broken"),
        ("Made = dict", "no subclass"),
        ("from draglag.simulation.effects import Effect\nclass Made(Effect): pass", "it has no id"),
        (
            "from draglag.simulation.effects.base import Effect, Parameter\nclass Made(Effect):\n"
            "    id = 'scan_skew'\n    meaning = 'x'\n    parameters = (Parameter('a_s', 's', 0, 1, 0.5),)",
            "is taken",
        ),
    ],
)
def test_an_effect_that_cannot_be_used_is_left_out_with_a_warning(tmp_path: Path, source: str, said: str) -> None:
    (tmp_path / "strange.py").write_text(source)
    ran = run([installed(tmp_path, {"made": "strange:Made"})], "simulate", "--help")
    listed = run(
        [tmp_path], "simulate", "--effect", "nothing=1", "--screen", "screen-1", "--out", str(tmp_path / "s.h5")
    )
    assert ran.returncode == 0
    assert "effect made (strange:Made) is left out" in listed.stderr
    assert said in listed.stderr
    assert "Traceback" not in listed.stderr
