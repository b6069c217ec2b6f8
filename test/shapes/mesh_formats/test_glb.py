"""GLB: all parts of a scene, and files that are cut, compressed or stand for far more than they hold."""

from __future__ import annotations

import base64
import struct
from typing import Any

import numpy as np
import pytest
from mesh_files import CUBE, CUBE_QUADS, glb, gltf_mesh, soup, volume
from processor_time import within
from scipy.spatial.transform import Rotation
from session_child import reset, resident

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.glb import read_glb

POINTS, FACES = soup(5)
CUBE_FACES = np.array([[quad[i] for i in corners] for quad in CUBE_QUADS for corners in ([0, 1, 2], [0, 2, 3])])


def read(content: dict[str, Any], binary: bytes = b"") -> Any:
    return read_glb(glb(content, binary))


def test_one_mesh() -> None:
    mesh = read(*gltf_mesh(POINTS, FACES))
    np.testing.assert_array_equal(mesh.vertices, POINTS)
    np.testing.assert_array_equal(mesh.faces, FACES)


def test_nodes_place_a_mesh_by_matrices_and_by_parts() -> None:
    """Also mirrored: the faces stay counter-clockwise from outside, as the specification says."""
    q, t, s = Rotation.random(random_state=1).as_quat(), (1.0, 2.0, 3.0), (2.0, 1.0, -0.5)
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = Rotation.from_quat(q).as_matrix() * s, t
    nodes = [
        {"children": [1, 2], "translation": [10, 0, 0]},
        {"mesh": 0, "rotation": q.tolist(), "translation": t, "scale": s},
        {"mesh": 0, "matrix": X.T.reshape(-1).tolist(), "camera": 0},
    ]
    content, binary = gltf_mesh(CUBE, CUBE_FACES, nodes=nodes)
    mesh = read(content, binary)
    expected = CUBE @ X[:3, :3].T + X[:3, 3] + (10, 0, 0)
    for part in (mesh.vertices[:8], mesh.vertices[8:]):
        np.testing.assert_allclose(part, expected, atol=1e-6)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(2.0, rel=1e-6)
    for without in ("scenes", "scene"):  # then the nodes without a parent are the roots, or the first scene counts
        del content[without]
        assert len(read(content, binary).faces) == 24
    del content["nodes"]
    assert len(read(content, binary).faces) == 12


def test_strips_fans_and_lists_without_indices() -> None:
    content, binary = gltf_mesh(POINTS, np.arange(6))
    primitive = content["meshes"][0]["primitives"][0]
    for mode, faces in (
        (5, [[0, 1, 2], [3, 2, 1], [2, 3, 4], [5, 4, 3]]),
        (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0], [4, 5, 0]]),
    ):
        primitive["mode"] = mode
        assert read(content, binary).faces.tolist() == faces
    for mode in (0, 1, 2, 3):
        primitive["mode"] = mode
        assert not len(read(content, binary).faces)
    content, binary = gltf_mesh(POINTS[:39], np.arange(3))
    del content["meshes"][0]["primitives"][0]["indices"]
    assert read(content, binary).faces.tolist() == np.arange(39).reshape(-1, 3).tolist()


def test_numbers_may_be_interleaved_quantised_changed_one_by_one_or_in_base64() -> None:
    grid = np.random.default_rng(0).integers(-32767, 32768, (40, 3)).astype("<i2")
    rows = np.zeros((40, 4), "<i2")  # stride 8, two bytes of padding
    rows[:, :3] = grid
    content, binary = gltf_mesh(POINTS, FACES)
    corners = binary[POINTS.size * 4 :]
    content["accessors"][0] |= {"componentType": 5122, "normalized": True}
    content["bufferViews"] = [
        {"buffer": 0, "byteOffset": 0, "byteLength": rows.nbytes, "byteStride": 8},
        {"buffer": 0, "byteOffset": rows.nbytes, "byteLength": len(corners)},
    ]
    content["buffers"] = [{"byteLength": rows.nbytes + len(corners)}]
    content["extensionsRequired"] = ["KHR_mesh_quantization"]
    mesh = read(content, rows.tobytes() + corners)
    np.testing.assert_allclose(mesh.vertices, np.maximum(grid / 32767, -1), rtol=1e-12)

    content, binary = gltf_mesh(POINTS, FACES)
    changed = np.array([3, 17], "<u2").tobytes() + np.ones((2, 3), "<f4").tobytes()
    content["bufferViews"] += [
        {"buffer": 0, "byteOffset": len(binary), "byteLength": 4},
        {"buffer": 0, "byteOffset": len(binary) + 4, "byteLength": 24},
    ]
    content["buffers"] = [{"byteLength": len(binary) + len(changed)}]
    content["accessors"][0]["sparse"] = {
        "count": 2, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 3},
    }  # fmt: skip
    expected = POINTS.copy()
    expected[[3, 17]] = 1
    np.testing.assert_array_equal(read(content, binary + changed).vertices, expected)
    del content["accessors"][0]["bufferView"]  # then the others are zeros
    np.testing.assert_array_equal(
        read(content, binary + changed).vertices, np.where(expected == 1, 1, 0) * (expected == 1)
    )

    content, binary = gltf_mesh(POINTS, FACES)
    content["buffers"] = [
        {"byteLength": len(binary), "uri": "data:application/octet-stream;base64," + base64.b64encode(binary).decode()}
    ]
    np.testing.assert_array_equal(read(content).vertices, POINTS)


def test_weights_of_a_mesh_move_its_vertices() -> None:
    content, binary = gltf_mesh(POINTS, FACES)
    content["meshes"][0] |= {"weights": [0.5]}
    content["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}]
    np.testing.assert_array_equal(read(content, binary).vertices, 1.5 * POINTS)


def changed(**changes: Any) -> tuple[dict[str, Any], bytes]:
    content, binary = gltf_mesh(POINTS, FACES)
    for path, value in changes.items():
        at: Any = content
        *keys, last = path.split("__")
        for key in keys:
            at = at[int(key) if key.isdigit() else key]
        at[int(last) if last.isdigit() else last] = value
    return content, binary


SILENT = {
    "compression": (changed(extensionsRequired=["KHR_draco_mesh_compression"]), "got the extension KHR_draco"),
    "an accessor without numbers": (changed(accessors__0={"componentType": 5126, "count": 9, "type": "VEC3"}),
                                    "accessor 0: expected a view of a buffer, got none for its 9 values"),
    "instances of an extension": (changed(nodes__0={"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {}}}),
                                  "got the extension EXT_mesh_gpu_instancing"),
    "a skin": (changed(nodes__0={"mesh": 0, "skin": 0}), "expected a rigid mesh"),
    "another file": (changed(buffers__0={"uri": "other.bin", "byteLength": 9}), "got those of other.bin"),
    "two parents": (changed(nodes=[{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}]), "got node 2 at two places"),
    "a loop": (changed(nodes=[{"children": [1], "mesh": 0}, {"children": [0]}]), "got node 0 at two places"),
    "a corner out of range": (changed(accessors__0__count=3), "expected corners from 0 to 2"),
    "a view beyond the buffer": (changed(bufferViews__1__byteLength=10**6), "view 1: expected"),
    "an accessor beyond its view": (changed(accessors__1__count=10**9), "view 1: expected 4000000000 bytes"),
    "an offset before the view": (changed(accessors__1__byteOffset=-4), "view 1: expected"),
    "a wrong mode": (changed(meshes__0__primitives__0__mode=7), "expected a mode from 0 to 6, got 7"),
    "a mesh before the first one": (changed(nodes__0__mesh=-1), "expected the number of one of 1 meshes, got -1"),
    "a scene before the first one": (changed(scene=-1), "scenes, got -1"),
    "a node before the first one": (changed(scenes__0__nodes=[-1]), "nodes, got -1"),
    "an accessor before the first one": (changed(meshes__0__primitives__0__indices=-1), "accessors, got -1"),
    "a buffer before the first one": (changed(bufferViews__0__buffer=-1), "of 1 buffers, got -1"),
    "a number as a text": (changed(nodes__0__mesh="0"), "of 1 meshes, got '0'"),
    "a change before the first value": (changed(accessors__0__sparse={
        "count": 1, "indices": {"bufferView": 0, "componentType": 5120, "byteOffset": 3}, "values": {"bufferView": 0},
    }), "accessor 0: expected changes of its"),
    "a buffer of more than is there": (changed(buffers__0__byteLength=10**9), "buffer 0: expected 1000000000 bytes"),
    "a buffer of less than its views": (changed(buffers__0__byteLength=4), "view 0: expected"),
    "two corners": (changed(accessors__1__count=179), "three corners for each triangle, got 179"),
}  # fmt: skip


@pytest.mark.parametrize("kind", SILENT)
def test_what_cannot_be_read_is_named_and_not_left_out(kind: str) -> None:
    (content, binary), reason = SILENT[kind]
    with pytest.raises(ShapeError) as caught:
        read(content, binary)
    assert reason in str(caught.value)


def test_a_file_that_is_cut_or_has_bytes_behind_its_end_is_refused() -> None:
    data = glb(*gltf_mesh(POINTS, FACES))
    for end in (*range(0, 60), len(data) // 2, len(data) - 1):
        with pytest.raises(ShapeError):
            read_glb(data[:end])
    with pytest.raises(ShapeError, match="3 bytes are behind its end"):
        read_glb(data + b"end")
    with pytest.raises(ShapeError, match="version 1"):
        read_glb(data[:4] + struct.pack("<I", 1) + data[8:])


def sparse_bomb() -> tuple[dict[str, Any], bytes]:
    content, binary = gltf_mesh(POINTS, FACES)
    content["accessors"] += [{
        "componentType": 5126, "count": 30_000_000, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5125}, "values": {"bufferView": 0}},
    }]  # fmt: skip
    content["meshes"][0]["primitives"] = [{"attributes": {"POSITION": 2}}]
    return content, binary


def repeated(vertices: int, count: int, **mesh: Any) -> tuple[dict[str, Any], bytes]:
    content, binary = gltf_mesh(*soup(0, vertices, vertices))
    content["nodes"] = [{"mesh": 0} for _ in range(count)]
    content["scenes"] = [{"nodes": list(range(count))}]
    content["meshes"][0]["primitives"] *= mesh.get("primitives", 1)
    return content, binary


BOMBS = {
    "855 MB": lambda: (gltf_mesh(POINTS, FACES)[0] | {"accessors": [
        {"componentType": 5126, "count": 35_000_000, "type": "VEC3"},
        {"componentType": 5125, "count": 3, "type": "SCALAR"},
    ]}, b""),
    "values that are changed one by one": sparse_bomb,
    "a mesh at many places": lambda: repeated(2000, 5000),
    "many parts of a mesh": lambda: repeated(2000, 3, primitives=10_000),
    "empty parts without end": lambda: (
        gltf_mesh(POINTS[:3], np.zeros(0, int))[0]
        | {"nodes": [{"mesh": 0}] * 20_000, "scenes": [{"nodes": list(range(20_000))}],
           "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}] * 20_000}]},
        gltf_mesh(POINTS[:3], np.zeros(0, int))[1],
    ),
    "children without end": lambda: (changed(nodes=[{"children": [1] * 2_000_000}, {"mesh": 0}])[0], b""),
}  # fmt: skip


@pytest.mark.parametrize("kind", BOMBS)
def test_a_bomb_takes_little_time_and_memory(kind: str) -> None:
    data = glb(*BOMBS[kind]())
    read(*gltf_mesh(POINTS, FACES))
    reset()
    before = resident()
    with within(5.0, kind), pytest.raises(ShapeError, match="expected"):
        read_glb(data)
    assert resident() - before < 256
