"""Random meshes, and writers of mesh files that know nothing of the readers that they test."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_QUADS = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
"""Counter-clockwise from outside."""


def soup(seed: int, vertices: int = 40, faces: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Vertices that float32 holds, and triangles of three different ones."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2, 2, (vertices, 3)).astype(np.float32).astype(np.float64)
    return points, np.array([rng.choice(vertices, 3, replace=False) for _ in range(faces)])


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Signed volume of closed surfaces: positive if the faces are counter-clockwise from outside."""
    return float(np.linalg.det(vertices[faces]).sum() / 6)


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def stl(vertices: np.ndarray, faces: np.ndarray, head: bytes = b"head") -> bytes:
    rows = [struct.pack("<12fH", 0, 0, 0, *vertices[face].reshape(-1), 0) for face in faces]
    return head.ljust(80, b"\0") + struct.pack("<I", len(faces)) + b"".join(rows)


def stl_text(vertices: np.ndarray, faces: np.ndarray, name: str = "part") -> str:
    lines = [f"solid {name}"]
    for face in faces:
        lines += [" facet normal 0 0 1", "  outer loop"]
        lines += [f"   vertex {x!r} {y!r} {z!r}" for x, y, z in vertices[face].tolist()]
        lines += ["  endloop", " endfacet"]
    return "\n".join([*lines, f"endsolid {name}\n"])


def glb(content: dict[str, Any], binary: bytes = b"") -> bytes:
    """A GLB file of a description and its numbers."""
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def gltf_mesh(vertices: np.ndarray, faces: np.ndarray, **changes: Any) -> tuple[dict[str, Any], bytes]:
    """Description and numbers of one mesh in one node."""
    points, corners = vertices.astype("<f4").tobytes(), faces.astype("<u4").tobytes()
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(corners)},
        ],
        "buffers": [{"byteLength": len(points) + len(corners)}],
        **changes,
    }
    return content, points + corners


def dae(
    geometry: str, nodes: str = '<node><instance_geometry url="#g"/></node>', more: str = "", unit: str = "1"
) -> bytes:
    """A COLLADA file of the inside of a <mesh>, and of the nodes of its scene."""
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="x" meter="{unit}"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>{geometry}</mesh></geometry></library_geometries>{more}
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>""".encode()


def dae_points(vertices: np.ndarray) -> str:
    """The source and the vertices of a mesh."""
    numbers = " ".join(map(repr, vertices.reshape(-1).tolist()))
    return (
        f'<source id="p"><float_array id="a" count="{vertices.size}">{numbers}</float_array><technique_common>'
        f'<accessor source="#a" count="{len(vertices)}" stride="3"><param name="X"/><param name="Y"/><param name="Z"/>'
        '</accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
    )


def write(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path
