"""Surface of a mesh: welding, closedness, orientation, sheets; points inside, certainly or possibly."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from solids import CONCAVE, cube, voxels

import collision_monitor as cm
from collision_monitor.geometry.inside import UNKNOWN, locate_in_welded_surface
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.surface import Surface, first_equal

TORUS = trimesh.creation.torus(1.0, 0.3, major_sections=24, minor_sections=12)


def soup(vertices, faces):
    """The same faces, each with three vertices of its own, as in an STL file."""
    corners = np.asarray(vertices)[np.asarray(faces)]
    return corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)


def moved(solid, by):
    return solid[0] + by, solid[1]


def together(*solids):
    start = np.cumsum([0] + [len(vertices) for vertices, _ in solids])
    faces = np.concatenate([faces + at for (_, faces), at in zip(solids, start[:-1], strict=True)])
    return np.concatenate([vertices for vertices, _ in solids]), faces


def locate(solid, points):
    return locate_in_welded_surface(np.asarray(points, float), Surface(*solid))


def test_equal_vertices_are_one_point():
    points = np.array([(0.0, 0, 0), (1, 0, 0), (-0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
    assert first_equal(points).tolist() == [0, 1, 0, 1, 4]
    assert first_equal(np.nextafter(points, 2)).tolist() == [0, 1, 0, 1, 4]


@pytest.mark.parametrize("solid", [cube, *CONCAVE.values()])
@pytest.mark.parametrize("inward", [False, True])
def test_a_soup_of_triangles_closes_like_the_mesh(solid, inward):
    vertices, faces = solid()
    faces = faces[:, ::-1] if inward else faces
    own, welded = Surface(vertices, faces), Surface(*soup(vertices, faces))
    assert own.closed and welded.closed and own.oriented and welded.oriented
    assert welded.volume == pytest.approx(own.volume) and (own.volume < 0) == inward
    assert str(own) == str(welded) == f"closed, oriented {'inward' if inward else 'outward'}"
    assert welded.welded == 3 * len(faces) - len(vertices)
    np.testing.assert_array_equal(welded.vertices[welded.faces], vertices[faces])


def test_faces_that_repeat_or_collapse_do_not_count():
    vertices, faces = cube()
    doubled = np.concatenate([faces, faces[:, [1, 2, 0]], faces[:4, ::-1], [(0, 0, 1), (2, 2, 2)]])
    surface = Surface(vertices, doubled)
    assert surface.closed and surface.oriented and len(surface.faces) == len(faces)
    nothing = Surface(vertices, np.array([(0, 0, 1), (2, 2, 2)]))
    assert not nothing.closed and len(nothing.hole) == 0 and nothing.certain


def test_a_face_the_wrong_way_round_is_found():
    vertices, faces = cube()
    faces[0] = faces[0, ::-1]
    assert Surface(vertices, faces).closed and not Surface(vertices, faces).oriented
    assert locate((vertices, faces), [(0.5, 0.5, 0.5), (2, 0.5, 0.5)]).tolist() == [1, -1]


def test_a_surface_keeps_no_list_of_its_edges():
    x, y = np.meshgrid(np.arange(40.0), np.arange(40.0))
    corners = np.arange(1600).reshape(40, 40)
    faces = np.stack([corners[:-1, :-1], corners[:-1, 1:], corners[1:, :-1]], -1).reshape(-1, 3)
    surface = Surface(np.stack([x, y, x * y], -1).reshape(-1, 3), faces)
    assert len(surface.open_edges) and surface.certain and len(surface.part) == len(faces)
    known = [each for value in vars(surface).values() for each in (value if isinstance(value, tuple) else (value,))]
    kept = sum(each.nbytes for each in known if isinstance(each, np.ndarray) and each is not surface.vertices)
    assert kept <= 33 * len(faces) + surface.open_edges.nbytes  # faces, parts, and whether these are open


def test_a_terrain_and_a_wall_are_sheets_and_a_box_without_a_side_is_not():
    x, y = np.meshgrid(np.arange(8.0), np.arange(8.0), indexing="ij")
    terrain = np.column_stack([x.ravel(), y.ravel(), np.sin(x.ravel()) + np.cos(2 * y.ravel())])
    k = (np.arange(7)[:, None] * 8 + np.arange(7)).ravel()
    faces = np.concatenate([np.column_stack([k, k + 8, k + 9]), np.column_stack([k, k + 9, k + 1])])
    assert Surface(terrain, faces).sheet
    assert locate((terrain, faces), [(3.1, 3.2, -3), (3.1, 3.2, 0.0), (3.1, 3.2, 3)]).tolist() == [-1, -1, -1]
    vertices, sides = cube()
    assert Surface(vertices, sides[[0, 6]]).sheet
    lacking = Surface(vertices, np.delete(sides, [0, 6], axis=0))
    assert not lacking.sheet
    assert "sheet" in str(Surface(terrain, faces)) and "uncertain" in str(lacking)


def test_solids_that_overlap_and_cavities():
    two = together(cube(), moved(cube(), (0.5, 0.25, 0.25)))
    points = [(0.75, 0.5, 0.5), (0.25, 0.1, 0.1), (1.25, 0.5, 0.5), (2.0, 0.5, 0.5)]
    assert locate(two, points).tolist() == [1, 1, 1, -1]
    assert locate(CONCAVE["hollow"](), [(1.5, 1.5, 1.5), (0.5, 0.5, 0.5)]).tolist() == [-1, 1]
    # without an orientation, the overlap of two solids and a cavity are the same
    vertices, faces = together(moved(cube(), (0.5, 0.25, 0.25)), cube())
    faces[0] = faces[0, ::-1]
    assert locate((vertices, faces), points).tolist() == [UNKNOWN, 1, 1, -1]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32))
def test_a_mesh_with_a_hole_knows_the_outside_and_never_claims_the_inside(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = voxels(rng.random((3, 3, 3)) < 0.5) if seed % 4 else (TORUS.vertices, TORUS.faces)
    if not len(faces):
        return
    lacking = np.delete(faces, rng.integers(0, len(faces), rng.integers(1, 4)), axis=0)
    surface = Surface(vertices, lacking)
    low, high = vertices.min(axis=0) - 0.3, vertices.max(axis=0) + 0.3
    points = rng.uniform(low, high, (60, 3))
    if surface.sheet:
        return
    truth = locate_in_welded_surface(points, Surface(vertices, faces))
    found = locate_in_welded_surface(points, surface)
    # between the missing faces and those that close the hole, only the box around it is known
    hole = surface.hole
    beside = ((points < hole.min(axis=0)) | (points > hole.max(axis=0))).any(axis=1)
    assert not (found == Location.INSIDE).any()
    if surface.part.max() == 0:
        np.testing.assert_array_equal(found[beside] == UNKNOWN, truth[beside] == Location.INSIDE)
    assert (found[beside & (truth == Location.INSIDE)] == UNKNOWN).all()


def test_repr_says_what_the_surface_is():
    vertices, faces = soup(*cube())
    assert repr(cm.Mesh(vertices, faces)) == (
        "Mesh(36 vertices, 28 of them welded, 12 faces: closed, oriented outward)"
    )
    assert repr(cm.Mesh(*cube())) == "Mesh(8 vertices, 12 faces: closed, oriented outward)"
    assert repr(cm.Mesh(vertices, np.delete(faces, [0, 6], axis=0))) == (
        "Mesh(36 vertices, 28 of them welded, 10 faces: open at 4 edges, its inside is uncertain)"
    )
