"""One session on disk: the neutral exchange folder, and next to it, never inside, the truth."""

import gzip
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from . import hand, host, laser
from .digitiser import Panel, scan
from .filters import FILTERS
from .motion import Motion
from .real import moves
from .real.rig import draw_real_rig
from .rig import Profile, Rig, RunPlan, draw_rig, stream
from .variants import draw_variants


@dataclass(frozen=True)
class Truth:
    """What was hidden. `details` (arrays of each run, for tests of the generator) never reaches a file."""

    seed: int
    effects: dict[str, float]
    variants: dict[str, Any]
    rig: Rig
    true_latency_ms: dict[str, float | None]
    n_edges: int
    details: dict[str, dict[str, Any]] = field(default_factory=dict, repr=False)

    def to_dict(self) -> dict[str, Any]:
        rig = asdict(self.rig)
        return {
            "seed": self.seed, "world": self.rig.world, "law_form": self.rig.law.form,
            "hidden_effects": self.effects, "variants": self.variants, "n_edges": self.n_edges,
            "rig": rig, "true_latency_ms": self.true_latency_ms,
        }  # fmt: skip


RUNS_KEPT = 20  # of one session, which is made several times, each with something else hidden in it


@dataclass(frozen=True)
class Hand:
    """A rig by what the hand's way depends on (``parts``): neither what is hidden nor the panel's noise moves it."""

    rig: Rig = field(compare=False, repr=False)
    parts: tuple[Any, ...]

    @classmethod
    def of(cls, rig: Rig) -> "Hand":
        beam = (rig.beam_slope, rig.beam_intercept_mm)
        return cls(rig, (rig.world, rig.screen, *beam, rig.speed_window_s, *sorted(rig.hand.items())))


@lru_cache(maxsize=RUNS_KEPT)
def _motion(made_by: Hand, run: RunPlan, seed: int) -> Motion:
    """The hand's way through a run, the same arrays for all sessions of a seed: they are read only."""
    rig = made_by.rig
    real = rig.world == "realistic"
    motion = moves.move(rig, run, seed) if real else hand.move(rig, run, stream(seed, f"hand {run.id}"))
    for values in vars(motion).values():
        if isinstance(values, np.ndarray):
            values.flags.writeable = False
    return motion


def make_session(
    out_dir: Path | str | None,
    seed: int,
    effects: Mapping[str, float] | None = None,
    profile: Profile | None = None,
) -> Truth:
    """The truth of a session written to `out_dir` (None: not written).

    A seed fixes rig, hand and noise whatever the effects: a session and its twin differ by the effect alone.
    """
    effects, profile = dict(effects or {}), profile or Profile()
    rig = (draw_real_rig if profile.world == "realistic" else draw_rig)(seed, profile)
    panel = Panel(effects, draw_variants(seed, effects, rig))
    files: dict[str, tuple[str, str, tuple[np.ndarray, ...]]] = {}
    runs, latencies, details, n_edges = [], {}, {}, 0
    for run in rig.plan:
        motion = _motion(Hand.of(rig), run, seed)
        tau, x, y, behind = scan(rig, panel, run, motion, seed)
        tau, x, y = host.deliver(rig, panel, run, (tau, x, y), seed)
        stamp, light, crossed = laser.edges(rig, panel, run, motion, seed)
        files[f"{run.id}.touch.csv.gz"] = "t_s,x_mm,y_mm", "%.6f,%.4f,%.4f", (tau, x, y)
        files[f"{run.id}.laser.csv.gz"] = "t_s,light", "%.7f,%d", (stamp, light)
        at_edges = np.interp(crossed, motion.t_s, behind)
        latencies[run.id] = float(1e3 * at_edges.mean()) if len(crossed) else None
        if out_dir is not None and len(crossed) and set(effects) & set(FILTERS):
            latencies[run.id] = 1e3 * _latency_behind_filters(rig, panel, run, motion, crossed, seed)
        n_edges += len(crossed)
        details[run.id] = {"edge_s": crossed, "latency_s": at_edges, "stamp_s": stamp, "touch": (tau, x, y)}
        details[run.id] |= {
            key: np.interp(crossed, motion.t_s, getattr(motion, key))
            for key in ("x_mm", "y_mm", "vx_mm_s", "vy_mm_s", "speed_mm_s", "along_mm_s2")
        }
        public = ("id", "protocol", "nominal_speed_mm_s", "radius_mm", "duration_s", "start_s")
        runs.append({key: getattr(run, key) for key in public})
    end = rig.plan[-1].start_s + rig.plan[-1].duration_s + 15.0
    blocks = [
        host.taps(rig, panel, rig.taps_before, 0.0, seed, "before"),
        host.taps(rig, panel, rig.taps_after, end, seed, "after"),
    ]
    taps = np.concatenate(blocks)
    if len(taps):
        files["taps.csv.gz"] = "physical_s,registered_s,down", "%.6f,%.6f,%d", tuple(taps.T)
    if out_dir is not None:
        _write_all(Path(out_dir), rig, runs, files)
    return Truth(seed, effects, panel.variants, rig, latencies, n_edges, details)


def _latency_behind_filters(
    rig: Rig, panel: Panel, run: RunPlan, motion: Motion, crossed: np.ndarray, seed: int
) -> float:
    """By how many seconds the trace without noise, shifted, comes closest to where the stylus was at the edges (k,)."""
    clean = replace(rig, noise_mm=0.0, run_offset_sd_mm=0.0, step_mm=0.0)
    t, _, y, _ = scan(clean, panel, run, motion, seed)
    there = np.interp(crossed, motion.t_s, motion.y_mm)
    middle, reach = 0.12, 0.12
    for _ in range(4):
        tries = np.linspace(middle - reach, middle + reach, 61)
        away = [float(np.mean((np.interp(crossed + late, t, y) - there) ** 2)) for late in tries]
        middle, reach = float(tries[int(np.argmin(away))]), reach / 15
    return middle


def _write_all(out: Path, rig: Rig, runs: list[dict[str, Any]], files: dict[str, Any]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    for file, (header, form, columns) in files.items():
        _write(out / file, header, form, columns)
    name, width, height, width_px, height_px = rig.screen
    session = {
        "format": "draglag-exchange", "version": 1,
        "screen": {"name": name, "width_mm": width, "height_mm": height, "width_px": width_px, "height_px": height_px},
        "stylus_diameter_mm": rig.diameter_mm,
        "clock": "all times in seconds on the host's monotonic clock; y grows downwards",
        "runs": runs, "taps": "taps.csv.gz" if "taps.csv.gz" in files else None,
    }  # fmt: skip
    (out / "session.json").write_text(json.dumps(session, indent=1))


def _write(path: Path, header: str, form: str, columns: tuple[np.ndarray, ...]) -> None:
    values = np.column_stack(columns).ravel().tolist()
    text = header + "\n" + (form + "\n") * len(columns[0]) % tuple(values)
    # No time in the gzip header: the same seed gives the same bytes.
    path.write_bytes(gzip.compress(text.encode(), compresslevel=4, mtime=0))
