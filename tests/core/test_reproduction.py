from __future__ import annotations

import pytest

from draglag.protocols import load_protocol
from draglag.reproduction.measure import chirp_j0_mm2
from draglag.reproduction.own_gap import gap_figures, gap_words, own_gap
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


def test_the_papers_own_gap_is_found_named_and_closed() -> None:
    """Screen 2 holds its latency below 100 mm/s (Fig. 5); Eq. 5 does not."""
    sweep = load_protocol("latency-sweep")
    short = tuple(run.model_copy(update={"duration_s": 25.0}) for run in sweep.runs)
    found = own_gap(3, sweep.model_copy(update={"runs": short}))
    assert found.closed, found.report.to_dict()
    assert found.plateau_mm_s is not None
    value, (low, high) = found.plateau_mm_s
    assert low - 1 < found.truth_mm_s < high + 1, f"found {value}"
    report = found.report
    assert report.gap_first_mm is not None
    assert report.gap_last_mm is not None
    assert report.noise_floor_mm is not None
    assert report.gap_first_mm > 2 * report.noise_floor_mm
    assert report.gap_last_mm < 1.15 * report.noise_floor_mm
    before, after = found.replays
    assert after.rms_ms_ci95[1] < before.rms_ms_ci95[0]
    text = " ".join(gap_words(found))
    assert f"low_speed_plateau at {value:.1f} mm/s (95 %: {low:.1f} to {high:.1f}" in text
    assert "nothing else was named" in text
    assert "verdict explained" in text
    assert [name for name, _, _ in gap_figures(found)] == ["own-gap-steps", "own-gap-latency", "own-gap-edges"]
