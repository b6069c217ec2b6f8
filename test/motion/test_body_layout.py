"""The layout of a body, against its definition in NumPy for random chains of shapes."""

from __future__ import annotations

import numpy as np
import pytest

from collision_monitor.motion.bodies import Multibody, make_bodies, make_parts
from collision_monitor.motion.body_layout import lay_out_body, note_plain
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Capsule, Circle, Cone, Cylinder, Ellipsoid, Shape, Sphere
from collision_monitor.shapes.shape_table import ShapeTableBuilder

SHAPES = (Sphere(0.3), Box((0.2, 0.4, 0.6)), Capsule(0.1, 0.5), Cylinder(0.2, 0.7), Cone(0.3, 0.4))
SHAPES += (Ellipsoid((0.1, 0.2, 0.3)),)
OF_REVOLUTION = (Sphere, Circle, Capsule, Cylinder, Cone)
PLACES = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.4), (0.1, 0.0, 0.2), (0.0, -0.3, 0.0))
TURNS = ((0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.6, 0.8), (0.6, 0.0, 0.0, 0.8))


def laid_out(pieces: list[tuple[Shape, Pose]], padding: float = 0.0) -> tuple[Multibody, list[int]]:
    builder = ShapeTableBuilder(slots=8)
    builder.append(Box((1.0, 1.0, 1.0)), Pose())  # of no body
    slots = [builder.append(shape, pose, padding) for shape, pose in pieces]
    multibody = Multibody(builder.table, make_parts(8), make_bodies(2))
    lay_out_body(multibody, 1, slots, list(range(len(slots))))
    note_plain(multibody, np.array([1]))
    return multibody, slots


@pytest.mark.parametrize("seed", range(20))
def test_a_chain_of_shapes_is_laid_out_by_the_definition(seed: int) -> None:
    random = np.random.default_rng(seed)
    pieces = [
        (SHAPES[random.integers(len(SHAPES))], Pose(PLACES[random.integers(4)], TURNS[random.integers(4)]))
        for _ in range(random.integers(1, 5))
    ]
    (table, parts, bodies), slots = laid_out(pieces)
    assert bodies.first_shape[1] == slots[0]
    assert parts.next[slots].tolist() == [*slots[1:], -1]
    assert parts.index[slots].tolist() == list(range(len(slots)))
    is_placed = [bool(pose.position.any() or (pose.rotation != np.eye(3)).any()) for _, pose in pieces]
    assert parts.placed[slots].tolist() == is_placed
    radius = max(np.linalg.norm(pose.position) + table.radius[s] for (_, pose), s in zip(pieces, slots, strict=True))
    assert bodies.motion["radius"][1] == radius
    is_round = len(pieces) == 1 and isinstance(pieces[0][0], Sphere) and not pieces[0][1].position.any()
    assert bodies.spin_radius[1] == (0.0 if is_round else radius)
    assert bodies.revolved[1] == all(
        isinstance(shape, OF_REVOLUTION)
        and not pose.position[:2].any()
        and (isinstance(shape, Sphere) or abs(pose.rotation[2, 2]) == 1.0)
        for shape, pose in pieces
    )


@pytest.mark.parametrize(
    ("shape", "pose", "padding", "is_plain"),
    [
        (Sphere(0.3), Pose(), 0.0, True),
        (Sphere(0.3), Pose(), 0.1, True),  # a larger ball
        (Box((1.0, 2.0, 3.0)), Pose(), 0.0, True),
        (Box((1.0, 2.0, 3.0)), Pose(), 0.1, False),  # rounded
        (Box((1.0, 2.0, 3.0)), Pose((0.0, 0.0, 0.1)), 0.0, False),
        (Box((1.0, 2.0, 3.0)), Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.6, 0.8)), 0.0, False),
        (Cylinder(0.2, 0.7), Pose(), 0.0, False),
    ],
)
def test_single_balls_and_boxes_at_the_origin_are_plain(shape: Shape, pose: Pose, padding: float, is_plain) -> None:
    (table, _, bodies), slots = laid_out([(shape, pose)], padding)
    assert bodies.plain[1] == (table.kind[slots[0]] if is_plain else 0)
    two, _ = laid_out([(shape, pose), (shape, pose)], padding)
    assert two.bodies.plain[1] == 0
    bodies.excess[1] = 0.01  # a model that exceeds its object
    note_plain(Multibody(table, make_parts(8), bodies), np.array([1]))
    assert bodies.plain[1] == 0
