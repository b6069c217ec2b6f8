"""First impacts of turning meshes against samples of the motion, and meshes that are hard to search."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import collision_monitor as cm
from collision_monitor import Motion, Pose
from collision_monitor.world.arm import lathe

TORUS = trimesh.creation.torus(1.0, 0.4, major_sections=12, minor_sections=8)
RNG = np.random.default_rng(3)
SOUP = RNG.normal(size=(60, 1, 3)) * 0.5 + 0.15 * RNG.normal(size=(60, 3, 3))
MESHES = {
    "torus": cm.Mesh(TORUS.vertices, TORUS.faces),
    "link": lathe([(0.3, -1.0), (0.3, -0.6), (0.15, -0.5), (0.15, 0.5), (0.3, 0.6), (0.3, 1.0)], 10),
    "half": cm.Mesh(TORUS.vertices, TORUS.faces[TORUS.triangles_center[:, 0] > 0]),
    "soup": cm.Mesh(SOUP.reshape(-1, 3), np.arange(180).reshape(-1, 3)),
}
OTHERS = {
    **MESHES,
    "box": cm.Box((0.5, 0.3, 0.8)),
    "capsule": cm.Capsule(0.2, 0.6),
    "cylinder": cm.Cylinder(0.3, 0.6),
    "cone": cm.Cone(0.3, 0.7),
    "ellipsoid": cm.Ellipsoid((0.2, 0.3, 0.5)),
}


def turning_pair(rng):
    p = rng.normal(size=3)
    p *= rng.uniform(2.5, 4.0) / np.linalg.norm(p)
    q = Rotation.random(2, rng=rng).as_quat()
    b = Motion(Pose(p, q[1]), rng.normal(size=3) - p, 2 * rng.normal(size=3), rng.normal(size=3))
    return Motion(Pose((0, 0, 0), q[0]), (0, 0, 0), 2 * rng.normal(size=3)), b


@pytest.mark.parametrize("other", OTHERS)
@pytest.mark.parametrize("mesh", MESHES)
def test_turning_meshes_are_apart_before_the_impact_and_overlap_after_it(mesh, other):
    rng = np.random.default_rng(len(mesh) + 7 * len(other))
    statuses = set()
    for _ in range(12):
        a, b = turning_pair(rng)
        found = cm.time_of_impact(MESHES[mesh], a, OTHERS[other], b)
        statuses.add(found.status)
        until = min(found.lower, 2.0)
        times = np.linspace(0.0, until * (1 - 1e-9), 30) if until > 0.0 else ()
        assert not any(cm.overlap(MESHES[mesh], a.at(t), OTHERS[other], b.at(t)) for t in times)
        if found.status == "hit":
            assert cm.overlap(MESHES[mesh], a.at(found.upper), OTHERS[other], b.at(found.upper))
        swapped = cm.time_of_impact(OTHERS[other], b, MESHES[mesh], a)
        assert swapped.status == found.status
        if found.status != "clear":
            assert swapped.lower == pytest.approx(found.lower, abs=1e-5)
    assert "hit" in statuses


def test_a_mesh_beside_its_bodys_origin_meets_at_the_same_time():
    rng = np.random.default_rng(5)
    aside = np.array([0.7, -0.3, 0.4])
    moved = cm.Mesh(TORUS.vertices + aside, TORUS.faces)
    for _ in range(20):
        a, b = turning_pair(rng)
        whole = cm.time_of_impact(moved, a, MESHES["link"], b)
        part = cm.time_of_impact([(MESHES["torus"], Pose(aside))], a, MESHES["link"], b)
        assert part.status == whole.status
        if whole.status == "hit":
            assert part.lower == pytest.approx(whole.lower, abs=1e-5)


def test_a_separation_is_kept():
    a, b = Motion(Pose()), Motion(Pose((4, 0, 0)), (-1, 0, 0))
    found = cm.time_of_impact(MESHES["torus"], a, MESHES["torus"], b, separation=0.25)
    assert found.lower == pytest.approx(4 - 2.8 - 0.25, abs=1e-5) and found.upper >= found.lower


def test_triangles_in_one_place_end_within_their_bounds():
    """The boxes of very many equal triangles cannot tell which are nearest, so the search ends early."""
    corner = np.array([[0, 0, 0], [1e-9, 0, 0], [0, 1e-9, 0]])
    many = cm.Mesh(corner, np.tile([[0, 1, 2]], (12_000, 1)))
    c = cm.contact(many, Pose(), many, Pose((1, 0, 0)))
    assert abs(c.signed_distance - (1.0 - 1e-9)) <= c.error_bound <= 1e-8
    i = cm.time_of_impact(many, Motion(Pose(), angular=(1, 0, 0)), many, Motion(Pose((1, 0, 0)), (-1, 0, 0)))
    assert i.status != "clear" and i.lower == pytest.approx(1.0, abs=1e-5)


def test_meshes_that_coincide_are_not_clear():
    ring = trimesh.creation.torus(1.0, 0.4, major_sections=32, minor_sections=32)
    mesh = cm.Mesh(ring.vertices, ring.faces)
    assert cm.overlap(mesh, Pose(), mesh, Pose())
    found = cm.time_of_impact(mesh, Motion(Pose()), mesh, Motion(Pose()))
    assert found.status != "clear" and found.lower == 0.0


def test_the_bound_of_an_open_mesh_is_that_of_all_solids_it_may_belong_to():
    half, box = MESHES["half"], OTHERS["box"]
    c = cm.contact(half, Pose(), box, Pose((-0.1, 0, 0)))
    assert c.signed_distance > 0.3 and c.signed_distance - c.error_bound <= 0.0  # a solid may be between both ends
    far = cm.contact(half, Pose(), box, Pose((3.0, 0, 0)))
    assert far.signed_distance - far.error_bound > 1.0
