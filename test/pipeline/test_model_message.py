"""Models cross the pipe to the process that makes them without the change of one bit."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
import trimesh

from collision_monitor import Box, Capsule, ConvexHull, Mesh, Pose
from collision_monitor.geometry.qhull import hull_vertices
from collision_monitor.objects.models import monitored_model
from collision_monitor.pipeline.model_message import decode_model, encode_model
from collision_monitor.records import Model


def compound() -> list[tuple[object, Pose]]:
    rng = np.random.default_rng(3)
    torus = trimesh.creation.torus(1.0, 0.3, major_sections=8, minor_sections=6)
    hull = ConvexHull(rng.normal(size=(9, 3)))
    shapes = [Mesh(torus.vertices, torus.faces), Box((1, 2, 3)), Capsule(0.1, 1 / 3), hull]
    quaternions = rng.normal(size=(4, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    return [(shape, Pose(rng.normal(size=3), q)) for shape, q in zip(shapes, quaternions, strict=True)]


@pytest.mark.parametrize("model", [Model.AUTO, Model.AABB, Model.SPHERE, Model.KDOP14, Model.CONVEX_DECOMPOSITION])
def test_a_model_comes_back_to_the_bit(model):
    found = monitored_model(compound()[:1] if model is Model.CONVEX_DECOMPOSITION else compound(), model)
    corners = [hull_vertices(piece.points) if isinstance(piece, ConvexHull) else None for piece, _ in found.pieces]
    found = found._replace(corners=tuple(corners))
    again = decode_model(encode_model(found))
    assert (again.shapes, again.model, again.convex) == (found.shapes, found.model, found.convex)
    assert np.float64(again.excess).tobytes() == np.float64(found.excess).tobytes()
    for (piece, pose), (piece_again, pose_again) in zip(found.pieces, again.pieces, strict=True):
        assert type(piece) is type(piece_again)
        assert pose.position.tobytes() == pose_again.position.tobytes()
        assert pose.quaternion.tobytes() == pose_again.quaternion.tobytes()
        assert not pose_again.position.flags.writeable
        for name in (field.name for field in fields(piece)):
            value, again_value = getattr(piece, name), getattr(piece_again, name)
            assert np.asarray(again_value).tobytes() == np.asarray(value).tobytes(), name
            assert isinstance(again_value, type(value)), name
    for corners_of_one, corners_again in zip(found.corners, again.corners, strict=True):
        np.testing.assert_array_equal(corners_of_one, corners_again)


def test_a_text_comes_back():
    assert decode_model(encode_model("no model: Ä")) == "no model: Ä"


@pytest.mark.parametrize("data", [b"", b"no model", encode_model("cut")[:-40]])
def test_other_bytes_raise_a_value_error(data):
    with pytest.raises(ValueError, match=r"expected a model|pickled|magic"):
        decode_model(data)
