"""Checks of numbers: what is in range comes back, everything else is refused with the range and what was there."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.checks.numbers import (
    MOST_WHOLE,
    as_numbers,
    checked_array,
    checked_number,
    checked_rows,
    checked_whole,
    checked_yaml_number,
)
from collision_monitor.errors import InputError, PoseError, ProfileError, ShapeError

NO_NUMBERS = [None, "soon", [], [1.0], {}, ..., 1j, "2", 10**400, "nan", math.nan, math.inf, -math.inf]


@given(st.floats(-100, 100), st.floats(-10, 0), st.floats(0, 10), st.booleans())
def test_a_number_is_returned_if_it_is_in_range_and_refused_otherwise(
    value: float, least: float, most: float, above: bool
) -> None:
    if least <= value <= most and not (above and value == least):
        assert checked_number(value, "it", least=least, most=most, above=above) == value
        return
    with pytest.raises(ShapeError, match=r"^it: expected a .*number of m") as caught:
        checked_number(value, "it", "m", least=least, most=most, above=above, error=ShapeError)
    assert f"got {value!r}" in str(caught.value) and f"{least:g}" in str(caught.value)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_what_is_no_finite_number_is_refused(value: Any) -> None:
    with pytest.raises(InputError, match=r"^step: expected a finite number, got "):
        checked_number(value, "step")


@pytest.mark.parametrize("value", [2, np.float32(2), np.int8(2), Fraction(2), np.array(2.0), True + 1])
def test_other_kinds_of_numbers_become_float(value: Any) -> None:
    number = checked_number(value, "it", least=0.0)
    assert type(number) is float and number == 2.0


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"least": 0.0}, "a finite number of s, at least 0"),
        ({"least": 0.0, "above": True}, "a finite number of s, above 0"),
        ({"least": 0.0, "most": 9.0, "above": True}, "a finite number of s, above 0 up to 9"),
        ({"least": 0.5, "most": 9.0}, "a number of s from 0.5 to 9"),
        ({}, "a finite number of s"),
    ],
)
def test_the_text_says_the_range(limits: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError) as caught:
        checked_number("x" * 1000, "horizon", "s", **limits)
    assert str(caught.value).startswith(f"horizon: expected {text}, got 'xxx") and len(str(caught.value)) < 200


@pytest.mark.parametrize("value", ["2", True, False, None, [], math.nan, 1e10, -1], ids=repr)
def test_a_file_holds_a_number_only_where_it_is_one(value: Any) -> None:
    assert checked_yaml_number(2, "it", "m") == 2.0
    with pytest.raises(ProfileError, match=r"^it: expected a number of m from 0 to 1e\+09, got "):
        checked_yaml_number(value, "it", "m", error=ProfileError)


@pytest.mark.parametrize("value", [np.float64(math.nan), np.float32(math.inf), np.int64(-1)])
def test_numbers_of_numpy_are_shown_as_numbers(value: Any) -> None:
    with pytest.raises(InputError, match=r"got (nan|inf|-1)$"):
        checked_number(value, "it", least=0.0)


def test_a_number_beyond_float64_is_infinite_without_a_warning(recwarn: pytest.WarningsRecorder) -> None:
    assert as_numbers([np.longdouble("1e4000"), 1], "it").tolist() in ([math.inf, 1.0], [1e308, 1.0])
    assert not recwarn.list


@pytest.mark.parametrize("value", [0, -1, 2.0, "2", None, math.nan], ids=repr)
def test_whole_numbers_begin_with_one(value: Any) -> None:
    assert (checked_whole(np.int16(3), "n"), checked_whole(10**30, "n")) == (3, MOST_WHOLE)
    with pytest.raises(InputError, match=r"^n: expected a whole number from 1, got "):
        checked_whole(value, "n")


MASKED = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
WITHOUT_A_VALUE = [
    *("here", [[1], [1, 2]], [10**400], [None, "x"], ...),
    *(np.array([np.complex64(1 + 2j), 2, 3], object), [np.timedelta64(1, "s")] * 3),
    *(np.array([np.timedelta64(1, "s")] * 3, object), np.array([1, 2, 3], "m8[s]"), np.array([1, 2, 3], "M8[s]")),
    *(MASKED, [MASKED, MASKED], [[MASKED, MASKED]], [list(MASKED)], [[[MASKED]]]),
]


@pytest.mark.parametrize("value", WITHOUT_A_VALUE, ids=repr)
def test_what_is_no_array_of_numbers_is_refused(value: Any) -> None:
    for check in (as_numbers, checked_array, lambda value, what: checked_rows(value, 3, what, 1.0)):
        with pytest.raises(InputError, match=r"^x: expected numbers"):
            check(value, "x")


@given(st.lists(st.floats(), max_size=6), st.floats(-5, 5))
def test_an_array_is_returned_if_all_numbers_are_finite_and_large_enough(values: list[float], least: float) -> None:
    if all(math.isfinite(x) and x >= least for x in values):
        assert checked_array(values, "x", least=least).tolist() == values
    else:
        with pytest.raises(InputError, match=r"^x: expected finite numbers >= "):
            checked_array(values, "x", least=least)


def test_rows_are_a_copy_of_the_right_width_with_numbers_up_to_the_largest() -> None:
    given = np.arange(6.0).reshape(2, 3)
    rows = checked_rows(given, 3, "x", 5.0)
    assert np.array_equal(rows, given) and not np.shares_memory(rows, given)
    assert checked_rows((1, 2, 3), 3, "x", 5.0).shape == (1, 3)
    with pytest.raises(InputError, match=r"^x: expected an array \(N, 2\), got shape \(2, 3\)"):
        checked_rows(given, 2, "x", 5.0)
    for bad in (5.1, math.nan, -math.inf):
        given[1, 1] = bad
        with pytest.raises(PoseError, match=r"^x: expected finite numbers up to 5, got others in row 1"):
            checked_rows(given, 3, "x", 5.0, PoseError)
