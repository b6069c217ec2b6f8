"""Tests of ObjectDescription: defaults and refused values."""

import math

import pytest

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.description import ALL_GROUPS, ObjectDescription
from collision_monitor.records import Model
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere


def test_a_single_shape_becomes_one_pair_at_the_origin():
    ((shape, pose),) = ObjectDescription(1, Sphere(0.5)).shapes
    assert shape == Sphere(0.5)
    assert pose.position.tolist() == [0, 0, 0]


def test_a_compound_keeps_its_order():
    parts = [(Box((1, 1, 1)), Pose()), (Sphere(0.2), Pose((0, 0, 1)))]
    assert [shape for shape, _ in ObjectDescription(1, parts).shapes] == [Box((1, 1, 1)), Sphere(0.2)]


def test_what_the_message_may_leave_out_is_filled_in():
    made = ObjectDescription(7, Sphere(1), group=0, mask=0, max_linear_acceleration=math.nan, model=3)
    assert (made.name, made.group, made.mask, made.max_linear_acceleration) == ("object_7", 1, ALL_GROUPS, 0.0)
    assert made.model is Model.AABB
    assert ObjectDescription(7, Sphere(1), model="aabb").model is Model.AABB  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"object_id": -1}, "object id"),
        ({"object_id": 2**32}, "object id"),
        ({"object_id": 1.5}, "object id"),
        ({"object_id": True}, "object id"),
        ({"static": True}, "needs the pose"),
        ({"name": "x" * 257}, "name: expected at most 256 bytes of UTF-8, got 257 bytes: 'xxxx"),
        ({"name": "ü" * 129}, "got 258 bytes"),
        ({"name": "a\0b"}, "without zero bytes, got 'a.x00b'"),
        ({"name": "\ud800"}, "UTF-8 can hold"),
        ({"pose": (0, 0)}, "expected a Pose"),
        ({"padding": -0.1}, "padding"),
        ({"padding": math.nan}, "padding"),
        ({"padding": "wide"}, "padding"),
        ({"group": 2**32}, "group"),
        ({"mask": -1}, "mask"),
        ({"model": 99}, "KDOP26"),
        ({"model": "cube"}, "OBB .*, got 'cube'"),
        ({"allowed": (1, -2)}, "allowed"),
        ({"max_linear_acceleration": -1.0}, "max_linear_acceleration"),
        ({"max_angular_acceleration": math.inf}, "max_angular_acceleration"),
    ],
)
def test_bad_fields_are_refused_with_their_name(arguments, text):
    with pytest.raises(InputError, match=text):
        ObjectDescription(**{"object_id": 1, "shapes": Sphere(1), **arguments})


@pytest.mark.parametrize("shapes", [[], [Sphere(1)], [(Sphere(1), None)], [(Pose(), Sphere(1))], None, "box", 3])
def test_bad_shapes_are_refused(shapes):
    with pytest.raises(ShapeError, match="expected"):
        ObjectDescription(1, shapes)


@pytest.mark.parametrize("name", ["x" * 256, "ü" * 128, "\U0001f916" * 64])
def test_a_name_may_have_256_bytes(name):
    assert ObjectDescription(1, Sphere(1), name=name).name == name


def test_a_monitor_refuses_a_long_name_and_stays_as_it_was():
    monitor = Monitor()
    with pytest.raises(InputError, match="object 3, name: expected at most 256 bytes"):
        monitor.add(3, Sphere(1), name="x" * 1000)
    assert monitor.ids == []
