"""Beginnings and ends of contacts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from draglag.touch_events.frames import Frame
from draglag_devices.source import ContactChanges


class ContactLog:
    """Tracks contacts; ``down``: tracking ids present before the first frame."""

    def __init__(self, down: Iterable[int] = ()) -> None:
        self._down = set(down)

    def take(self, frames: Sequence[Frame], id_offset: int = 0) -> ContactChanges | None:
        """Changes in these frames. ``id_offset`` is added to tracking ids."""
        rows: list[tuple[float, int, int]] = []
        for frame in frames:
            for contact in frame.lifted:
                if contact in self._down:
                    self._down.discard(contact)
                    rows.append((frame.t_s, contact, 0))
            for seen in frame.contacts:
                if seen.contact_id not in self._down:
                    self._down.add(seen.contact_id)
                    rows.append((frame.t_s, seen.contact_id, 1))
        if not rows:
            return None
        t_s, ids, down = zip(*rows, strict=True)
        return ContactChanges(np.array(t_s), np.array(ids, np.int64) + id_offset, np.array(down, np.int64))
