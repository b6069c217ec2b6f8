"""`cast_ray` against samples of `contains`, trimesh and closed forms."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from rational import dot, exact, minus

import collision_monitor as cm
from collision_monitor.geometry.points import closest_point_on_segment
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
    "ellipsoid": cm.Ellipsoid((0.5, 0.9, 0.7)),
    "cloud": cm.Points(RNG.normal(size=(60, 3)) * 0.6, 0.2),
    "half-space": cm.HalfSpace((1, 2, 3), 0.2),
    "compound": [(cm.Sphere(0.4), cm.Pose((1, 0, 0))), (cm.Box((1, 1, 1)), cm.Pose((-1, 0, 0)))],
}
FLAT: dict[str, Any] = {
    "circle": cm.Circle(0.8),
    "polygon": cm.Polygon(L_SHAPE),
    "rounded polygon": cm.Polygon(L_SHAPE, 0.2),
}
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
        (lambda: cm.cast_ray(cm.Sphere(1), (0, 0), (0, 0, 5), (0, 0, 1)), cm.PoseError, "Pose"),
        (lambda: cm.cast_ray("ball", cm.Pose(), (0, 0, 5), (0, 0, 1)), cm.ShapeError, "shape"),
        (lambda: cm.contains(cm.Sphere(1), cm.Pose(), (0, 0, np.inf)), cm.InputError, "points"),
        (lambda: cm.contains(cm.Sphere(1), cm.Pose(), (0, 0, 0), "magic"), cm.InputError, "closed form, ray, sides"),
        (lambda: cm.contains(cm.Sphere(1), cm.Pose(), (0, 0, 0), "ray"), cm.UnsupportedError, "Polygon, Box"),
        (lambda: cm.cast_ray(cm.Points([(0, 0, 0)]), cm.Pose(), (0, 0, 5), (0, 0, -1)), cm.UnsupportedError, "radius"),
        (lambda: cm.contains(cm.Polygon(L_SHAPE, 1), cm.Pose(), (0, 0), "ray"), cm.UnsupportedError, "with a radius"),
    ],
)
def test_bad_input_is_refused(call: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        call()


@pytest.mark.parametrize("radii", [(1, 2, 3), (1e-3, 1, 1), (5, 1e-4, 2e-4), (0.3, 0.3, 0.3)])
def test_rays_and_points_of_an_ellipsoid_agree_with_50_digits(radii: tuple[float, ...]) -> None:
    """Hits are right for a ray that is moved by 1e-14 of size and distance."""
    rng, shape = np.random.default_rng(11), cm.Ellipsoid(radii)
    p = rng.normal(size=(200, 3))
    p *= rng.uniform(0.1, 30, (200, 1)) * max(radii) / np.linalg.norm(p, axis=1, keepdims=True)
    d = rng.normal(size=(200, 3)) * radii * 0.6 - p
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    hits = cm.cast_ray(shape, cm.Pose(), p, d)
    assert hits.hit.any() and not hits.hit.all()
    contained = cm.contains(shape, cm.Pose(), p)
    with localcontext(prec=50):
        for k in range(200):
            o, u = ([Decimal(float(x)) / Decimal(r) for x, r in zip(v[k], radii, strict=True)] for v in (p, d))
            a, b, c = (sum(x * y for x, y in zip(v, w, strict=True)) for v, w in ((u, u), (o, u), (o, o)))
            assert contained[k] == (c <= 1) and (not contained[k] or hits.distance[k] == 0.0)
            rest = b * b - a * (c - 1)
            allowed = 1e-14 * (max(radii) + float(np.linalg.norm(p[k])))
            if contained[k]:
                continue
            if hits.hit[k]:
                assert rest >= 0 and b < 0
                steepness = abs(float(hits.normal[k] @ d[k]))  # a ray moved sideways by x hits x / steepness later
                assert abs(float((-b - rest.sqrt()) / a) - hits.distance[k]) * steepness <= allowed
            else:
                assert rest < 0 or b > 0


ROUNDED = [cm.Polygon(L_SHAPE, 0.3), cm.Polygon([(0, 0), (2, 1)], 0.4), cm.Polygon([(0, 0), (1, 0), (0, 1)], 1.5)]


@pytest.mark.parametrize("shape", ROUNDED)
def test_a_rounded_polygon_contains_what_is_within_its_radius_of_the_polygon(shape: cm.Polygon) -> None:
    """Against the distance from the triangles of the polygon, in rational numbers."""
    points = np.random.default_rng(12).uniform(-2, 4, (300, 2))
    corners = [exact(corner) for corner in shape.points]
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    expected = []
    for point in points:
        q = exact(point)
        squares = []
        for a, b in edges:
            along, to = minus(b, a), minus(q, a)
            t = min(max(dot(along, to) / dot(along, along), Fraction(0)), Fraction(1))
            gap = [x - t * y for x, y in zip(to, along, strict=True)]
            squares.append(dot(gap, gap))
        crossed = [(a, b) for a, b in edges if (a[1] > q[1]) != (b[1] > q[1])]
        odd = sum(a[0] + (q[1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1]) > q[0] for a, b in crossed) % 2
        expected.append(bool(odd) or min(squares) <= Fraction(shape.radius) ** 2)
    found = cm.contains(shape, cm.Pose(), points)
    assert found.tolist() == expected and 0 < found.sum() < 300


@pytest.mark.parametrize("shape", ROUNDED)
def test_rays_meet_a_rounded_polygon_at_its_radius(shape: cm.Polygon) -> None:
    """The hit is at the radius from the nearest edge, the normal leads away from it, and nothing lies before it."""
    rng = np.random.default_rng(13)
    p, d = np.pad(rng.uniform(-4, 6, (300, 2)), ((0, 0), (0, 1))), np.pad(rng.normal(size=(300, 2)), ((0, 0), (0, 1)))
    hits = cm.cast_ray(shape, cm.Pose(), p, d)
    met = hits.hit & (hits.distance > 0.0)
    at = hits.point[met, :2]
    corners = np.asarray(shape.points)
    nearest, _ = closest_point_on_segment(at[:, None], corners, np.roll(corners, -1, axis=0))
    gaps = np.linalg.norm(nearest - at[:, None], axis=-1)
    assert met.sum() > 30
    assert gaps.min(axis=1) == pytest.approx(shape.radius, abs=1e-14)
    away = at - nearest[np.arange(len(at)), gaps.argmin(axis=1)]
    assert hits.normal[met, :2] == pytest.approx(away / shape.radius, abs=1e-7)
    end = np.where(hits.hit, hits.distance, 15.0) - 1e-9
    step = (end / np.linalg.norm(d, axis=1))[:, None] * d
    on_the_way = p[:, None] + np.linspace(0, 1, 150)[:, None] * step[:, None]
    assert not cm.contains(shape, cm.Pose(), on_the_way)[hits.distance > 0.0].any()


def test_rays_do_not_pass_between_the_faces_or_edges_that_they_are_aimed_at() -> None:
    """Rays at points on edges, and at vertices, of a turned ball of triangles and of a polygon."""
    rng = np.random.default_rng(14)
    ball = trimesh.creation.icosphere(2)
    vertices = ball.vertices @ random_pose(rng, False).rotation.T
    ends = ball.edges_unique[rng.integers(len(ball.edges_unique), size=2000)]
    part = np.where(np.arange(2000) < 300, 0.0, rng.uniform(size=2000))[:, None]
    target = vertices[ends[:, 0]] * (1 - part) + vertices[ends[:, 1]] * part
    p = target + 3 * (target + rng.uniform(-0.3, 0.3, target.shape))
    hits = cm.cast_ray(cm.Mesh(vertices, ball.faces), cm.Pose(), p, target - p)
    assert hits.distance == pytest.approx(np.linalg.norm(target - p, axis=1), abs=1e-12)

    ring = np.array([(np.cos(a), np.sin(a)) for a in np.arange(11) * 2 * np.pi / 11])
    corner = np.pad(ring[rng.integers(11, size=500)], ((0, 0), (0, 1)))
    p = corner + rng.uniform(1, 5, (500, 1)) * corner
    hits = cm.cast_ray(cm.Polygon(ring), cm.Pose(), p, corner - p)
    assert hits.distance == pytest.approx(np.linalg.norm(corner - p, axis=1), abs=1e-12)


def test_a_closed_soup_of_triangles_is_the_solid_that_it_closes() -> None:
    """As in an STL file: three vertices for each face. Queries equal those of the mesh with shared vertices."""
    soup = cm.Mesh(RING.vertices[RING.faces].reshape(-1, 3), np.arange(RING.faces.size).reshape(-1, 3))
    rng = np.random.default_rng(15)
    points, d = rng.normal(size=(400, 3)) * 0.8, rng.normal(size=(400, 3))
    for test in ("closed form", "ray"):
        expected = cm.contains(SOLIDS["mesh"], cm.Pose(), points, test)
        assert (cm.contains(soup, cm.Pose(), points, test) == expected).all() and 0 < expected.sum() < 400
    ours, theirs = (cm.cast_ray(mesh, cm.Pose(), points, d) for mesh in (soup, SOLIDS["mesh"]))
    assert (ours.distance == theirs.distance).all() and (ours.normal == theirs.normal).all()
    assert (ours.distance[cm.contains(soup, cm.Pose(), points)] == 0.0).all()


def test_solids_of_one_mesh_that_overlap_are_united() -> None:
    box = trimesh.creation.box((2, 2, 2))
    vertices = np.concatenate([box.vertices, np.add(box.vertices, (1, 0, 0))])
    pair = cm.Mesh(vertices, np.concatenate([box.faces, box.faces + 8]))
    points = [(0.5, 0, 0), (-0.5, 0, 0), (1.5, 0, 0), (2.5, 0, 0)]
    assert cm.contains(pair, cm.Pose(), points).tolist() == [True, True, True, False]
    assert cm.contains(pair, cm.Pose(), points, "ray").tolist() == [False, True, True, False]  # the parity of a ray


def test_faces_of_any_orientation_never_exclude_what_they_leave_open() -> None:
    """A hollow box, half of its faces turned over: a point in the cavity may be inside, one in the wall is."""
    outer, inner = trimesh.creation.box((2, 2, 2)), trimesh.creation.box((1, 1, 1))
    faces = np.concatenate([outer.faces, inner.faces + 8])
    faces[::2] = faces[::2, ::-1]
    hollow = cm.Mesh(np.concatenate([outer.vertices, inner.vertices]), faces)
    assert cm.contains(hollow, cm.Pose(), [(0, 0, 0), (0.7, 0, 0), (1.5, 0, 0)]).tolist() == [True, True, False]
