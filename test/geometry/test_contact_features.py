"""Tests of the classification of the six feature pairs."""

import numpy as np
import pytest
from point_sets import rotation
from solids import cube, octahedron, u_shape

from collision_monitor.errors import InputError
from collision_monitor.geometry.contact_features import FeatureContact, FeaturePair, FeatureType, mesh_feature_at

UP = [0, 0, 1]
R2 = 2**-0.5
ON_EDGE = np.array([[1, 0, 0], [0, R2, -R2], [0, R2, R2]])  # 45 degrees about x, so that a cube stands on an edge
ON_CORNER = np.linalg.qr(np.array([[1, 1, 1], [1, 0, 0], [0, 1, 0.0]]).T)[0].T[[1, 2, 0]]


def features_at(point, a, faces_a, b, faces_b, normal):
    normal = np.asarray(normal, float)
    return FeatureContact(mesh_feature_at(point, normal, a, faces_a), mesh_feature_at(point, -normal, b, faces_b))


def lowest(turn):
    """A turned cube with the mean of its lowest points at the origin."""
    vertices, faces = cube()
    vertices = (vertices - 0.5) @ turn.T
    return vertices - [*vertices[np.abs(vertices[:, 2] - vertices[:, 2].min()) < 1e-9].mean(axis=0)], faces


def below(solid, shift=(0, 0, 0)):
    """The solid mirrored at height 0, so that it touches from below."""
    vertices, faces = solid
    return vertices * [1, 1, -1] + shift, faces[:, ::-1]


FLAT, EDGE, CORNER = lowest(np.eye(3)), lowest(ON_EDGE), lowest(ON_CORNER)
TURNED = lowest(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]) @ ON_EDGE)
CASES = {
    "VV": (below(CORNER), CORNER),
    "VE": (below(CORNER), EDGE),
    "VF": (below(CORNER), FLAT),
    "EE": (below(EDGE), TURNED),
    "EF": (below(EDGE), FLAT),
    "FF": (below(FLAT), FLAT),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("scale", [1e-9, 1, 1e9])
@pytest.mark.parametrize("seed", range(4))
def test_the_six_pairs(name, scale, seed):
    turn, shift = rotation(seed) * scale, np.array([1, 2, 3]) * scale
    (a, faces_a), (b, faces_b) = ((vertices @ turn.T + shift, faces) for vertices, faces in CASES[name])
    found = features_at(shift, a, faces_a, b, faces_b, turn @ UP / scale)
    assert found.pair is FeaturePair[name]
    letters = "".join(feature.type.name[0] for feature in (found.a, found.b))
    assert letters == name
    swapped = features_at(shift, b, faces_b, a, faces_a, -turn @ UP / scale)
    assert swapped.pair is FeaturePair[name] and (swapped.a, swapped.b) == (found.b, found.a)
    # the named feature contains the contact point
    for feature, points in ((found.a, a), (found.b, b)):
        assert np.abs((points[list(feature.vertices)] - shift) @ turn / scale**2)[:, 2].max() < 1e-6
        assert len(feature.vertices) == feature.type


def test_in_words():
    vertices, faces = cube()
    point = vertices[3] * 1.0
    above = vertices + point - vertices[0]
    found = features_at(point, vertices, faces, *octahedron_on(point), [0, 0, 1])
    assert str(found.b) == "vertex 5" and found.a.type is FeatureType.FACE
    assert str(found).startswith("face ") and str(found).endswith("of A on vertex 5 of B")
    edge = mesh_feature_at([0.5, 0, 0], [0, -1, -1], vertices, faces)
    assert edge.type is FeatureType.EDGE
    assert {tuple(vertices[i]) for i in edge.vertices} == {(0, 0, 0), (1, 0, 0)}
    assert str(edge) == f"edge {edge.vertices[0]}-{edge.vertices[1]}"
    assert above.shape == vertices.shape


def octahedron_on(point):
    vertices, faces = octahedron()
    return vertices + point - vertices[5], faces


def test_a_face_beats_its_own_edges_and_corners():
    vertices, faces = cube()
    for point in ([0.5, 0.25, 1], [0.5, 0, 1], [0, 0, 1]):
        found = mesh_feature_at(point, UP, vertices, faces)
        assert found.type is FeatureType.FACE and (vertices[list(found.vertices)][:, 2] == 1).all()
    assert mesh_feature_at([0, 0, 1], [-1, 0, 1], vertices, faces).type is FeatureType.EDGE
    assert mesh_feature_at([0, 0, 1], [-1, -1, 1], vertices, faces).type is FeatureType.VERTEX


def test_what_is_pierced_is_named_by_the_place():
    vertices, faces = cube()
    assert mesh_feature_at([0.5, 0.25, 1], [1, 1, 1], vertices, faces).type is FeatureType.FACE
    assert mesh_feature_at([0.5, 0, 1], [1, 1, 1], vertices, faces).type is FeatureType.EDGE


def test_concave_meshes_by_the_place_too():
    vertices, faces = u_shape()
    floor = mesh_feature_at([1.5, 0.5, 1], UP, vertices, faces)
    assert floor.type is FeatureType.FACE and (vertices[list(floor.vertices)][:, 2] == 1).all()
    top = mesh_feature_at([0.5, 0.5, 3], UP, vertices, faces)
    assert (vertices[list(top.vertices)][:, 2] == 3).all()


def test_each_side_of_a_plate_without_thickness():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    plate = corners, np.array([[0, 1, 2], [0, 2, 3], [0, 2, 1], [0, 3, 2]])
    assert mesh_feature_at([0.5, 0.25, 0], [0, 0, 1], *plate).face == 0
    assert mesh_feature_at([0.5, 0.25, 0], [0, 0, -1], *plate).face == 2


def test_points_off_the_surface_are_refused():
    vertices, faces = cube()
    with pytest.raises(InputError, match="surface"):
        mesh_feature_at([0.5, 0.5, 0.5], UP, vertices, faces)
    with pytest.raises(InputError, match="finite"):
        mesh_feature_at([0.5, 0.5, np.nan], UP, vertices, faces)
