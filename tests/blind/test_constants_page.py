"""Every constant of the gap stands in one table, with its meaning and its origin."""

import pytest

from blind.ablation import constants_of
from blind.constants_page import PAGE, constants_in, effects_of, effects_on, page


@pytest.fixture(scope="module")
def constants():
    return constants_in()


def test_the_page_says_what_the_modules_say(constants):
    text = PAGE.read_text()
    assert page(constants, effects_on(text, constants)) == text, "run python -m tests.blind.constants_page"


def test_every_constant_states_meaning_and_origin(constants):
    assert [one.keys for one in constants if not one.origin] == []


def test_numbers_of_the_running_package_are_on_the_page(constants):
    listed = {key for one in constants for key in one.keys}
    assert {f"{c.module.removeprefix('draglag.gap.')}.{c.name}" for c in constants_of()} <= listed


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
    )
    found = {one.names: (one.module, one.value, one.meaning, one.origin) for one in constants_in(tmp_path)}
    assert found == {
        ("WIDE_MM",): ("rooms.light", "3.0", "Both of a lamp. Physical.", "physical"),
        ("HIGH_MM",): ("rooms.light", "4.0", "over the table. Derived", "derived"),
        ("A", "B"): ("rooms.light", "1, 2", "", ""),
        ("P",): ("rooms.light", "0.5", "Prior. Judgement: no more.", "judgement"),
    }


def test_what_the_ablation_found_is_kept_when_the_page_is_written_again(constants):
    line = (
        '{"constant": "constants.P_EFFECT", "value": 0.06, "failed": "", "answers_changed": ["a"], '
        '"gap_ratio": 1.0, "sizes_moved": 0.0}'
    )
    other = line.replace("0.06", "0.0067").replace('["a"]', "[]").replace("1.0", "1.25")
    effects = effects_of([line, other])
    assert effects == {"constants.P_EFFECT": "1 other answer; gap × 1.25"}
    assert effects_on(page(constants, effects), constants) == effects
