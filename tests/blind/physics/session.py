"""One session on disk: the neutral exchange folder, and beside it, never inside, the truth."""

import gzip
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import host, laser
from .digitiser import Panel, draw_variants, scan
from .hand import move
from .rig import Profile, Rig, draw_rig, stream


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
            "seed": self.seed, "hidden_effects": self.effects, "variants": self.variants, "n_edges": self.n_edges,
            "rig": rig, "true_latency_ms": self.true_latency_ms,
        }  # fmt: skip


def make_session(
    out_dir: Path | str, seed: int, effects: Mapping[str, float] | None = None, profile: Profile | None = None
) -> Truth:
    """Write one session to `out_dir` and return its truth.

    The same seed gives the same rig, hand and noise whatever the effects, so a session and its twin without
    the effect differ by the effect alone.
    """
    out = Path(out_dir)
    out.mkdir(parents=True, exist_ok=True)
    effects = dict(effects or {})
    rig = draw_rig(seed, profile or Profile())
    name, width, height, width_px, height_px = rig.screen
    panel = Panel(effects, draw_variants(seed, effects, rig))
    runs, latencies, details, n_edges = [], {}, {}, 0
    for run in rig.plan:
        motion = move(rig, run, stream(seed, f"hand {run.id}"))
        tau, x, y, behind = scan(rig, panel, run, motion, seed)
        tau, x, y = host.deliver(rig, panel, run, (tau, x, y), seed)
        stamp, light, crossed = laser.edges(rig, panel, run, motion, seed)
        _write(out / f"{run.id}.touch.csv.gz", "t_s,x_mm,y_mm", "%.6f,%.4f,%.4f", (tau, x, y))
        _write(out / f"{run.id}.laser.csv.gz", "t_s,light", "%.7f,%d", (stamp, light))
        at_edges = np.interp(crossed, motion.t_s, behind)
        latencies[run.id] = float(1e3 * at_edges.mean()) if len(crossed) else None
        n_edges += len(crossed)
        details[run.id] = {"edge_s": crossed, "latency_s": at_edges, "stamp_s": stamp, "touch": (tau, x, y)}
        details[run.id] |= {
            key: np.interp(crossed, motion.t_s, getattr(motion, key))
            for key in ("x_mm", "y_mm", "vx_mm_s", "vy_mm_s", "speed_mm_s", "along_mm_s2")
        }
        runs.append(
            {
                "id": run.id,
                "protocol": run.protocol,
                "nominal_speed_mm_s": run.nominal_speed_mm_s,
                "radius_mm": run.radius_mm,
                "duration_s": run.duration_s,
                "start_s": run.start_s,
            }
        )
    end = rig.plan[-1].start_s + rig.plan[-1].duration_s + 15.0
    blocks = [
        host.taps(rig, panel, rig.taps_before, 0.0, seed, "before"),
        host.taps(rig, panel, rig.taps_after, end, seed, "after"),
    ]
    taps = np.concatenate(blocks)
    if len(taps):
        _write(out / "taps.csv.gz", "physical_s,registered_s,down", "%.6f,%.6f,%d", tuple(taps.T))
    session = {
        "format": "draglag-exchange", "version": 1,
        "screen": {"name": name, "width_mm": width, "height_mm": height, "width_px": width_px, "height_px": height_px},
        "stylus_diameter_mm": rig.diameter_mm,
        "clock": "all times in seconds on the host's monotonic clock; y grows downwards",
        "runs": runs, "taps": "taps.csv.gz" if len(taps) else None,
    }  # fmt: skip
    (out / "session.json").write_text(json.dumps(session, indent=1))
    return Truth(seed, effects, panel.variants, rig, latencies, n_edges, details)


def _write(path: Path, header: str, form: str, columns: tuple[np.ndarray, ...]) -> None:
    rows = np.column_stack(columns).tolist()
    text = header + "\n" + "".join(form % tuple(row) + "\n" for row in rows)
    # No time in the gzip header: the same seed gives the same bytes.
    path.write_bytes(gzip.compress(text.encode(), compresslevel=4, mtime=0))
