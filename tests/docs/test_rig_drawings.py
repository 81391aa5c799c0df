"""The drawings of the rig are those of its measures, and a rig that cannot be built is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[2]
NAMES = ["rig-bracket.svg", "rig-plan.svg", "rig-wiring.svg"]


def draw(folder: Path, *measures: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "packaging" / "rig_drawings.py"), "--out", str(folder), *measures]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def texts(file: Path) -> list[str]:
    return [text for element in ElementTree.parse(file).iter() if (text := (element.text or "").strip())]


def test_the_drawings_of_the_documentation_are_up_to_date(tmp_path: Path) -> None:
    assert draw(tmp_path).returncode == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == NAMES
    for name in NAMES:
        shown = (ROOT / "docs" / "pictures" / name).read_text("utf-8")
        assert shown == (tmp_path / name).read_text("utf-8"), "run: .venv/bin/python packaging/rig_drawings.py"


def test_another_screen_and_stylus_give_other_measures(tmp_path: Path) -> None:
    measures = ("--screen-width-mm", "304.1", "--bezel-mm", "30", "--stylus-diameter-mm", "9", "--bezel-step-mm", "1")
    assert draw(tmp_path, *measures).returncode == 0
    assert "touch area 304.1" in texts(tmp_path / "rig-plan.svg")
    assert "head to head 328.1" in texts(tmp_path / "rig-plan.svg")  # 304.1 + 2 (30 − 18)
    shown = texts(tmp_path / "rig-bracket.svg")
    assert "5 above the glass" in shown  # 9 / 2 + 0.5
    assert "beam 4" in shown  # above a frame that stands 1 mm above the glass


@pytest.mark.parametrize(
    ("measures", "said"),
    [
        (("--bezel-step-mm", "3"), "the nut of the fibre head would touch the frame: choose a larger above_widest_mm"),
        (("--bezel-mm", "10"), "it would stand on the touch area"),
        (("--bracket-width-mm", "12"), "choose a larger bracket_width_mm"),
        (("--stylus-diameter-mm", "-7"), "each measure must be above zero"),
    ],
)
def test_a_rig_that_cannot_be_built_is_refused(tmp_path: Path, measures: tuple[str, ...], said: str) -> None:
    done = draw(tmp_path / "out", *measures)
    assert done.returncode == 1
    assert said in done.stderr
    assert not (tmp_path / "out").exists()
