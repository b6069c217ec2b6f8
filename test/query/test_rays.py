"""`cast_ray` against samples of `contains`, trimesh and closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.geometry.polyhedra import edge_face

Array = NDArray[np.float64]
RNG = np.random.default_rng(7)
RING = trimesh.creation.torus(1.0, 0.3, major_sections=24, minor_sections=12)
L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
SOLIDS: dict[str, Any] = {
    "sphere": cm.Sphere(0.7),
    "box": cm.Box((1, 2, 0.5)),
    "capsule": cm.Capsule(0.4, 1.2),
    "cylinder": cm.Cylinder(0.6, 1.4),
    "cone": cm.Cone(0.7, 1.5),
    "hull": cm.ConvexHull(RNG.normal(size=(20, 3))),
    "mesh": cm.Mesh(RING.vertices, RING.faces),
    "half-space": cm.HalfSpace((1, 2, 3), 0.2),
    "compound": [(cm.Sphere(0.4), cm.Pose((1, 0, 0))), (cm.Box((1, 1, 1)), cm.Pose((-1, 0, 0)))],
}
FLAT: dict[str, Any] = {"circle": cm.Circle(0.8), "polygon": cm.Polygon(L_SHAPE)}
COUNT = 300


def random_pose(rng: np.random.Generator, flat: bool) -> cm.Pose:
    q = rng.normal(size=4)
    p = rng.normal(size=3)
    if flat:
        q[:2], p[2] = 0.0, 0.0
    return cm.Pose(p, q / np.linalg.norm(q))


def random_rays(rng: np.random.Generator, pose: cm.Pose, flat: bool) -> tuple[Array, Array]:
    p = pose.position + rng.normal(size=(COUNT, 3)) * 2
    d = pose.position + rng.normal(size=(COUNT, 3)) * 0.7 - p
    if flat:
        p[:, 2] = d[:, 2] = 0.0
    return p, d


@pytest.mark.parametrize("name", [*SOLIDS, *FLAT])
def test_a_hit_is_where_the_inside_begins(name: str) -> None:
    """Samples before the hit are outside, a point behind it is inside, and a ray without a hit has none inside."""
    rng, flat = np.random.default_rng(3), name in FLAT
    shape, pose = {**SOLIDS, **FLAT}[name], random_pose(np.random.default_rng(4), flat)
    p, d = random_rays(rng, pose, flat)
    hits = cm.cast_ray(shape, pose, p, d)
    assert hits.hit.mean() > 0.2
    unit = d / np.linalg.norm(d, axis=1, keepdims=True)
    started = cm.contains(shape, pose, p)
    assert (hits.distance[started] == 0.0).all()
    assert not hits.normal[started].any()
    far = np.where(hits.hit, hits.distance - 1e-9, 12.0)
    at = p[:, None] + unit[:, None] * (np.linspace(0, 1, 200) * far[:, None])[..., None]
    assert not cm.contains(shape, pose, at)[~started].any()
    entered = hits.hit & ~started
    head_on = entered & (np.abs((hits.normal * unit).sum(axis=1)) > 0.1)
    assert cm.contains(shape, pose, hits.point[head_on] + 1e-7 * unit[head_on]).all()
    assert ((hits.normal * unit).sum(axis=1)[entered] <= 0.0).all()
    assert np.linalg.norm(hits.normal[entered], axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("name", SOLIDS)
def test_the_normal_is_that_of_the_surface(name: str) -> None:
    """A tiny sphere outside of the hit point has a contact with that normal."""
    rng, pose = np.random.default_rng(5), random_pose(np.random.default_rng(6), False)
    p, d = random_rays(rng, pose, False)
    hits = cm.cast_ray(SOLIDS[name], pose, p, d)
    which = np.flatnonzero(hits.hit & (hits.distance > 0))[:15]
    assert len(which) > 10
    for k in which:
        ball = cm.contact(SOLIDS[name], pose, cm.Sphere(1e-4), cm.Pose(hits.point[k] + 2e-4 * hits.normal[k]))
        assert ball.normal == pytest.approx(hits.normal[k], abs=1e-2)
        assert ball.signed_distance == pytest.approx(1e-4, abs=1e-5)


def test_meshes_agree_with_the_exact_test_of_edges_and_faces() -> None:
    rng = np.random.default_rng(8)
    p = rng.normal(size=(200, 3))
    p *= rng.uniform(1.4, 4, (200, 1)) / np.linalg.norm(p, axis=1, keepdims=True)
    p[:, 2] += 0.5
    q = rng.normal(size=(200, 3)) - 2 * p
    corners = np.moveaxis(RING.vertices[RING.faces], 1, 0)
    t = np.nan_to_num(edge_face(p[:, None], q[:, None], *corners).t, nan=np.inf).min(axis=1)
    length = np.linalg.norm(q - p, axis=1)
    hits = cm.cast_ray(SOLIDS["mesh"], cm.Pose(), p, q - p, length)
    assert (hits.hit == np.isfinite(t)).all()
    assert hits.distance[hits.hit] == pytest.approx((t * length)[hits.hit], abs=1e-9)


def test_a_segment_ends_at_its_length() -> None:
    p, q = np.array([3.0, 0, 0]), np.array([1.0, 0, 0])
    short = cm.cast_ray(cm.Sphere(0.5), cm.Pose(), p, q - p, np.linalg.norm(q - p))
    assert not short.hit and np.isnan(short.point).all() and not short.normal.any()
    assert float(cm.cast_ray(cm.Sphere(1.0), cm.Pose(), p, q - p, 2.0).distance) == 2.0


def test_far_from_the_origin_a_ball_is_met_where_it_is() -> None:
    hit = cm.cast_ray(cm.Sphere(0.5), cm.Pose((1e9, 0, 0)), (1e9 - 1e3, 0.3, 0), (1, 0, 0))
    assert float(hit.distance) == pytest.approx(1e3 - 0.4, abs=1e-6)


def test_an_open_mesh_is_a_surface() -> None:
    sheet = cm.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    for height in (1.0, -1.0):
        hit = cm.cast_ray(sheet, cm.Pose(), (0.2, 0.2, height), (0, 0, -height))
        assert float(hit.distance) == 1.0
        assert hit.normal.tolist() == [0, 0, height]
    with pytest.raises(cm.UnsupportedError, match="closed"):
        cm.contains(sheet, cm.Pose(), (0.2, 0.2, 0.0))


@pytest.mark.parametrize("name", ["polygon", "box", "hull", "mesh"])
def test_the_tests_of_containment_agree(name: str) -> None:
    shape = {**SOLIDS, **FLAT}[name]
    points = np.random.default_rng(9).normal(size=(500, 3))
    expected = cm.contains(shape, cm.Pose(), points)
    assert 0 < expected.sum() < 500
    assert (cm.contains(shape, cm.Pose(), points, "ray") == expected).all()
    if name in ("box", "hull"):
        assert (cm.contains(shape, cm.Pose(), points, "sides") == expected).all()
    else:
        with pytest.raises(cm.UnsupportedError, match="test sides"):
            cm.contains(shape, cm.Pose(), points, "sides")


def test_the_boundary_belongs_to_the_shape() -> None:
    for shape in (cm.Box((2, 2, 2)), cm.Sphere(1), cm.Cylinder(1, 2), cm.HalfSpace((1, 0, 0), 1)):
        assert cm.contains(shape, cm.Pose(), [(1.0, 0, 0), (1.0 + 1e-15, 0, 0)]).tolist() == [True, False]
    assert cm.contains(cm.Polygon(L_SHAPE), cm.Pose(), [(1, 1), (1.5, 1), (1.5, 1.5)]).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda: cm.cast_ray(cm.Sphere(1), cm.Pose(), (0, 0, 5), (0, 0, 0)), cm.InputError, "direction"),
        (lambda: cm.cast_ray(cm.Sphere(1), cm.Pose(), (0, 0, np.nan), (0, 0, 1)), cm.InputError, "origin"),
        (lambda: cm.cast_ray(cm.Sphere(1), cm.Pose(), (0, 0, 5), (0, 0, 1), -1), cm.InputError, "length"),
        (lambda: cm.cast_ray(cm.Sphere(1), cm.Pose(), (0, 0, 5), (0, 0, 1), [1, 2]), cm.InputError, "broadcast"),
        (lambda: cm.cast_ray(cm.Circle(1), cm.Pose(), (0, 0, 5), (0, 0, 1)), cm.InputError, "plane"),
        (lambda: cm.cast_ray(cm.Sphere(1), (0, 0, 0), (0, 0, 5), (0, 0, 1)), cm.PoseError, "Pose"),
        (lambda: cm.cast_ray("ball", cm.Pose(), (0, 0, 5), (0, 0, 1)), cm.ShapeError, "shape"),
        (lambda: cm.contains(cm.Sphere(1), cm.Pose(), (0, 0, np.inf)), cm.InputError, "points"),
        (lambda: cm.contains(cm.Sphere(1), cm.Pose(), (0, 0, 0), "magic"), cm.InputError, "closed form, ray, sides"),
        (lambda: cm.contains(cm.Sphere(1), cm.Pose(), (0, 0, 0), "ray"), cm.UnsupportedError, "Polygon, Box"),
    ],
)
def test_bad_input_is_refused(call: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        call()


def test_a_polygon_with_a_radius_is_refused_and_never_answered_without_it():
    import collision_monitor as cm

    rounded = cm.Polygon([(0, 0), (1, 0), (0, 1)], 0.5)
    with pytest.raises(cm.UnsupportedError, match="Polygon with a radius"):
        cm.contains(rounded, cm.Pose(), (-0.2, 0.2))
    with pytest.raises(cm.UnsupportedError, match="Polygon with a radius"):
        cm.cast_ray(rounded, cm.Pose(), (-5, 0.2, 0), (1, 0, 0))
