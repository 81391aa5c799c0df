"""What a session asks of the program it is recorded by."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path

import pytest

from draglag.errors import DraglagError
from draglag_app.windows.start import make_order


def test_looking_for_garbage_leaves_the_windows_out_while_a_session_goes_on(
    open_window: Callable, until: Callable, tmp_path: Path
) -> None:
    """Python stands still while it looks; at what the windows are made of, for several frames of the target."""
    window = open_window()
    before, frozen = gc.get_objects(), gc.get_freeze_count()
    known = set(map(id, before))  # which stay theirs: ``before`` keeps the objects
    frozen_at_start: list[int] = []
    looked_at: list[int] = []
    window.space.bridge.run_started.connect(lambda event: frozen_at_start.append(gc.get_freeze_count() - frozen))
    # What the session makes itself is looked at all the same, and is the more the slower the window hears of a run.
    window.space.bridge.run_started.connect(
        lambda event: looked_at.append(sum(id(item) in known for item in gc.get_objects()))
    )
    window.ask("start")
    until(lambda: not window.space.recording.active)
    assert frozen_at_start[0] > 0.9 * len(before)
    assert looked_at[0] < 0.2 * len(before)
    assert gc.get_freeze_count() == 0


def test_a_session_that_cannot_begin_freezes_nothing(open_window: Callable, tmp_path: Path) -> None:
    window = open_window()
    order = make_order(window.space)
    order.out.parent.mkdir(parents=True)
    order.out.write_bytes(b"")
    frozen = gc.get_freeze_count()
    with pytest.raises(DraglagError, match="exists already"):
        window.space.recording.start(order)
    assert gc.get_freeze_count() <= frozen  # of what was frozen, objects may be freed meanwhile
