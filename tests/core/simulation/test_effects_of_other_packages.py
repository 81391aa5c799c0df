"""An effect from a package of its own is simulated, found, named, sized, corrected for, saved and reported."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import plugins
from plugins import installed, python, with_packages

GROUP = "draglag.effects"
TRUE_S = 0.012
HELP_AND_SIMULATE = """
import sys
from draglag_app.cli.main import main
shown = ["--effect", "nothing=1", "--screen", "screen-1", "--out", sys.argv[1]]
codes = []
for arguments in (["simulate", "--help"], ["simulate", *shown]):
    try:
        main(arguments)
    except SystemExit as end:
        codes.append(end.code)
print(f"help: {codes[0]}", f"simulate: {codes[1]}", sep="\\n")
"""


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return plugins.example("draglag-edge-averaging", GROUP, tmp_path_factory.mktemp("site"))


def test_the_example_goes_all_the_way(example: list[Path], tmp_path: Path) -> None:
    session, model, page = (str(tmp_path / name) for name in ("s.h5", "m.json", "gap.html"))
    effect = ("--effect", f"edge_averaging={TRUE_S}")
    shown = ("--screen", "screen-1", "--protocol", "quick", *effect, "--seed", "5")
    made = with_packages(example, "simulate", *shown, "--out", session)
    assert made.returncode == 0, made.stderr
    found = with_packages(example, "gap", session, "--json", "--save-model", model, "--report", page)
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
    corrected = with_packages(example, "validate", session, "--model", model)
    assert "corrected for edge averaging" in corrected.stdout + corrected.stderr
    without = with_packages(example, "gap", session, "--json", "--without", "edge_averaging")
    assert without.returncode == 0, without.stderr
    assert "edge_averaging" not in [s["effect"] for s in json.loads(without.stdout)["steps"]]


def test_without_its_package_a_model_says_which_effect_is_not_known(example: list[Path], tmp_path: Path) -> None:
    session = str(tmp_path / "s.h5")
    refused = with_packages(
        [], "simulate", "--screen", "screen-1", "--effect", f"edge_averaging={TRUE_S}", "--out", session
    )
    assert refused.returncode == 1
    assert "unknown effect 'edge_averaging'" in refused.stderr


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("raise RuntimeError('broken')", "RuntimeError: broken"),
        ("Made = dict", "no subclass"),
        ("from draglag.simulation.effects import Effect\nclass Made(Effect): pass", "it has no id"),
        (
            "from draglag.simulation.effects import Effect, Parameter\nclass Made(Effect):\n"
            "    id = 'scan_skew'\n    meaning = 'x'\n    parameters = (Parameter('a_s', 's', 0, 1, 0.5),)",
            "is taken",
        ),
    ],
)
def test_an_effect_that_cannot_be_used_is_left_out_with_a_warning(tmp_path: Path, source: str, said: str) -> None:
    (tmp_path / "strange.py").write_text(source)
    paths = [installed(tmp_path, {"made": "strange:Made"}, GROUP)]
    listed = python(paths, HELP_AND_SIMULATE, str(tmp_path / "s.h5"))
    assert listed.stdout.splitlines()[-2:] == ["help: 0", "simulate: 1"]
    assert "effect made (strange:Made) is left out" in listed.stderr
    assert said in listed.stderr
    assert "Traceback" not in listed.stderr
