"""Touch events that a driver hands over several at a time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from draglag.messages import message
from draglag.path.events import last_of_batches, sample_interval_s
from draglag.recording import Run


def batch_warnings(runs: Sequence[Run]) -> list[str]:
    """A sentence where events come in batches: the latency is that of the last event of each."""
    sizes, waits_s = [], []
    for run in runs:
        last = last_of_batches(run.touch)
        if 1 < last.t_s.size < run.touch.t_s.size:
            size = run.touch.t_s.size / last.t_s.size
            sizes.append(size)
            waits_s.append((1 - 1 / size) * sample_interval_s(last.t_s))
    if not sizes:
        return []
    return [
        message(
            "Touch events arrive {size:.0f} at a time: the latencies are those of the last of each batch. A program "
            "that reads every event has the first of a batch {wait:.1f} ms later.",
            size=float(np.median(sizes)),
            wait=1e3 * float(np.median(waits_s)),
        )
    ]
