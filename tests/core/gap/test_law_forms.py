"""Explanations are compared under the form of the curve that they end with."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from draglag.gap.fitting.law_form import LAW_FORM
from draglag.gap.posterior import judge

PLAIN, OWN = SimpleNamespace(form="Eq. 5"), SimpleNamespace(form="own")


def pool(own_form: bool) -> SimpleNamespace:
    return SimpleNamespace(best=(), probability_of=lambda name: 0.9 if own_form and name == LAW_FORM else 0.1)


@pytest.mark.parametrize(
    ("at_first", "after_plain", "after_own", "wanted", "searches"),
    [
        (False, False, True, "Eq. 5", ["Eq. 5"]),
        (False, True, True, "own", ["Eq. 5", "own"]),
        (False, True, False, "Eq. 5", ["Eq. 5", "own"]),
        (True, False, True, "own", ["own"]),
        (True, False, False, "Eq. 5", ["own", "Eq. 5"]),
    ],
)
def test_the_form_of_the_curve_is_that_which_the_search_ends_with(
    at_first: bool,
    after_plain: bool,
    after_own: bool,
    wanted: str,
    searches: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An effect may hide that the curve is another one, as it may make it look like one. In doubt it is Eq. 5."""
    done: list[str] = []

    def explored(session: object, fits: dict[tuple[str, ...], SimpleNamespace], *_: object, **__: object) -> object:
        form = fits[()].form
        done.append(form)
        return SimpleNamespace(pool=pool(after_own if form == "own" else after_plain), fits=fits)

    monkeypatch.setattr(judge, "effects_in", lambda fit: ())
    monkeypatch.setattr(judge, "compared", lambda fits, **_: pool(at_first))
    monkeypatch.setattr(judge, "with_own_form", lambda session, first: OWN)
    monkeypatch.setattr(judge, "grown", lambda *_: {})
    monkeypatch.setattr(judge, "_explored", explored)
    found = judge.judged(None, PLAIN, (), False)  # type: ignore[arg-type]
    assert found.fits[()].form == wanted  # type: ignore[attr-defined]
    assert done == searches


@pytest.mark.parametrize(("alone", "on_the_first", "kept"), [(90, 100, 90), (80, 100, 100), (80, 80, None)])
def test_a_form_that_leaves_out_many_edges_is_fitted_to_those_of_the_first_fit(
    alone: int, on_the_first: int, kept: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = SimpleNamespace(
        law=None, runs=(), use=np.ones(100, bool), view=SimpleNamespace(speed=np.array([50.0, 500.0]))
    )

    def fitted(*given: object) -> SimpleNamespace:
        return SimpleNamespace(use=np.arange(100) < (alone if given[4] is None else on_the_first))

    monkeypatch.setattr(judge, "flexible", lambda law, knots: None)
    monkeypatch.setattr(judge, "fit_session", fitted)
    found = judge.with_own_form(None, first)  # type: ignore[arg-type]
    assert np.count_nonzero(found.use) == (kept or 100)
    assert (found is first) == (kept is None)
