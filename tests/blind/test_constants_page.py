"""Every constant of the gap stands in one table, with its meaning and its origin."""

import json
import re

import pytest

from blind.ablation import constants_of
from blind.constants_page import PAGE, constants_in, page, written


@pytest.fixture(scope="module")
def constants():
    return constants_in()


def test_the_page_says_what_the_modules_say():
    assert PAGE.read_text() == written(), "run python -m tests.blind.constants_page"


def test_every_row_has_four_cells():
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("|")]
    assert len(rows) > 100
    assert {len(re.split(r"(?<!\\)\|", row)) for row in rows} == {6}


def test_every_constant_states_meaning_and_origin(constants):
    assert [one.keys for one in constants if not one.origin] == []


def test_numbers_of_the_running_package_are_on_the_page(constants):
    listed = {key: value for one in constants for key, value in zip(one.keys, one.values, strict=True)}
    for one in constants_of():
        key = f"{one.module.removeprefix('draglag.gap.')}.{one.name}"
        assert key in listed
        assert listed[key] in (one.value, None), key  # None: computed where it is defined


def test_comments_behind_above_and_below_are_read(tmp_path):
    (tmp_path / "rooms").mkdir()
    (tmp_path / "rooms" / "light.py").write_text(
        "# Both of a lamp. Physical.\n"
        "WIDE_MM = 3.0\n"
        "HIGH_MM = 4.0  # over the table. Derived\n"
        "\n"
        "A, B = 1, 2\n"
        "WORDS = ('x',)\n"
        "P = 0.5\n"
        '"""Prior. Judgement:\nno more."""\n'
        'BY_NAME = {"x  # y": 1}  # underived. Calibrated  # fmt: skip\n'
        "GRID = (\n    1,  # first\n    2,\n)  # noqa: X1\n"
        "Q = 1  # fmt: skip\n"
    )
    found = {one.names: (one.value, one.values, one.meaning, one.origin) for one in constants_in(tmp_path)}
    assert found == {
        ("WIDE_MM",): ("3.0", (3.0,), "Both of a lamp. Physical.", "physical"),
        ("HIGH_MM",): ("4.0", (4.0,), "over the table. Derived", "derived"),
        ("A", "B"): ("(1, 2)", (1, 2), "", ""),
        ("P",): ("0.5", (0.5,), "Prior. Judgement: no more.", "judgement"),
        ("BY_NAME",): ("{'x # y': 1}", (None,), "underived. Calibrated", "calibrated"),
        ("GRID",): ("(1, 2)", (None,), "first", ""),
        ("Q",): ("1", (1,), "", ""),
    }


def test_what_another_value_changes_is_shown_for_the_value_that_it_was_tried_from(tmp_path):
    (tmp_path / "one.py").write_text("STEPS, TRIED = 4, 2  # of it. Derived\n")
    usual = {"constant": "one.TRIED", "usual": 2, "failed": "", "answers_changed": [], "gap_ratio": 1.0}
    lines = [
        {**usual, "value": 1, "gap_ratio": 1.25, "sizes_moved": 0.3},
        {**usual, "value": 6, "answers_changed": ["a"], "sizes_moved": 0.0},
        {**usual, "value": 9, "usual": 3, "sizes_moved": 0.9},  # it was three then
    ]
    text = page(constants_in(tmp_path), map(json.dumps, lines))
    assert text.splitlines()[-1].endswith("| 1 other answer; gap × 1.25, sizes by 0.3 |")
