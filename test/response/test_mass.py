"""Mass properties against meshes of the shapes in trimesh, and against the parallel axis theorem."""

import numpy as np
import pytest
import trimesh
from shapes import EXAMPLES

import collision_monitor as cm
from collision_monitor.response import mass_properties
from collision_monitor.shapes.reach import reach
from collision_monitor.shapes.registry import KINDS

SHAPES = {
    "sphere": (cm.Sphere(0.3), lambda: trimesh.creation.icosphere(5, 0.3)),
    "box": (cm.Box((1, 2, 3)), lambda: trimesh.creation.box((1, 2, 3))),
    "cylinder": (cm.Cylinder(0.3, 1.2), lambda: trimesh.creation.cylinder(0.3, 1.2, sections=400)),
    "capsule": (cm.Capsule(0.3, 1.2), lambda: trimesh.creation.capsule(1.2, 0.3, count=[400, 400])),
    "cone": (cm.Cone(0.3, 1.2), lambda: trimesh.creation.cone(0.3, 1.2, sections=400)),
    "ellipsoid": (
        cm.Ellipsoid((0.9, 0.5, 0.2)),
        lambda: stretched(trimesh.creation.icosphere(5, 1.0), (0.9, 0.5, 0.2)),
    ),
}


def stretched(mesh, factors):
    mesh.apply_transform(np.diag((*factors, 1.0)))
    return mesh


@pytest.mark.parametrize(
    "shape", [EXAMPLES[kind.number] for kind in KINDS if kind.mass], ids=lambda it: type(it).__name__
)
def test_every_kind_agrees_with_a_grid_of_the_points_inside(shape):
    found, side = mass_properties(shape, 2.0), 80
    ends = reach([(shape, cm.Pose())], np.concatenate([np.eye(3), -np.eye(3)]))
    low, size = -ends[3:], ends[:3] + ends[3:]
    cells = np.stack(np.meshgrid(*3 * [np.arange(side) + 0.5], indexing="ij"), axis=-1).reshape(-1, 3)
    points = low + cells / side * size
    inside = points[cm.contains(shape, cm.Pose(), points)]
    each = 2.0 * size.prod() / side**3
    assert found.mass == pytest.approx(each * len(inside), rel=0.02)
    assert found.centre == pytest.approx(inside.mean(axis=0), abs=0.01 * size.max())
    offset = inside - inside.mean(axis=0)
    inertia = each * ((offset**2).sum() * np.eye(3) - offset.T @ offset)
    assert found.inertia == pytest.approx(inertia, abs=0.02 * np.trace(inertia))


@pytest.mark.parametrize("name", SHAPES)
def test_closed_forms_agree_with_fine_meshes(name):
    shape, make = SHAPES[name]
    mesh = make()
    mesh.density = 700.0
    if name == "cone":
        mesh.apply_translation((0, 0, -0.6))
    found = mass_properties(shape, 700.0)
    assert found.mass == pytest.approx(mesh.mass, rel=2e-3)
    assert found.centre == pytest.approx(mesh.center_mass, abs=2e-3)
    assert found.inertia == pytest.approx(mesh.moment_inertia, rel=4e-3, abs=1e-3 * np.trace(found.inertia))


def test_polyhedra_agree_with_trimesh_far_from_the_origin():
    rng = np.random.default_rng(1)
    for offset in (0.0, 1e4):
        points = rng.normal(size=(40, 3)) + offset
        hull = trimesh.convex.convex_hull(points)
        for shape in (cm.ConvexHull(points), cm.Mesh(hull.vertices, hull.faces)):
            found = mass_properties(shape, 2.0)
            near = trimesh.Trimesh(hull.vertices - offset, hull.faces)
            near.density = 2.0
            assert found.mass == pytest.approx(near.mass, rel=1e-9)
            assert found.centre == pytest.approx(near.center_mass + offset, rel=1e-9)
            assert found.inertia == pytest.approx(near.moment_inertia, rel=1e-7, abs=1e-7 * np.trace(found.inertia))


@pytest.mark.parametrize("density", [0.0, -1.0, np.nan, np.inf])
def test_impossible_densities_are_refused(density):
    with pytest.raises(cm.InputError, match="density"):
        mass_properties(cm.Sphere(1), density)


@pytest.mark.parametrize("shape", [cm.HalfSpace((0, 0, 1)), cm.Circle(1), cm.Box((1, 1, 0))])
def test_shapes_without_a_volume_are_refused_with_the_list(shape):
    with pytest.raises(cm.UnsupportedError, match="supported are Sphere"):
        mass_properties(shape)
