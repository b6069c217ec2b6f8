"""The catalogue: the changes that a message requests, and the known facts of the objects afterwards."""

from __future__ import annotations

import json

import numpy as np
import pytest

from collision_monitor.codec import Change, ObjectDescriptionArray, Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.catalogue import Catalogue
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Sphere


def ball(object_id: int, name: str = "", *, static: bool = False) -> ObjectDescription:
    return ObjectDescription(object_id, Sphere(0.5), name=name, static=static, pose=Pose() if static else None)


def message(*objects: Change, snapshot: bool = False, refused: tuple[int, ...] = ()) -> ObjectDescriptionArray:
    return ObjectDescriptionArray(0, "world", snapshot, objects, tuple((each, "why") for each in refused))


def filled(*objects: ObjectDescription) -> Catalogue:
    catalogue = Catalogue()
    for each in objects:
        catalogue.apply(each)
    return catalogue


def names(catalogue: Catalogue, *ids: int) -> list[str]:
    return catalogue.names(np.array(ids, np.uint32))


def test_a_message_asks_for_what_is_in_it() -> None:
    catalogue = filled(ball(1), ball(2))
    asked = [ball(3), Removal(1)]
    assert catalogue.changes(message(*asked)) == asked


def test_a_snapshot_asks_first_for_the_removal_of_what_it_does_not_mention() -> None:
    catalogue = filled(ball(7), ball(2), ball(5), ball(3))
    two = ball(2)
    assert catalogue.changes(message(two, snapshot=True, refused=(3,))) == [Removal(5), Removal(7), two]


def test_a_snapshot_removes_nothing_twice() -> None:
    catalogue = filled(ball(1))
    catalogue.apply(Removal(1))
    assert catalogue.changes(message(snapshot=True)) == []


def test_a_removed_object_has_its_name_until_the_step_is_over() -> None:
    catalogue = filled(ball(1, "a"), ball(2, "b", static=True))
    catalogue.end_step()
    catalogue.apply(Removal(2))
    assert (list(catalogue.descriptions), catalogue.static) == ([1], set())
    assert names(catalogue, 1, 2) == ["a", "b"]
    catalogue.end_step()
    with pytest.raises(KeyError):
        names(catalogue, 2)


def test_an_object_that_no_step_knew_leaves_no_name() -> None:
    catalogue = filled(ball(1, "a"))
    catalogue.apply(Removal(1))
    assert catalogue.facts() == {"static": [], "planar": False, "names": {}, "removed": [], "new": []}
    assert catalogue.changes(message(snapshot=True)) == []


def test_an_object_that_is_removed_and_described_again_keeps_a_name_for_the_end_of_its_contacts() -> None:
    catalogue = filled(ball(1, "a"))
    catalogue.end_step()
    for change in (Removal(1), ball(1, "b"), Removal(1)):
        catalogue.apply(change)
    assert names(catalogue, 1) == ["b"]


def test_an_object_that_is_described_again_keeps_its_place_and_takes_what_is_new() -> None:
    catalogue = filled(ball(1, "a", static=True), ball(2))
    again = ball(1, "c")
    catalogue.apply(again)
    assert list(catalogue.descriptions) == [1, 2]
    assert catalogue.descriptions[1] is again
    assert (catalogue.static, names(catalogue, 1)) == (set(), ["c"])


def test_it_is_restored_from_its_facts_without_descriptions() -> None:
    catalogue = filled(ball(1, "a", static=True), ball(2, "b"), ball(3, "c"))
    catalogue.end_step()
    catalogue.apply(Removal(3))
    catalogue.apply(ball(4, "d"))
    restored = Catalogue.restored(json.loads(json.dumps(catalogue.facts())))
    assert (
        restored.facts()
        == catalogue.facts()
        == {
            "static": [1],
            "planar": False,
            "names": {"1": "a", "2": "b", "3": "c", "4": "d"},
            "removed": [3],
            "new": [4],
        }
    )
    assert restored.descriptions == {}
    assert restored.changes(message(ball(2), snapshot=True))[0] == Removal(1)
