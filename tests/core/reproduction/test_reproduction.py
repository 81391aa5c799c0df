from __future__ import annotations

from pathlib import Path

import pytest

from draglag.drawing import style
from draglag.protocol.runs import load_protocol
from draglag.reproduction import write
from draglag.reproduction.curves import Row2
from draglag.reproduction.further import FurtherSeeds, Tally, further_seeds, further_words, table_further
from draglag.reproduction.measure import Reproduction, chirp_j0_mm2
from draglag.reproduction.own_gap import gap_figures, gap_words, own_gap
from draglag.reproduction.published import PLATEAU_MM_S
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
    assert found.truth_mm_s == PLATEAU_MM_S == 100.0
    text = " ".join(gap_words(found))
    assert f"low_speed_plateau at {value:.1f} mm/s (95 %: {low:.1f} to {high:.1f}" in text
    assert "nothing else was named" in text
    assert "verdict explained" in text
    assert [name for name, _, _ in gap_figures(found)] == ["own-gap-steps", "own-gap-latency", "own-gap-edges"]


def test_further_seeds_tell_how_often_the_intervals_of_table_2_hold() -> None:
    reported: list[float] = []
    found = further_seeds(range(4, 8), lambda fraction, text: reported.append(fraction))
    assert found is not None
    assert found.seeds == (4, 5, 6, 7)
    assert reported == sorted(reported)
    assert len(reported) == 12
    assert found.judged + sum(4 - tally.judged for tally in found.tallies) == 4 * 15
    # Screen 2's first exponential has decayed before the slowest run that counts: never determined.
    never = {(tally.screen, tally.name) for tally in found.tallies if tally.judged == 0}
    assert {("Screen 2", "a1_ms"), ("Screen 2", "a2_s_per_mm")} <= never
    assert {screen for screen, _ in never} == {"Screen 2"}
    # About 46 intervals of 95 %, those of one session not quite independent: four standard errors.
    assert found.covered >= 0.95 * found.judged - 4 * (0.95 * 0.05 * found.judged) ** 0.5
    low, high = found.share_ci95 or (1.0, 0.0)
    assert low < found.covered / found.judged <= high
    assert found.to_dict()["held"] == sum(tally.covered for tally in found.tallies)
    assert f"{found.covered} of {found.judged} intervals" in next(further_words(found))
    assert table_further(found)[1][-1][2] == f"{found.covered} of {found.judged}"


def test_intervals_that_miss_too_often_are_reported() -> None:
    found = FurtherSeeds(tuple(range(20)), (Tally("Screen 1", "a4_ms", 12, 20), Tally("Screen 2", "a7_ms", 16, 20)))
    _, slack, *_ = further_words(found)
    assert "Screen 1 a4_ms: 12 of 20 hold, fewer than chance leaves." in slack
    # 28 of 40, exact binomial limits.
    assert found.share_ci95 == pytest.approx((0.5347, 0.8344), abs=1e-3)


def test_page_and_figures_say_that_they_are_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = style.new_figure()
    monkeypatch.setattr(write, "_figures", lambda result: iter([("figure-5", "Figure 5", drawn)]))
    row = Row2("Screen 1", (), 0.5, 1.43, None, None, None, sample_hold_rms_ms=0.81)  # type: ignore[arg-type]
    text = write.write_reproduction(Reproduction((row,), (), {}, 3), tmp_path).read_text("utf-8")
    assert "SIMULATED" in text.split("<table>")[0]
    assert "not the paper" in text
    assert "Figure 5 (SIMULATED)" in text
    across, foot = sorted((text.get_text() for text in drawn.texts), key=len)
    assert across == "SIMULATED"
    assert foot.startswith("SIMULATED · Screens 1 and 2 of the paper, seed 3 · draglag ")
    assert (tmp_path / "figures" / "figure-5.png").is_file()
    assert "Screen 1 0.50 ms here, 0.81 ms held, 1.43 ms in the paper" in text
    assert "The rest is not explained" in text


def test_no_further_seeds_no_count() -> None:
    assert further_seeds(range(4, 4)) is None
