"""COLLADA: all geometries that the scene places, and files that leave something out or stand for far more."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from mesh_files import CUBE, CUBE_QUADS, dae, dae_points, soup, volume
from processor_time import within
from scipy.spatial.transform import Rotation
from session_child import reset, resident

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.dae import read_dae

POINTS, FACES = soup(6)
PRISM = [
    *CUBE_QUADS[:4],
    *([ring[k] for k in corners] for ring in CUBE_QUADS[4:] for corners in ([0, 1, 2], [0, 2, 3])),
]
"""Polygons of a cube, of three and of four corners."""


def triangles(points: np.ndarray, faces: np.ndarray) -> str:
    return dae_points(points) + (
        f'<triangles count="{len(faces)}"><input semantic="VERTEX" source="#v" offset="0"/>'
        f"<p>{' '.join(map(str, faces.reshape(-1)))}</p></triangles>"
    )


def test_one_mesh_and_its_unit() -> None:
    mesh = read_dae(dae(triangles(POINTS, FACES), unit="0.0254"))
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    np.testing.assert_array_equal(mesh.faces, FACES)
    assert mesh.unit == 0.0254


def test_polygons_with_further_indices_of_each_corner() -> None:
    """Normals and the like have indices of their own between those of the vertices."""
    inputs = '<input semantic="NORMAL" source="#n" offset="0"/><input semantic="VERTEX" source="#v" offset="1"/>'
    indices = [" ".join(f"9 {k}" for k in ring) for ring in PRISM]
    polylist = (
        f'<polylist count="{len(PRISM)}">{inputs}<vcount>{" ".join(str(len(r)) for r in PRISM)}</vcount>'
        f"<p>{' '.join(indices)}</p></polylist>"
    )
    polygons = f'<polygons count="{len(PRISM)}">{inputs}{"".join(f"<p>{each}</p>" for each in indices)}</polygons>'
    for primitive in (polylist, polygons):
        mesh = read_dae(dae(dae_points(CUBE) + primitive))
        assert len(mesh.faces) == 12 and volume(mesh.vertices, mesh.faces) == pytest.approx(1.0)


def test_strips_and_fans_and_what_has_no_surface() -> None:
    vertex = '<input semantic="VERTEX" source="#v" offset="0"/>'
    text = dae_points(POINTS) + (
        f'<tristrips count="2">{vertex}<p>0 1 2 3</p><p>4 5 6</p></tristrips>'
        f'<trifans count="1">{vertex}<p>7 8 9 10</p></trifans><lines count="1">{vertex}<p>0 1</p></lines>'
    )
    mesh = read_dae(dae(text))
    assert mesh.vertices[mesh.faces].tolist() == POINTS[
        [[0, 1, 2], [3, 2, 1], [4, 5, 6], [7, 8, 9], [7, 9, 10]]
    ].tolist()  # fmt: skip


def test_columns_of_a_source_are_those_of_its_parameters() -> None:
    rows = np.concatenate([np.full((len(POINTS), 1), 7.0), POINTS[:, ::-1]], axis=1)
    source = dae_points(rows).replace('stride="3"', 'stride="4"')
    source = source.replace('<param name="X"/><param name="Y"/><param name="Z"/>', "".join(
        f'<param name="{name}"/>' for name in ("", "Z", "Y", "X")))  # fmt: skip
    text = triangles(POINTS, FACES).replace(dae_points(POINTS), source)
    np.testing.assert_array_equal(read_dae(dae(text)).vertices, POINTS)


def test_nodes_place_geometries_by_their_transforms_in_order() -> None:
    q = Rotation.random(random_state=2)
    axis = q.as_rotvec()
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = q.as_matrix() @ np.diag((1, 2, -3)), (1, 2, 3)
    one = (
        "<translate>1 2 3</translate>"
        f"<rotate>{' '.join(map(str, axis.tolist()))} {np.degrees(np.linalg.norm(axis))}</rotate><scale>1 2 -3</scale>"
    )
    other = f"<matrix>{' '.join(map(str, X.reshape(-1).tolist()))}</matrix>"
    place = '<instance_geometry url="#g"/>'
    nodes = f"<node>{one}{place}</node><node><translate>0 0 0</translate><node>{other}{place}</node></node>"
    nodes += '<node><instance_node url="#shared"/></node>'
    more = f'<library_nodes><node id="shared">{other}<node>{place}</node></node></library_nodes>'
    corners = np.array([[ring[i] for i in k] for ring in CUBE_QUADS for k in ([0, 1, 2], [0, 2, 3])])
    mesh = read_dae(dae(triangles(CUBE, corners), nodes, more))
    expected = CUBE @ X[:3, :3].T + X[:3, 3]
    for begin in (0, 8, 16):
        np.testing.assert_allclose(mesh.vertices[begin : begin + 8], expected, atol=1e-9)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(18.0)  # mirrored, and still from outside


def test_a_skin_is_placed_as_it_was_bound() -> None:
    controller = (
        '<library_controllers><controller id="c"><skin source="#g"><bind_shape_matrix>2 0 0 1 0 2 0 0 0 0 2 0 0 0 0 1'
        "</bind_shape_matrix></skin></controller></library_controllers>"
    )
    nodes = '<node><instance_controller url="#c"/></node>'
    mesh = read_dae(dae(triangles(POINTS, FACES), nodes, controller))
    np.testing.assert_allclose(mesh.vertices, 2 * POINTS + (1, 0, 0))


def test_the_scenes_of_another_program() -> None:
    scene = trimesh.Scene()
    for k in range(3):
        X = trimesh.transformations.random_rotation_matrix(np.random.default_rng(k).random(3))
        scene.add_geometry(trimesh.creation.box((1, 2, 3 + k)), transform=X)
    parts = scene.dump()
    mesh = read_dae(trimesh.exchange.dae.export_collada(parts))
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(sum(part.volume for part in parts), rel=1e-5)


WHOLE = dae(triangles(POINTS, FACES)).decode()


def replaced(before: str, after: str) -> str:
    assert before in WHOLE
    return WHOLE.replace(before, after)


SILENT = {
    "no scene of that name": (replaced('url="#s"', 'url="#t"'), "expected the id of one <visual_scene> in the file"),
    "no geometry of that name": (replaced('url="#g"', 'url="#h"'), "expected the id of one <geometry> in the file"),
    "another file": (replaced('url="#g"', 'url="other.dae#g"'), "got 'other.dae#g'"),
    "two geometries of one id": (replaced("</library_geometries>", '<geometry id="g"/></library_geometries>'),
                                 "which 2 have"),
    "a number is missing": (replaced(" ".join(map(repr, POINTS[-1].tolist())), "1 2"),
                            "expected 120 finite numbers, got 119"),
    "a number is none": (replaced(repr(float(POINTS[0, 0])), "x"), "expected numbers"),
    "a number is not finite": (replaced(repr(float(POINTS[0, 0])), "nan"), "expected 120 finite numbers"),
    "indices are missing": (replaced(f'count="{len(FACES)}"', f'count="{len(FACES) + 1}"'),
                            "expected 61 faces with 180 corners, got 60 with 180"),
    "an index is out of range": (replaced("<p>", "<p>40 39 38 "), "expected"),
    "a transform that is not read": (replaced("<node>", "<node><skew>0 1 0 0 0 1 0</skew>"),
                                     "expected matrix, translate"),
    "a spline": (WHOLE.replace("<mesh>", "<spline>").replace("</mesh>", "</spline>"), "expected <mesh>"),
    "holes": (replaced("<p>", "<ph><p>0 1 2</p></ph><p>"), "without holes"),
    "no vertices": (replaced('semantic="VERTEX"', 'semantic="NORMAL"'), "expected an <input> of VERTEX, got none"),
    "a negative unit": (replaced('meter="1"', 'meter="-1"'), "expected a positive length"),
    "a document type": (WHOLE.replace("<COLLADA", "<!DOCTYPE x [<!ENTITY a 'b'>]><COLLADA", 1),
                        "without a document type"),
}  # fmt: skip


@pytest.mark.parametrize("kind", SILENT)
def test_what_cannot_be_read_is_named_and_not_left_out(kind: str) -> None:
    text, reason = SILENT[kind]
    with pytest.raises(ShapeError) as caught:
        read_dae(text.encode())
    assert (reason in str(caught.value) and "line " in str(caught.value)) or "unit" in str(caught.value)


def test_a_file_that_is_cut_anywhere_is_refused() -> None:
    data = WHOLE.encode()
    for end in range(0, len(data) - len("</COLLADA>"), 37):
        with pytest.raises(ShapeError):
            read_dae(data[:end])


def doubling() -> bytes:
    """Each node places the one before twice: 2^30 places of one mesh."""
    nodes = "".join(
        f'<node id="n{k}"><instance_node url="#n{k - 1}"/><instance_node url="#n{k - 1}"/></node>' for k in range(1, 31)
    )
    library = f'<library_nodes><node id="n0"><instance_geometry url="#g"/></node>{nodes}</library_nodes>'
    return dae(triangles(POINTS, FACES), '<node><instance_node url="#n30"/></node>', library)


BOMBS = {
    "doubling": doubling,
    "itself": lambda: dae(triangles(POINTS, FACES), '<node id="n"><instance_node url="#n"/></node>'),
    "many places": lambda: dae(triangles(*soup(0, 3000, 3000)), '<node><instance_geometry url="#g"/></node>' * 20_000),
    "elements": lambda: dae("<a/>" * 3_000_000),
    "depth": lambda: dae("<a>" * 200_000),
}


@pytest.mark.parametrize("kind", BOMBS)
def test_a_bomb_takes_little_time_and_memory(kind: str) -> None:
    data = BOMBS[kind]()
    read_dae(WHOLE.encode())
    reset()
    before = resident()
    with within(5.0, kind), pytest.raises(ShapeError, match="at most"):
        read_dae(data)
    assert resident() - before < 256
