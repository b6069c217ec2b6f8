"""COLLADA (.dae): an XML text with a scene of nodes, which place geometries, also more than once.

Source: Khronos, COLLADA 1.4.1 and 1.5 specifications, chapter 5. Morphs, motions of joints and other files are not
read. A skin is placed as it was bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from collision_monitor.errors import InputError, ShapeError
from collision_monitor.settings.xml_tree import Element, parse_xml
from collision_monitor.shapes.mesh_formats.faces import triangles_of
from collision_monitor.shapes.mesh_formats.raw_mesh import Array, Indices, MeshParts, RawMesh
from collision_monitor.shapes.pose import from_rotation_vector, rotation_matrix
from collision_monitor.tolerances import LARGEST_INPUT

Named = dict[tuple[str, str], list[Element]]
"""Elements by tag and id."""

MOST_NODES: Final = 100_000
"""Nodes of a scene, with those that it places many times."""

DEEPEST: Final = 200
"""Nodes within nodes."""

_WITHOUT_SURFACE: Final = ("lines", "linestrips")
_STRIPS: Final = ("tristrips", "trifans")
_POLYGONS: Final = ("triangles", "polylist", "polygons")


def read_dae(data: bytes) -> RawMesh:
    """Return all geometries of the scene of a file, in the scene's frame, with the file's unit. Raises ShapeError."""
    try:
        root = parse_xml(data, "XML", largest=len(data), contents=True)
        if root.tag != "COLLADA":
            raise root.error("expected <COLLADA> as the outermost element")
        return _Document(root, len(data)).mesh()
    except InputError as error:
        raise ShapeError(str(error).removeprefix("XML, ")) from None


class _Document:
    """The elements of a file by their ids."""

    def __init__(self, root: Element, size: int) -> None:
        self._root = root
        self._parts = MeshParts(size)
        self._nodes = 0
        self._meshes: dict[Element, list[tuple[Array, Indices]]] = {}
        self._named = _named_in(root)

    def mesh(self) -> RawMesh:
        asset = self._root.first("asset")
        unit = asset.first("unit") if asset is not None else None
        metres = 1.0 if unit is None else unit.number("meter", 1.0)
        if not 0.0 < metres <= LARGEST_INPUT:
            raise ShapeError(f"expected a positive length of the unit, got {metres:g}")
        for node in self._scene().all("node"):
            self._place(node, np.eye(4), 0)
        return self._parts.mesh(metres)

    def _scene(self) -> Element:
        """Return the scene that the file shows, or its only one."""
        scene = self._root.first("scene")
        instance = scene.first("instance_visual_scene") if scene is not None else None
        if instance is not None:
            return self._target(instance, "url", "visual_scene")
        library = self._root.first("library_visual_scenes")
        scenes = list(library.all("visual_scene")) if library is not None else []
        if len(scenes) != 1:
            raise ShapeError(f"expected a <scene>, or one <visual_scene>, got {len(scenes)}")
        return scenes[0]

    def _target(self, element: Element, key: str, tag: str, inner: Named | None = None) -> Element:
        """Return the element that an attribute names as `#id`. inner: those of its own mesh, which count first.

        Some exporters give the sources of all meshes the same ids.
        """
        address = element.text(key)
        wanted = tag, address.removeprefix("#")
        found = ((inner or {}).get(wanted) or self._named.get(wanted, [])) if address.startswith("#") else []
        if len(found) != 1:
            many = f", which {len(found)} have" if found else ""
            raise element.error(f"{key}: expected the id of one <{tag}> in the file, got {address!r:.80}{many}")
        return found[0]

    def _place(self, node: Element, X_SP: Array, depth: int) -> None:
        """Place the geometries of a node and of those in it. X_SP: the frame of its parent in the scene."""
        self._nodes += 1
        if self._nodes > MOST_NODES or depth > DEEPEST:
            raise node.error(f"expected at most {MOST_NODES} nodes, {DEEPEST} within each other, got more")
        X_SN = X_SP @ _pose_of(node)
        for child in node.children:
            if child.tag == "instance_geometry":
                self._add(self._target(child, "url", "geometry"), X_SN)
            elif child.tag == "instance_controller":
                self._add_skin(self._target(child, "url", "controller"), X_SN)
            elif child.tag == "instance_node":
                self._place(self._target(child, "url", "node"), X_SN, depth + 1)
            elif child.tag == "node":
                self._place(child, X_SN, depth + 1)

    def _add_skin(self, controller: Element, X_SN: Array) -> None:
        skin = controller.first("skin")
        if skin is None:
            raise controller.error("expected a <skin>, got another controller, which is not read")
        bind = skin.first("bind_shape_matrix")
        X_NB = np.eye(4) if bind is None else _numbers(bind, 16).reshape(4, 4)
        self._add(self._target(skin, "source", "geometry"), X_SN @ X_NB)

    def _add(self, geometry: Element, X_SN: Array) -> None:
        for child in geometry.children:
            if child.tag in ("mesh", "convex_mesh"):
                if child not in self._meshes:
                    self._meshes[child] = list(self._primitives(child))
                for vertices, faces in self._meshes[child]:
                    self._parts.add(vertices, faces, X_SN)
            elif child.tag not in ("asset", "extra"):
                raise child.error("expected <mesh>, which alone is read")

    def _primitives(self, mesh: Element) -> Iterator[tuple[Array, Indices]]:
        """Yield vertices and triangles of each primitive of a mesh."""
        vertices: dict[str, Array] = {}  # by the address of the source
        inner = _named_in(mesh)
        for primitive in mesh.children:
            if primitive.tag not in _POLYGONS + _STRIPS:
                if primitive.tag not in (*_WITHOUT_SURFACE, "source", "vertices", "extra"):
                    raise primitive.error("expected triangles, polygons, strips or fans, which alone are read")
                continue
            inputs = list(primitive.all("input"))
            offsets = [int(each.number("offset", 0.0)) for each in inputs]
            corner = next((k for k, each in enumerate(inputs) if each.attributes.get("semantic") == "VERTEX"), None)
            if corner is None:
                if primitive.number("count", 0.0) or primitive.first("p") is not None:
                    raise primitive.error("expected an <input> of VERTEX, got none")
                continue
            address = inputs[corner].text("source")
            if address not in vertices:
                vertices[address] = self._positions(inputs[corner], inner)
            counts, corners = _rings(primitive, offsets[corner], 1 + max(offsets))
            try:
                yield vertices[address], triangles_of(vertices[address], counts, corners)
            except ShapeError as error:
                raise primitive.error(str(error)) from None

    def _positions(self, corner: Element, inner: Named) -> Array:
        """Return the points (n, 3) that an input names."""
        vertices = self._target(corner, "source", "vertices", inner)
        found = next((each for each in vertices.all("input") if each.attributes.get("semantic") == "POSITION"), None)
        if found is None:
            raise vertices.error("expected an <input> of POSITION, got none")
        source = self._target(found, "source", "source", inner)
        common = source.first("technique_common")
        accessor = common.first("accessor") if common is not None else None
        if accessor is None:
            raise source.error("expected an <accessor>, got none")
        values = self._target(accessor, "source", "float_array", inner)
        numbers = _numbers(values, int(values.number("count")))
        count, stride, offset = (int(accessor.number(key, 0.0)) for key in ("count", "stride", "offset"))
        names = [each.attributes.get("name", "") for each in accessor.all("param")]
        columns = [names.index(axis) for axis in "XYZ"] if {"X", "Y", "Z"} <= set(names) else [0, 1, 2]
        if not (count >= 0 and stride > max(columns) and 0 <= offset <= len(numbers) - count * stride):
            raise accessor.error(f"expected {count} points of {stride} numbers, got {len(numbers)} numbers")
        return numbers[offset : offset + count * stride].reshape(count, stride)[:, columns]


def _named_in(top: Element) -> Named:
    """Return the elements in another one by their tags and ids."""
    found: Named = {}
    waiting = [top]
    while waiting:
        element = waiting.pop()
        if name := element.attributes.get("id"):
            found.setdefault((element.tag, name), []).append(element)
        waiting += element.children
    return found


def _rings(primitive: Element, corner: int, stride: int) -> tuple[Indices, Indices]:
    """Return the number of corners of each polygon, and the vertices of all corners.

    corner: place of the vertex among the `stride` indices of each corner.
    """
    if primitive.first("ph") is not None:
        raise primitive.error("expected polygons without holes, got <ph>")
    if corner < 0 or stride > 1000:
        raise primitive.error("expected offsets of inputs from 0 to 999")
    rows = []
    for each in primitive.all("p"):
        indices = _whole(each)
        if len(indices) % stride:
            raise each.error(f"expected {stride} indices for each corner, got {len(indices)}")
        rows.append(indices[corner::stride])
    none = np.zeros(0, np.int64)
    corners = np.concatenate([none, *rows])
    stated = int(primitive.number("count", float(len(rows))))
    if primitive.tag in _STRIPS:
        triangles = np.concatenate([none.reshape(0, 3), *(_strip(row, primitive.tag) for row in rows)])
        return np.full(len(triangles), 3), triangles.reshape(-1)
    if primitive.tag == "triangles":
        counts = np.full(len(corners) // 3, 3)
    elif primitive.tag == "polygons":
        counts = np.array([len(row) for row in rows], np.int64)
    else:
        lengths = primitive.first("vcount")
        counts = none if lengths is None else _whole(lengths)
    if len(counts) != stated or int(counts.sum()) != len(corners):
        raise primitive.error(
            f"expected {stated} faces with {counts.sum()} corners, got {len(counts)} with {len(corners)}"
        )
    return counts, corners


def _strip(row: Indices, tag: str) -> Indices:
    """Return the triangles (m, 3) of a strip or a fan of corners."""
    first = np.arange(max(len(row) - 2, 0))
    if tag == "trifans":
        return np.stack([np.repeat(row[:1], len(first)), row[first + 1], row[first + 2]], axis=1)
    triangles = np.stack([row[first], row[first + 1], row[first + 2]], axis=1)
    triangles[1::2] = triangles[1::2, ::-1]
    return triangles


def _pose_of(node: Element) -> Array:
    """Return X_PN (4, 4): the product of a node's transforms, in their order."""
    X = np.eye(4)
    for each in node.children:
        match each.tag:
            case "matrix":
                X = X @ _numbers(each, 16).reshape(4, 4)
            case "translate":
                step = np.eye(4)
                step[:3, 3] = _numbers(each, 3)
                X = X @ step
            case "rotate":
                axis = _numbers(each, 4)
                length = float(np.linalg.norm(axis[:3]))
                step = np.eye(4)
                turn = axis[:3] * (np.radians(axis[3]) / (length or 1.0))
                step[:3, :3] = rotation_matrix(from_rotation_vector(turn))
                X = X @ step
            case "scale":
                X = X @ np.diag([*_numbers(each, 3), 1.0])
            case "skew" | "lookat":
                raise each.error("expected matrix, translate, rotate or scale, which alone are read")
    return X


def _numbers(element: Element, count: int) -> Array:
    """Return the text of an element as `count` finite numbers."""
    try:
        found = np.array(element.content.split(), np.float64)
    except ValueError as error:
        raise element.error(f"expected numbers: {error!s:.100}") from None
    if found.shape != (count,) or not (np.abs(found) <= LARGEST_INPUT).all():
        raise element.error(f"expected {count} finite numbers, got {len(found)}")
    return found


def _whole(element: Element) -> Indices:
    """Return the text of an element as whole numbers."""
    try:
        return np.array(element.content.split(), np.int64)
    except (ValueError, OverflowError) as error:
        raise element.error(f"expected whole numbers: {error!s:.100}") from None
