from __future__ import annotations

import pytest

from draglag.reproduction.measure import chirp_j0_mm2
from draglag.simulation import rig_for_screen


@pytest.mark.parametrize(
    ("screen", "width_mm", "diameter", "radius"),
    [("screen-1", 509.2, 205.9, 365.9), ("screen-2", 304.1, 80.2, 95.9)],
)
def test_the_papers_chirp_figures_fit_the_diameter(
    screen: str, width_mm: float, diameter: float, radius: float
) -> None:
    law = rig_for_screen(screen).law.latency_s
    # The circle's chord, not its arc, is what an edge moves by: up to 4 % less than (v L)².
    assert chirp_j0_mm2(law, 0.1 * width_mm) == pytest.approx(diameter, rel=0.05)
    assert chirp_j0_mm2(law, 0.2 * width_mm) == pytest.approx(radius, rel=0.05)
