"""What is said of explanations that share the probability."""

from __future__ import annotations

from typing import Any, cast

import pytest

from draglag.gap.posterior import answer
from draglag.gap.posterior.pool import Names, Pool
from draglag.gap.wording import also_possible


class Compared:
    """A pool of explanations whose probabilities are given; each member moves edges by 0.3 mm."""

    def __init__(self, probabilities: dict[Names, float]) -> None:
        self.given = dict(sorted(probabilities.items(), key=lambda item: -item[1]))

    def probabilities(self) -> dict[Names, float]:
        return self.given

    def probability_of(self, name: str) -> float:
        return sum(p for names, p in self.given.items() if name in names)

    @property
    def best(self) -> Names:
        return next(iter(self.given))


@pytest.fixture(autouse=True)
def _sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answer, "_sizes", lambda pool, names: dict.fromkeys(names, 0.3))
    monkeypatch.setattr(answer, "unsound_share", lambda pool, names: 0.0)


def said(probabilities: dict[Names, float]) -> Any:
    return answer.answer_of(cast(Pool, Compared(probabilities)))


def test_two_that_take_each_others_place_outweigh_nothing() -> None:
    found = said({(): 0.38, ("beam_bow",): 0.36, ("spatial_warp",): 0.26})
    assert found.effects == ("beam_bow",)
    assert found.probability == 0.36
    assert found.explanations == ((("beam_bow",), 0.36), ((), 0.38), (("spatial_warp",), 0.26))
    # In words the second name stands with the first, and nothing is what may be instead.
    assert also_possible(found.explanations, [("beam_bow", "spatial_warp")]) == [((), 0.38)]


def test_nothing_is_the_answer_where_it_is_more_probable_than_all_else() -> None:
    assert said({(): 0.52, ("beam_bow",): 0.3, ("spatial_warp",): 0.18}).effects == ()


def test_what_has_no_name_outweighs_nothing_too() -> None:
    found = said({(): 0.4, ("?x:latency",): 0.25, ("?y:offset",): 0.2, ("beam_bow",): 0.15})
    assert (found.effects, found.unexplained_by, found.probability) == ((), "x", 0.45)


def test_the_curves_own_form_is_nothing() -> None:
    found = said({("law_form",): 0.3, (): 0.25, ("beam_bow",): 0.45})
    assert (found.effects, found.unexplained_by) == ((), None)


@pytest.mark.parametrize(("other_mm", "unexplained_by"), [(0.3, None), (0.5, "acceleration")])
def test_what_has_no_name_and_an_effect_s_own_uncertainty_covers_is_no_gap(
    monkeypatch: pytest.MonkeyPatch, other_mm: float, unexplained_by: str | None
) -> None:
    """A lag's acceleration is known to 20 %: 0.39 mm of 1 mm, at 95 %."""
    sizes_mm = {"acceleration_lag": 1.0, "?acceleration:latency": other_mm}
    monkeypatch.setattr(answer, "_sizes", lambda pool, names: {name: sizes_mm[name] for name in names})
    assert said({tuple(sizes_mm): 1.0}).unexplained_by == unexplained_by
