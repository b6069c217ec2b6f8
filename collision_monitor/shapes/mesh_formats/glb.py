"""GLB: glTF 2.0 in one binary file. A JSON text describes a scene of meshes, whose numbers follow in one block.

Source: Khronos, glTF 2.0 Specification (ISO/IEC 12113:2022).
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.shapes.mesh_formats.raw_mesh import Array, Indices, MeshParts, RawMesh
from collision_monitor.shapes.pose import rotation_matrix

_HEAD: Final = struct.Struct("<4sII")
_CHUNK: Final = struct.Struct("<I4s")

LARGEST_JSON: Final = 16 << 20
"""Bytes of the text. A scene with 10,000 parts has 5 MB."""

_FREE_VALUES: Final = 1 << 17
"""Values that an accessor without a buffer may have, whatever the size of the file: they are zeros."""

_TYPES: Final = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

_POINTS, _TRIANGLES, _STRIP, _FAN = 0, 4, 5, 6
_WITHOUT_SURFACE: Final = range(_POINTS, _TRIANGLES)
"""Modes of points and lines."""

_HARMLESS: Final = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")
"""How the extensions begin that change no surface, or only the types of its numbers."""

_INSTANCES: Final = "EXT_mesh_gpu_instancing"


def read_glb(data: bytes) -> RawMesh:
    """Return all meshes of the scene of a file, in the scene's frame. Raises ShapeError."""
    content, binary = _chunks(data)
    required = [name for name in content.get("extensionsRequired", ()) if not str(name).startswith(_HARMLESS)]
    if required:
        raise ShapeError(f"expected a file without compression, got the extension {required[0]!s:.80}; export it plain")
    return _Scene(content, binary, len(data)).mesh()


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON object and the binary chunk."""
    if len(data) < _HEAD.size + _CHUNK.size:
        raise ShapeError(f"expected the head of a GLB file, got {len(data)} bytes")
    magic, version, length = _HEAD.unpack_from(data)
    if magic != b"glTF" or version != 2:
        raise ShapeError(f"expected a GLB file of version 2, got {magic!r} of version {version}")
    if length != len(data):
        what = "it is cut off" if len(data) < length else f"{len(data) - length} bytes are behind its end"
        raise ShapeError(f"expected {length} bytes, as its head says, got {len(data)}: {what}")
    found: dict[bytes, bytes] = {}
    at = _HEAD.size
    while at < length:
        if at + _CHUNK.size > length:
            raise ShapeError(f"expected the head of a chunk at byte {at}, got the end of the file")
        size, kind = _CHUNK.unpack_from(data, at)
        at += _CHUNK.size
        if size > length - at:
            raise ShapeError(f"expected a chunk of {size} bytes at byte {at}, got {length - at}")
        if kind == b"JSON" and size > LARGEST_JSON:
            raise ShapeError(f"expected a description of at most {LARGEST_JSON} bytes, got {size}")
        found.setdefault(kind, data[at : at + size])
        at += size
    try:
        content = json.loads(found.get(b"JSON", b"").decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ShapeError(f"expected a description in JSON, got: {error!s:.100}") from None
    if not isinstance(content, dict):
        raise ShapeError(f"expected a description as a JSON object, got {content!r:.80}")
    return content, found.get(b"BIN\0", b"")


def _at(found: Any, number: Any, what: str) -> Any:
    """Return an element of a list of the file by its number. Raises ShapeError; Python would count -1 from the end."""
    if not (isinstance(number, int) and isinstance(found, list) and 0 <= number < len(found)):
        there = f"of {len(found)}" if isinstance(found, list) else "of none"
        raise ShapeError(f"expected the number of one {there} {what}, got {number!r:.80}")
    return found[number]


class _Scene:
    """The tree of a file's nodes, and its meshes."""

    def __init__(self, content: dict[str, Any], binary: bytes, size: int) -> None:
        self._content, self._binary = content, binary
        self._parts = MeshParts(size)
        self._most_values = max(_FREE_VALUES, size)
        self._array = cache(self._read_array)
        self._buffer = cache(self._read_buffer)

    def mesh(self) -> RawMesh:
        nodes = self._content.get("nodes", [])
        scenes = self._content.get("scenes", [])
        if not nodes:
            for number in range(len(self._content.get("meshes", []))):
                self._place(number, np.eye(4))
        elif scenes:
            self._walk(_at(scenes, self._content.get("scene", 0), "scenes").get("nodes", []))
        else:
            below = {child for node in nodes for child in node.get("children", ())}
            self._walk([number for number in range(len(nodes)) if number not in below])
        return self._parts.mesh()

    def _walk(self, roots: list[int]) -> None:
        """Place the meshes of all nodes below the roots."""
        nodes = self._content["nodes"]
        waiting = [(number, np.eye(4)) for number in roots]
        seen: set[int] = set()
        while waiting:
            number, X_SP = waiting.pop()
            if number in seen:
                raise ShapeError(f"expected a tree of nodes, got node {number} at two places")
            seen.add(number)
            node = _at(nodes, number, "nodes")
            X_SN = X_SP @ _pose_of(node)
            if _INSTANCES in node.get("extensions", {}):
                raise ShapeError(f"node {number}: expected a plain node, got the extension {_INSTANCES}")
            if "mesh" in node:
                if "skin" in node:
                    raise ShapeError(f"node {number}: expected a rigid mesh, got one with a skin")
                self._place(node["mesh"], X_SN)
            children = node.get("children", ())
            if len(children) > len(nodes):
                raise ShapeError(f"node {number}: expected at most {len(nodes)} children, got {len(children)}")
            waiting += [(child, X_SN) for child in children]

    def _place(self, number: int, X_SN: Array) -> None:
        for vertices, faces in self._primitives(number):
            self._parts.add(vertices, faces, X_SN)

    def _primitives(self, number: int) -> Iterator[tuple[Array, Indices]]:
        """Yield the parts of a mesh."""
        mesh = _at(self._content.get("meshes"), number, "meshes")
        weights = mesh.get("weights", ())
        for primitive in mesh["primitives"]:
            mode = primitive.get("mode", _TRIANGLES)
            if mode in _WITHOUT_SURFACE:
                continue
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                raise ShapeError(f"mesh {number}: expected a mode from 0 to 6, got {mode!r:.80}")
            vertices = self._positions(primitive["attributes"]["POSITION"])
            for weight, target in zip(weights, primitive.get("targets", ()), strict=False):
                if weight and "POSITION" in target:
                    vertices = vertices + weight * self._positions(target["POSITION"])
            if "indices" in primitive:
                corners = self._array(primitive["indices"]).reshape(-1).astype(np.int64)
            else:
                corners = np.arange(len(vertices))
            yield vertices, _triangles(corners, mode)

    def _positions(self, number: int) -> Array:
        values = self._array(number)
        if values.ndim != 2 or values.shape[1] != 3:
            raise ShapeError(f"accessor {number}: expected positions (n, 3), got {values.shape}")
        return values.astype(np.float64)

    def _read_array(self, number: int) -> NDArray[Any]:
        """Return the values (n, width) of an accessor, with those that are changed one by one (sparse)."""
        accessor = _at(self._content.get("accessors"), number, "accessors")
        kind, width, count = (
            np.dtype("<" + _TYPES[accessor["componentType"]]),
            _WIDTHS[accessor["type"]],
            accessor["count"],
        )
        if not (isinstance(count, int) and count >= 0):
            raise ShapeError(f"accessor {number}: expected a count, got {count!r:.80}")
        sparse = accessor.get("sparse")
        if "bufferView" in accessor:
            values = self._values(accessor["bufferView"], accessor.get("byteOffset", 0), kind, count, width)
        elif sparse is None or count > self._most_values:
            raise ShapeError(f"accessor {number}: expected a view of a buffer, got none for its {count} values")
        else:
            values = np.zeros((count, width), kind)
        if sparse is not None:
            values = values.copy()
            where, what, changed = sparse["indices"], sparse["values"], sparse["count"]
            index = np.dtype("<" + _TYPES[where["componentType"]])
            rows = self._values(where["bufferView"], where.get("byteOffset", 0), index, changed, 1).reshape(-1)
            if len(rows) and not (rows.min() >= 0 and rows.max() < count):
                raise ShapeError(f"accessor {number}: expected changes of its {count} values, got one of {rows.max()}")
            values[rows] = self._values(what["bufferView"], what.get("byteOffset", 0), kind, changed, width)
        if accessor.get("normalized") and kind.kind != "f":
            scaled = values / float(np.iinfo(kind).max)
            return np.maximum(scaled, -1.0)
        return values

    def _values(self, view: int, offset: int, kind: np.dtype[Any], count: int, width: int) -> NDArray[Any]:
        """Return numbers (count, width) of a view of a buffer, from a byte offset on."""
        found = _at(self._content.get("bufferViews"), view, "views of buffers")
        buffer = self._buffer(found["buffer"])
        begin, size, row = found.get("byteOffset", 0), found["byteLength"], kind.itemsize * width
        stride = found.get("byteStride", row)
        needed = offset + (count - 1) * stride + row if count else 0
        if not (begin >= 0 and 0 <= size <= len(buffer) - begin and offset >= 0 and row <= stride and needed <= size):
            raise ShapeError(
                f"view {view}: expected {needed} bytes for {count} values, got {size} of a buffer of {len(buffer)}"
            )
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, buffer, begin + offset, (stride, kind.itemsize))

    def _read_buffer(self, number: int) -> bytes:
        """Return the bytes of a buffer, as many as it states."""
        buffer = _at(self._content.get("buffers"), number, "buffers")
        there, stated = self._stored(buffer.get("uri"), number), buffer["byteLength"]
        if not (isinstance(stated, int) and 0 <= stated <= len(there)):
            raise ShapeError(f"buffer {number}: expected {stated!r:.80} bytes, as it states, got {len(there)}")
        return there[:stated]

    def _stored(self, uri: Any, number: int) -> bytes:
        """Return the binary chunk, which up to 3 bytes fill up, or what a text in base64 holds."""
        if uri is None:
            if number:
                raise ShapeError(f"buffer {number}: expected its bytes in the file, got none")
            return self._binary
        head, _, text = str(uri).partition(",")
        if not (head.startswith("data:") and head.endswith(";base64")):
            raise ShapeError(f"buffer {number}: expected its bytes in the file, got those of {uri!s:.80}")
        try:
            return base64.b64decode(text, validate=True)
        except binascii.Error as error:
            raise ShapeError(f"buffer {number}: expected base64, got: {error}") from None


def _triangles(corners: Indices, mode: int) -> Indices:
    """Return the triangles (m, 3) of a list, a strip or a fan of corners."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise ShapeError(f"expected three corners for each triangle, got {len(corners)}")
        return corners.reshape(-1, 3)
    first = np.arange(max(len(corners) - 2, 0))
    if mode == _FAN:
        return np.stack([corners[first + 1], corners[first + 2], np.repeat(corners[:1], len(first))], axis=1)
    triangles = np.stack([corners[first], corners[first + 1], corners[first + 2]], axis=1)
    triangles[1::2] = triangles[1::2, ::-1]
    return triangles


def _pose_of(node: dict[str, Any]) -> Array:
    """Return X_PN (4, 4): the pose and the scale of a node in its parent's frame."""
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    X = np.eye(4)
    x, y, z, w = map(float, node.get("rotation", (0.0, 0.0, 0.0, 1.0)))
    length = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not 0.9 < length < 1.1:
        raise ShapeError(f"expected a node with a rotation of unit length, got {[x, y, z, w]}")
    X[:3, :3] = rotation_matrix(np.array([x, y, z, w]) / length) * np.array(node.get("scale", (1.0, 1.0, 1.0)), float)
    X[:3, 3] = np.array(node.get("translation", (0.0, 0.0, 0.0)), np.float64)
    return X
