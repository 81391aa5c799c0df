"""Coverage of the paper's values by Table 2's intervals over many seeds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

from draglag.reproduction.curves import Coefficient, measured_row
from draglag.reproduction.published import TABLE_2

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class Tally:
    """Intervals that hold the paper's value, of ``judged`` seeds that determine it."""

    screen: str
    name: str
    covered: int
    judged: int


@dataclass(frozen=True)
class FurtherSeeds:
    seeds: tuple[int, ...]
    tallies: tuple[Tally, ...]

    @property
    def covered(self) -> int:
        return sum(tally.covered for tally in self.tallies)

    @property
    def judged(self) -> int:
        return sum(tally.judged for tally in self.tallies)

    @property
    def share_ci95(self) -> tuple[float, float] | None:
        """Binomial 95 % interval of the share that holds (Clopper–Pearson)."""
        if not self.judged:
            return None
        interval = binomtest(self.covered, self.judged).proportion_ci()
        return float(interval.low), float(interval.high)

    def to_dict(self) -> dict[str, object]:
        return {
            "seeds": list(self.seeds),
            "held": self.covered,
            "judged": self.judged,
            "share": self.covered / self.judged if self.judged else None,
            "share_ci95": None if self.share_ci95 is None else list(self.share_ci95),
            "coefficients": [
                {
                    "screen": tally.screen,
                    "name": tally.name,
                    "held": tally.covered,
                    "judged": tally.judged,
                }
                for tally in self.tallies
            ],
        }


def further_seeds(seeds: Sequence[int], progress: Progress | None = None) -> FurtherSeeds | None:
    """Tallies over the seeds, half a second a row."""
    if not seeds:
        return None
    on_progress = progress or (lambda fraction, text: None)
    found: dict[tuple[str, str], list[Coefficient]] = {}
    done = 0
    for seed in seeds:
        for screen in TABLE_2:
            on_progress(done / (len(seeds) * len(TABLE_2)), f"{screen}: further seed {seed}")
            for coefficient in measured_row(screen, seed).coefficients:
                found.setdefault((screen, coefficient.name), []).append(coefficient)
            done += 1
    return FurtherSeeds(tuple(seeds), tuple(_tally(*key, several) for key, several in found.items()))


def _tally(screen: str, name: str, several: Sequence[Coefficient]) -> Tally:
    judged = [c for c in several if c.ci95 is not None]
    return Tally(screen, name, sum(c.agrees is True for c in judged), len(judged))


def table_further(found: FurtherSeeds) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the tallies."""
    rows = [
        [tally.screen, tally.name, f"{tally.covered} of {tally.judged}", str(len(found.seeds) - tally.judged)]
        for tally in found.tallies
    ]
    rows.append(["all", "", f"{found.covered} of {found.judged}", str(len(found.seeds) * len(rows) - found.judged)])
    return ["screen", "coefficient", "95 % interval holds the paper's", "not determined"], rows


def further_words(found: FurtherSeeds) -> Iterator[str]:
    """The count in sentences."""
    if found.share_ci95 is None:
        return
    low, high = found.share_ci95
    yield (
        f"Table 2 measured again with {len(found.seeds)} further seeds ({found.seeds[0]} to {found.seeds[-1]}): "
        f"{found.covered} of {found.judged} intervals that the data determine hold the paper's value, "
        f"{100 * found.covered / found.judged:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f} %, counting those of "
        "one session as independent, which they are not quite); 95 % is what they promise."
    )
    for tally in found.tallies:
        rare = tally.judged > 0 and binomtest(tally.covered, tally.judged, 0.95, "less").pvalue < 0.05
        if rare:
            yield f"{tally.screen} {tally.name}: {tally.covered} of {tally.judged} hold, fewer than chance leaves."
