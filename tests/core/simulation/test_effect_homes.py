"""What is particular to one effect stands in that effect's home, and nowhere else."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import ClassVar

import numpy as np
import pytest

import draglag
from draglag.gap.correction import realise
from draglag.gap.fitting.joint import Fit, fit_session
from draglag.gap.fitting.parameters import parameters_of, where_of
from draglag.gap.fitting.state import Term
from draglag.gap.replaying.realised import effects_of_fit
from draglag.gap.streams.evidence import inspect
from draglag.gap.streams.stamps import StreamEffect, Streams
from draglag.gap.traces.run_data import gather
from draglag.model.file import ModelEffect, Shape
from draglag.protocol.runs import load_protocol
from draglag.recording import FloatArray, Run, Session
from draglag.simulation import simulate_session
from draglag.simulation.effects import EFFECTS, Effect, Parameter
from draglag.simulation.effects.in_fits import FittedTerm, Parameters
from draglag.simulation.kinematics import Kinematics, Motion
from draglag.simulation.residual import LineGains, Signature, View

CORE = Path(draglag.__file__).parent
HOMES = CORE / "simulation" / "effects"
WINDOWS = Path(__file__).parents[3] / "app" / "draglag_app"
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
    refitted = [effect for effect in EFFECTS.values() if effect.refitted_by]
    seen = [effect for effect in EFFECTS.values() if effect.detected_by]
    assert len(refitted) > 5
    assert len(seen) > 7
    assert all(callable(effect.own_module().refits) for effect in refitted)
    assert all(callable(import_module(effect.detected_by).detect) for effect in seen)


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
    assert home.speed_delay(()) is None


@dataclass(frozen=True)
class Swing(Effect):
    """Of two columns, in sine and cosine of the session time."""

    id: ClassVar[str] = "swing"
    meaning: ClassVar[str] = "The latency swings with a period of 20 s."
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("swing_s", "s", 0.0, 0.05, 0.005),)
    detected_by: ClassVar[str] = "swing_in_streams"

    def latency(self, latency_s: FloatArray, k: Kinematics, rng: np.random.Generator) -> FloatArray:
        return latency_s + self.value * np.sin(2 * np.pi * k.session_s / 20 + 1.0)

    @classmethod
    def signatures(cls, view: View, gains: LineGains | None = None) -> list[Signature]:
        turn = 2 * np.pi * view.since_start_s / 20
        return [Signature(latency=np.column_stack([np.sin(turn), np.cos(turn)]))]

    @classmethod
    def parameters_in(cls, found: FittedTerm) -> Parameters:
        swing, reach = float(np.hypot(*found.sizes)), 1.96 * float(found.se.max())
        return {"swing_s": (swing, (swing - reach, swing + reach))}

    @classmethod
    def where_in(cls, fit: Fit) -> str:
        return f"in {len(fit.runs)} runs"


@pytest.fixture
def swinging(monkeypatch: pytest.MonkeyPatch) -> Session:
    monkeypatch.setitem(EFFECTS, Swing.id, Swing)
    return simulate_session("screen-1", load_protocol("demo"), effects=[Swing(0.008)], seed=2)


def test_an_effect_of_two_columns_says_itself_what_its_sizes_mean(swinging: Session) -> None:
    runs = gather(swinging)
    fit = fit_session(swinging, runs, [Term(Swing.id)], start=fit_session(swinging, runs))
    value, (low, high) = parameters_of(Swing.id, fit)["swing_s"]
    assert low < 0.008 < high
    assert high - low < 0.002
    assert value == pytest.approx(0.008, abs=0.001)
    assert where_of(Swing.id, fit) == f"in {len(runs)} runs"
    assert effects_of_fit(fit) == (Swing(value),)


def test_an_effect_from_outside_is_looked_for_in_the_streams(
    swinging: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def detect(streams: Streams, runs: tuple[Run, ...]) -> tuple[StreamEffect | None, tuple[Run, ...]]:
        seen = StreamEffect(Swing.id, "swing_s", 0.008, (0.007, 0.009), "everywhere", "seen", 1.0)
        return seen, tuple(replace(run, id=f"{run.id} quiet") for run in runs)

    module = ModuleType("swing_in_streams")
    module.detect = detect  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "swing_in_streams", module)
    seen, repaired = inspect(swinging)
    assert [item.effect for item in seen] == [Swing.id]
    assert all(run.id.endswith("quiet") for run in repaired.runs)
    assert not any(run.id.endswith("quiet") for run in swinging.runs)
