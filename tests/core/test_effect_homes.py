"""What is particular to one effect stands in that effect's home, and nowhere else."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import draglag
from draglag.correction import realise
from draglag.gap.fitting.state import Term
from draglag.model_file import ModelEffect, Shape
from draglag.simulation.effects import EFFECTS, Effect
from draglag.simulation.effects.other_packages import GROUP
from draglag.simulation.kinematics import Kinematics, Motion

CORE = Path(draglag.__file__).parent
HOMES = CORE / "simulation" / "effects"
WINDOWS = Path(__file__).parents[2] / "app" / "draglag_app"
OWN = [name for name, effect in EFFECTS.items() if effect.__module__.startswith("draglag.")]


def sources() -> list[Path]:
    files = [*CORE.rglob("*.py"), *WINDOWS.rglob("*.py")]
    assert len(files) > 200
    return [file for file in files if HOMES not in file.parents]


def lines_with(pattern: str) -> list[str]:
    wanted = re.compile(pattern)
    return [
        f"{file.name}:{number}: {line.strip()}"
        for file in sources()
        for number, line in enumerate(file.read_text("utf-8").splitlines(), start=1)
        if wanted.search(line)
    ]


def test_nothing_outside_its_home_names_an_effect() -> None:
    found = lines_with(rf"[\"']({'|'.join(OWN)})[\"']")
    assert not found, "\n".join(found)


def test_no_module_but_the_reproduction_of_the_paper_imports_an_effects_class() -> None:
    """The paper's own gap is that of one effect; whatever judges sessions knows the library only as a whole."""
    found = lines_with(rf"draglag\.simulation\.effects\.({'|'.join(OWN)})\b")
    assert [line for line in found if not line.startswith("own_gap.py")] == []


def test_late_modules_are_there_and_have_what_they_are_for() -> None:
    late = [effect for effect in EFFECTS.values() if effect.refitted_by]
    assert late
    assert all(callable(effect.own_module().refits) for effect in late)
    assert GROUP == "draglag.effects"


def moved(effect: Effect) -> tuple[float, float]:
    """By how much an effect moves a path of changing speed, RMS mm, and its latency, RMS s."""
    t = np.arange(0.0, 20.0, 0.001)
    x, y = 150 + 40 * np.sin(3 * t), 100 + 40 * np.cos(3 * t)
    motion = Motion(t, x, y, np.gradient(x, t), np.gradient(y, t), np.ones(t.size, bool))
    k = Kinematics(motion, t, 300.0, 200.0)
    shown = effect.position(x, y, k)
    late = effect.latency(np.full(t.size, 0.05), k, np.random.default_rng(0)) - 0.05
    return float(np.sqrt(np.mean((shown[0] - x) ** 2 + (shown[1] - y) ** 2))), float(np.sqrt(np.mean(late**2)))


@pytest.mark.parametrize(
    ("name", "theta", "sizes", "expected_mm", "expected_s"),
    [
        ("second_filter_mode", (0.0, 2.0, 5.0, 10.0), (0.012,), 0.0, 0.006),
        ("second_filter_mode", (0.012, 3.0, 5.0, 10.0), (0.012,), 0.0, 0.006),
        ("second_filter_mode", (1.0, 1.0), (0.012,), 0.0, None),
        ("pitch_ripple", (5.0, 1.0), (0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.4, 0.0), 0.4, 0.0),
        ("spatial_warp", (1.0,), (0.5, 0.0), None, 0.0),
        ("spatial_warp", (0.0, 2.0), (0.5,), None, 0.0),
        ("smoothing_shrink", (0.02,), (4e-4,), None, 0.0),
    ],
)
def test_shapes_of_models_saved_so_far_are_read_as_their_effects(
    name: str, theta: tuple[float, ...], sizes: tuple[float, ...], expected_mm: float | None, expected_s: float | None
) -> None:
    shape = Shape(theta=theta, sizes=sizes, about=0.1)
    saved = ModelEffect.model_validate_json(
        ModelEffect(id=name, parameters={"amplitude": 0.02}, shape=shape).model_dump_json()
    )
    off_mm, late_s = moved(realise(saved))
    assert off_mm == pytest.approx(expected_mm, rel=0.05) if expected_mm is not None else 0.01 < off_mm < 2
    assert late_s == pytest.approx(expected_s, rel=0.05) if expected_s is not None else 0 <= late_s <= 0.012


@pytest.mark.parametrize("name", OWN)
def test_a_term_without_a_setting_leaves_traces_and_law_as_they_are(name: str) -> None:
    home, term = EFFECTS[name], Term(name, (), (0.01,))
    assert home.undoing(term, ()) == (None, term)
    assert home.asked(()) is None
