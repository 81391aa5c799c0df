"""The page on the exchange folder: its shortest header is read, and means what the page says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from draglag.exchange import read_exchange

PAGE = Path(__file__).parents[3] / "docs" / "exchange.md"


def test_the_shortest_header_of_the_page_is_read(tmp_path: Path) -> None:
    header = json.loads(PAGE.read_text("utf-8").split("```json")[1].split("```")[0])
    (tmp_path / "session.json").write_text(json.dumps(header))
    # A held position repeats at a later stamp and stays; the row that comes twice counts once.
    rows = ("0.10,5,5", "0.11,6,5", "0.12,6,5", "0.12,6,5", "0.13,7,5")
    (tmp_path / "run-01.touch.csv").write_text("\n".join(("t_s,x_mm,y_mm", *rows)))
    (tmp_path / "run-01.laser.csv").write_text("t_s,light\n0.05,1\n0.115,0\n0.125,1\n")
    (run,) = read_exchange(tmp_path).runs
    assert run.touch.t_s.tolist() == [0.10, 0.11, 0.12, 0.13]
    assert run.laser.light.tolist() == [1, 0, 1]
    assert run.radius_mm == 60
    assert run.start_s == pytest.approx(0.05)
    assert run.start_s + run.duration_s == pytest.approx(0.13)
