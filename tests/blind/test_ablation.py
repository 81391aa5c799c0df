"""A constant is changed wherever it is used, and only that one."""

import pytest

from blind.ablation import changed, constants_of, other_values


@pytest.fixture(scope="module")
def constants():
    return {(each.module, each.name): each for each in constants_of()}


def test_a_constant_changes_where_it_is_imported_and_comes_back(constants):
    from draglag.gap import check
    from draglag.gap import constants as table

    usual = table.SIZE_OF_INTEREST_MM
    with changed(constants["draglag.gap.constants", "SIZE_OF_INTEREST_MM"], 3 * usual):
        assert check.SIZE_OF_INTEREST_MM == table.SIZE_OF_INTEREST_MM == 3 * usual
    assert check.SIZE_OF_INTEREST_MM == table.SIZE_OF_INTEREST_MM == usual


def test_a_constant_of_the_same_name_elsewhere_stays(constants):
    from draglag.gap import by_taps
    from draglag.gap.streams import evidence

    elsewhere = vars(evidence)
    usual = elsewhere["FEWEST"]
    with changed(constants["draglag.gap.by_taps", "FEWEST"], 99):
        assert by_taps.FEWEST == 99
        assert elsewhere["FEWEST"] == usual


@pytest.mark.parametrize(
    ("value", "others"), [(0.02, [0.02 / 3, 0.06]), (0.5, [0.5 / 3, 1 - 0.5 / 3]), (4, [1, 12]), (1, [3])]
)
def test_other_values_are_possible_ones(value, others):
    assert other_values(value) == pytest.approx(others)


def test_the_second_of_two_names_is_a_constant_too(constants):
    assert constants["draglag.gap.fitting.descent", "ATTEMPTS"].value == 4
