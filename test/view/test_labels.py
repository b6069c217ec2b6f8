"""The labels in the scene keep their pairs, and none covers another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor.view.labels import Label, _joined, labels
from collision_monitor.view.levels import Level
from collision_monitor.view.pair_list import PairRow
from collision_monitor.view.topic_content import TopicContent


def row(a: int, b: int, when: str, *place: float) -> PairRow:
    return PairRow((a, b), (f"robot {a}", f"wall {b}"), when, Level.PREDICTED, np.array(place) if place else None)


def test_a_label_keeps_its_key_while_its_text_and_rank_change() -> None:
    moment, zero = TopicContent().moment(), np.zeros(3)
    before = labels(moment, [row(1, 2, "0.5 s", 1, 2, 3), row(3, 4, "0.6 s", 50, 0, 0)], None, zero, 10.0, 1.0)
    after = labels(moment, [row(3, 4, "0.1 s", 50, 0, 0), row(1, 2, "0.4 s", 1, 2, 3)], None, zero, 10.0, 1.0)
    assert [each.key for each in before] == ["1_2", "3_4"]
    assert [each.key for each in after] == ["3_4", "1_2"]
    assert [each.text for each in after] == ["0.1 s  robot 3 – wall 4", "0.4 s  robot 1 – wall 2"]
    assert after[1].place.tolist() == [1, 2, 3]


@pytest.mark.parametrize("when", ["now", "≥ 0.25 s, unresolved, stale"])
def test_a_row_of_the_list_shows_the_beginnings_and_ends_of_both_names(when: str) -> None:
    """The panel cut the second name off where the first one or the time was long."""
    names = "hall_2/robot_with_a_trailer_17", "cart_3"
    for first, second in (names, names[::-1]):
        text = PairRow((1, 2), (first, second), when, Level.PREDICTED, None).text
        assert len(text) <= 48
        assert "cart_3" in text
        long = text.removeprefix(when).strip().split(" – ")[first == "cart_3"]
        assert long.startswith("hall") and long.endswith("17")


def test_a_pair_without_a_place_has_no_label() -> None:
    assert labels(TopicContent().moment(), [row(1, 2, "now")], None, np.zeros(3), 10.0, 1.0) == []


@given(st.lists(st.tuples(*[st.floats(-10, 10)] * 3), max_size=6), st.floats(0.1, 5.0))
def test_no_text_is_lost_and_no_two_labels_are_near(places: list[tuple[float, ...]], distance: float) -> None:
    given_labels = [Label(str(k), f"text {k}", np.array(each, np.float32)) for k, each in enumerate(places)]
    found = _joined(given_labels, distance)
    shown = [text for each in found for text in each.text.split("\n")]
    assert sorted(shown) == sorted(each.text for each in given_labels)
    for k, each in enumerate(found):
        for other in found[:k]:
            assert np.linalg.norm(each.place - other.place) == pytest.approx(distance) or (
                np.linalg.norm(each.place - other.place) > distance
            )
