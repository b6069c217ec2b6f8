"""Tests that sphere trees contain their meshes, and that their intervals contain the narrow phase's distance."""

from __future__ import annotations

import numpy as np
import pytest
from solids import CONCAVE, CONVEX

import collision_monitor as cm
from collision_monitor.errors import InputError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.lecture.sphere_tree import distance_intervals, sphere_tree
from collision_monitor.geometry.point_triangle import closest_point_on_triangle
from collision_monitor.geometry.polyhedra import locate_in_polyhedron

ROCK = convex_hull(np.random.default_rng(5).normal(size=(30, 3)) * [1.0, 0.7, 0.4])
SOLIDS = {name: make() for name, make in {**CONVEX, **CONCAVE}.items()} | {"rock": (ROCK.vertices, ROCK.faces)}


def random_pose(rng, reach):
    q = rng.normal(size=4)
    return cm.Pose(rng.uniform(-reach, reach, 3), q / np.linalg.norm(q))


def to_surface(points, vertices, faces):
    return closest_point_on_triangle(points[:, None], *np.moveaxis(vertices[faces], 1, 0))[1].min(axis=1)


@pytest.mark.parametrize("name", SOLIDS)
def test_every_level_encloses_the_solid_and_its_balls_are_inside(name):
    vertices, faces = SOLIDS[name]
    tree = sphere_tree(vertices, faces, depth=3)
    assert len(tree) == 4
    rng = np.random.default_rng(1)
    points = rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (400, 3))
    solid = np.vstack([points[locate_in_polyhedron(points, vertices, faces) >= 0], vertices[np.unique(faces)]])
    size = np.ptp(vertices, axis=0).max()
    for k, level in enumerate(tree):
        apart = np.linalg.norm(solid[:, None] - level.center, axis=-1) - level.radius
        assert (apart.min(axis=1) <= 0.0).all()
        balls = level.inner_radius > 0.0
        center, radius = level.inner_center[balls], level.inner_radius[balls]
        assert (locate_in_polyhedron(center, vertices, faces) == 1).all()
        depth = to_surface(center, vertices, faces)
        assert (radius <= depth).all()
        points = level.inner_center[~balls]
        if len(points):
            assert (to_surface(points, vertices, faces) <= 1e-12 * size).all()
        if k:
            # no sphere exceeds the solid by more than its width, and each has a parent in the level before
            outside = locate_in_polyhedron(level.center, vertices, faces) < 0
            stand_out = np.where(outside, to_surface(level.center, vertices, faces) + level.radius, 0.0)
            assert stand_out.max() <= 2.0 * np.sqrt(0.75) * 2.0**-k * size * (1 + 1e-9)
            assert (np.diff(level.parent) >= 0).all() and level.parent.max() < len(tree[k - 1].parent)


@pytest.mark.parametrize(
    "pair", [("rock", "rock"), ("cube", "octahedron"), ("ring", "U"), ("hollow", "bar")], ids="-".join
)
def test_intervals_hold_the_distance_and_close(pair):
    rng = np.random.default_rng(2)
    meshes = [SOLIDS[name] for name in pair]
    (a, b), (tree_a, tree_b) = (cm.Mesh(*mesh) for mesh in meshes), (sphere_tree(*mesh, depth=4) for mesh in meshes)
    apart = 0
    for _ in range(6):
        X, Y = random_pose(rng, 1.0), random_pose(rng, 5.0)
        found = cm.contact(a, X, b, Y)
        low, high = found.signed_distance - found.error_bound, found.signed_distance + found.error_bound
        intervals = list(distance_intervals(tree_a, X, tree_b, Y))
        for before, interval in zip([None, *intervals], intervals, strict=False):
            assert interval.lower <= high and low <= interval.upper
            assert before is None or (before.lower <= interval.lower and interval.upper <= before.upper)
        if found.signed_distance > 1.0:
            assert intervals[-1].lower > 0.0  # the tree resolves the gap
            width = 2 * np.sqrt(0.75) * 2.0**-4 * sum(np.ptp(v, axis=0).max() for v, _ in meshes)
            assert intervals[-1].upper - intervals[-1].lower <= 1.5 * width
            apart += 1
        swapped = list(distance_intervals(tree_b, Y, tree_a, X))
        np.testing.assert_allclose(swapped, intervals, atol=1e-12)
    assert apart >= 2


def test_a_solid_within_a_solid_is_found_and_one_in_its_hollow_is_not():
    hollow = sphere_tree(*SOLIDS["hollow"])
    cube = sphere_tree(SOLIDS["cube"][0] * 0.25, SOLIDS["cube"][1])
    *_, inside = distance_intervals(hollow, cm.Pose(), cube, cm.Pose((0.3, 0.3, 0.3)))
    assert inside.upper < 0.0
    *_, within = distance_intervals(hollow, cm.Pose(), cube, cm.Pose((1.375, 1.375, 1.375)))
    assert 0.0 < within.lower <= 0.375 <= within.upper


def test_a_surface_has_no_inside():
    vertices, faces = SOLIDS["cube"]
    box = sphere_tree(vertices, faces[1:], depth=4)
    assert not any(level.inner_radius.any() for level in box)
    small = sphere_tree(vertices * 0.1, faces, depth=3)
    *_, last = distance_intervals(box, cm.Pose(), small, cm.Pose((0.45, 0.45, 0.45)))
    assert 0.0 < last.lower <= 0.45 <= last.upper


def test_the_same_far_from_the_origin_and_at_every_scale():
    vertices, faces = SOLIDS["rock"]
    Y = cm.Pose((3.0, 1.0, 0.5))
    tree = sphere_tree(vertices, faces, depth=3)
    near = list(distance_intervals(tree, cm.Pose(), tree, Y))
    far = cm.Pose((2.0**20, 0, 0))
    moved = distance_intervals(tree, far, tree, far @ Y)
    np.testing.assert_allclose(list(moved), near, atol=1e-9)
    for scale in (2.0**-30, 2.0**30):
        tree = sphere_tree(vertices * scale, faces, depth=3)
        scaled = list(distance_intervals(tree, cm.Pose(), tree, cm.Pose(Y.position * scale)))
        np.testing.assert_allclose(np.array(scaled) / scale, near, rtol=1e-12)


def test_bad_depths_are_refused():
    with pytest.raises(InputError, match="depth from 0 to 8, got 9"):
        sphere_tree(*SOLIDS["cube"], depth=9)
