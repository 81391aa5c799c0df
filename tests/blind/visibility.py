"""How clearly an effect shows in one session of known truth: python -m tests.blind.visibility prints the table.

The session is made with and without the effect; the true law aligns both, and the difference of edge residuals is the
effect's. What Eq. 5's parameters and a beam could absorb is projected out under the twin's noise, with latency and
offset free for each run. The rest, in standard deviations, is d: an effect of known shape is found with probability Φ(d
− 4) if a joint test over some hundred shapes at 1 % needs about four. `JUST_DETECTABLE` is d = 5 (84 %).
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from .conditions import STREAM, profile_for, sized
from .physics.effects import LIBRARY, UNKNOWN
from .physics.rig import Rig
from .physics.session import Truth, make_session

JUST_DETECTABLE = 5.0
TAP_PRECISION_S = 0.002
"""How well taps and an extrapolated curve place a constant: a few tenths of a ms from taps, the rest the asymptote."""


def residuals(truth: Truth, aligned_by: Truth) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """By run: residuals mm (k,) of the trace shifted by the latency of `aligned_by`, indices (k,) of edges there."""
    rig, out = aligned_by.rig, {}
    for run_id, base in aligned_by.details.items():
        run = truth.details[run_id]
        if len(base["edge_s"]) == 0 or len(run["edge_s"]) == 0:
            continue
        # A wider stylus crosses at other instants: pair by nearest.
        at = np.searchsorted(base["edge_s"], run["edge_s"]).clip(1, max(len(base["edge_s"]) - 1, 1))
        at = np.minimum(at, len(base["edge_s"]) - 1)
        before = np.maximum(at - 1, 0)
        at = np.where(abs(base["edge_s"][before] - run["edge_s"]) < abs(base["edge_s"][at] - run["edge_s"]), before, at)
        stamps = run["stamp_s"] if len(run["stamp_s"]) == len(run["edge_s"]) else run["edge_s"]
        tau = stamps + base["latency_s"][at]
        t, x, y = run["touch"]
        good = (tau > t[0] + 0.02) & (tau < t[-1] - 0.02) & (abs(base["edge_s"][at] - run["edge_s"]) < 0.02)
        tau, at = tau[good], at[good]
        away = np.interp(tau, t, y) - rig.beam_intercept_mm - rig.beam_slope * np.interp(tau, t, x)
        out[run_id] = (away - 0.5 * rig.diameter_mm * _side(rig, base, at), at)
    return out


def _side(rig: Rig, base: dict[str, np.ndarray], at: np.ndarray) -> np.ndarray:
    return np.sign(base["y_mm"][at] - rig.beam_intercept_mm - rig.beam_slope * base["x_mm"][at])


RATES_S_MM = (0.004, 0.022)  # of Eq. 5, for a law of another form


def law_columns(rig: Rig, vy_mm_s: np.ndarray, speed_mm_s: np.ndarray) -> np.ndarray:
    """What a small change of Eq. 5's parameters moves at each edge: (n, 5)."""
    rates = [rig.law.parameters.get(key, usual) for key, usual in zip(("a2", "a5"), RATES_S_MM, strict=True)]
    fast, slow = (np.exp(-rate * speed_mm_s) for rate in rates)
    return np.column_stack([np.ones_like(fast), fast, speed_mm_s * fast, slow, speed_mm_s * slow]) * vy_mm_s[:, None]


def visibility(truth: Truth, twin: Truth) -> float | None:
    """d of everything hidden in `truth`; None where the streams show it without any residual."""
    if set(truth.effects) & STREAM:
        return None
    if set(truth.effects) == {"clock_offset"}:
        taps = twin.rig.taps_before + twin.rig.taps_after
        return abs(truth.effects["clock_offset"]) / TAP_PRECISION_S if taps else 0.0
    with_it, without = residuals(truth, twin), residuals(twin, twin)
    rig = twin.rig
    spread = np.concatenate([r for r, _ in without.values()])
    sigma = 1.4826 * np.median(np.abs(spread - np.median(spread))) + 1e-3
    usual = np.median(np.concatenate([r for r, _ in with_it.values()])) - np.median(spread)
    rows = []
    for run_id, (r1, at1) in with_it.items():
        if run_id not in without:
            continue
        r0, at0 = without[run_id]
        _, i1, i0 = np.intersect1d(at1, at0, return_indices=True)
        if len(i1) < 2:
            continue
        # a few wild edges at the start of a step are nobody's evidence
        delta, at = np.clip(r1[i1] - r0[i0] - usual, -4 * sigma, 4 * sigma), at0[i0]
        base = twin.details[run_id]
        vy, v = base["vy_mm_s"][at], base["speed_mm_s"][at]
        columns = np.column_stack([law_columns(rig, vy, v), np.ones_like(vy), base["x_mm"][at]])
        cover = sigma**2 * np.eye(len(at)) + rig.run_offset_sd_mm**2 + rig.run_latency_sd_s**2 * np.outer(vy, vy)
        white = np.linalg.solve(np.linalg.cholesky(cover), np.column_stack([delta, columns]))
        rows.append(white)
    if not rows:
        return 0.0
    white = np.concatenate(rows)
    scaled = white[:, 1:] / np.maximum(np.linalg.norm(white[:, 1:], axis=0), 1e-300)
    left = white[:, 0] - scaled @ np.linalg.lstsq(scaled, white[:, 0], rcond=1e-7)[0]
    return float(np.linalg.norm(left))


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Visibility of each effect at its nominal size")
    parser.add_argument("--sessions", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(argv)
    print("effect                  d at nominal size: least, median, most of the sessions; median just detectable size")
    for name in LIBRARY + UNKNOWN:
        found, sizes = [], []
        for k in range(options.sessions):
            seed = options.seed * 1000 + k
            with tempfile.TemporaryDirectory() as folder:
                profile = profile_for((name,))
                truth = make_session(Path(folder) / "a", seed, sized((name,), 1.0, seed), profile)
                d = visibility(truth, make_session(Path(folder) / "b", seed, {}, profile))
            if d is not None:
                found.append(d)
                sizes.append(abs(truth.effects[name]) * JUST_DETECTABLE / max(d, 1e-9))
        text = "in the streams" if not found else (
            f"{min(found):8.1f} {np.median(found):8.1f} {max(found):8.1f}   {np.median(sizes):.3g}"
        )  # fmt: skip
        print(f"{name:24s}{text}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
