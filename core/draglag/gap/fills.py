"""Losses of contact that something filled in with straight lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from draglag.gap.stamps import StreamEffect
from draglag.recording import Run, TouchTrace


def filled_losses(runs: tuple[Run, ...], held: bool) -> tuple[StreamEffect | None, tuple[Run, ...]]:
    """Straight evenly spaced stretches that the noise forbids: a loss of contact that something filled in.

    ``held``: positions are of uneven age, so that only the straightness can tell, and has to last longer.
    """
    least = 4 if held else 3
    count, length_s, total_s = 0, [], 0.0
    out = []
    for run in runs:
        t, x, y = run.touch.t_s, run.touch.x_mm, run.touch.y_mm
        if t.size < 60:
            out.append(run)
            continue
        total_s += float(t[-1] - t[0])
        # How far each event lies from the line between its neighbours at its own stamp: stamps are not quite even.
        share = (t[1:-1] - t[:-2]) / np.maximum(t[2:] - t[:-2], 1e-9)
        off = [v[1:-1] - v[:-2] - share * (v[2:] - v[:-2]) for v in (x, y)]
        bend = np.hypot(*off)
        if held:
            # Positions of uneven age lie unevenly along the line, but on it.
            chord = np.hypot(x[2:] - x[:-2], y[2:] - y[:-2])
            bend = np.abs(off[0] * (y[2:] - y[:-2]) - off[1] * (x[2:] - x[:-2])) / np.maximum(chord, 1e-9)
        moving = np.hypot(np.diff(x), np.diff(y))[1:] > 0
        straight = (bend < 0.02 * np.median(bend) + 2e-4) & moving
        keep = np.ones(t.size, bool)
        start = None
        for k in range(straight.size + 1):
            inside = k < straight.size and straight[k]
            if inside and start is None:
                start = k
            elif not inside and start is not None:
                if k - start >= least:
                    count += 1
                    length_s.append(float(t[k + 1] - t[start]))
                    keep[start + 1 : k + 1] = False
                start = None
        if keep.all():
            out.append(run)
            continue
        ids = run.touch.contact_id[keep] if run.touch.contact_id.size == keep.size else run.touch.contact_id
        touch = TouchTrace(t[keep], x[keep], y[keep], ids, gaps_s=run.touch.gaps_s)
        out.append(replace(run, touch=touch))
    if count < 4:
        return None, runs
    per_min = 60 * count / max(total_s, 1.0)
    reach = 1.96 * np.sqrt(count) * 60 / max(total_s, 1.0)
    effect = StreamEffect(
        "loss_of_contact",
        "losses_per_min",
        per_min,
        (per_min - reach, per_min + reach),
        "straight lines in the trace",
        f"{count} straight fills of {1e3 * float(np.median(length_s)):.0f} ms (median)",
        count / max(len(runs), 1),
    )
    return effect, tuple(out)
