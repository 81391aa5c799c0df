"""Contacts that touch at the same time: the method follows one stylus."""

from __future__ import annotations

import numpy as np

from draglag.messages import Message, message
from draglag.recording import TouchTrace

RETURNS_S = 0.1  # no finger is lifted, lets another touch and is back sooner: its number stands for one contact


def at_once(touch: TouchTrace) -> list[Message]:
    """One sentence on contacts whose events come in turns; empty without any, or without their numbers."""
    if touch.contact_id.size != touch.t_s.size:
        return []
    known = touch.contact_id >= 0
    ids, t_s = touch.contact_id[known], touch.t_s[known]
    order = np.argsort(ids, kind="stable")
    # Between two events of one contact there are events of others.
    between = (np.diff(ids[order]) == 0) & (np.diff(order) > 1) & (np.diff(t_s[order]) <= RETURNS_S)
    if not between.any():
        return []
    return [message("several contacts touch at the same time, and draglag measures one stylus: keep the rows of one")]
