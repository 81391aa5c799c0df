"""A bounded part of ``./run fuzz``: every reader of text accepts its input or refuses it in one sentence."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from fuzz.engine import GROWTH_MB, try_reader
from fuzz.readers import readers

INPUTS = 1500
# On a busy computer fewer inputs are tried, not a longer time spent: the readers together have 5 s.
SHARE_S = 5.0 / 27


@pytest.mark.parametrize("number", range(27))
def test_hostile_text_is_accepted_or_refused_in_one_sentence(number: int, tmp_path: Path) -> None:
    known = readers(tmp_path)
    assert len(known) == 27, "a reader is not tried"
    folder = tmp_path / "folder"
    folder.mkdir()
    outcome = try_reader(known[number], folder, INPUTS, seed=7, until_s=time.monotonic() + SHARE_S)
    assert not outcome.faults, f"{outcome.reader}: {outcome.faults[0][0]}\n{outcome.faults[0][1]!r}"
    assert outcome.accepted > len(known[number].seeds), "no changed input was accepted: only the first check was tried"
    assert outcome.grown_mb < GROWTH_MB
