"""Octrees: written here by recursion over nested lists, against the voxels that the source makes of them."""

from __future__ import annotations

import math
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fed import Fed
from foreign_bag import START
from foreign_messages import octomap

from collision_monitor.objects.description import ObjectDescription

MAP = {"map": {"topic": "/octomap"}}
FREE, OCCUPIED = 0, 1
Tree = Any
"""None: unknown; FREE, OCCUPIED: a leaf; a list of eight: an inner node."""


def random_tree(rng: Any, depth: int) -> Tree:
    if depth and rng.random() < 0.55:
        children = [random_tree(rng, depth - 1) for _ in range(8)]
        return None if all(child is None for child in children) else children  # an inner node has a child
    return rng.choice([None, FREE, OCCUPIED], p=[0.4, 0.3, 0.3])


def sparse_tree(rng: Any, levels: int) -> list[Tree]:
    """A tree of some levels on the way to which each node has one child that matters."""
    node: list[Tree] = [OCCUPIED, *(random_tree(rng, 3) for _ in range(7))]
    for _ in range(levels):
        above: list[Tree] = [rng.choice([None, FREE, OCCUPIED]) for _ in range(8)]
        above[rng.integers(8)] = node
        node = above
    return node


def binary(node: list[Tree]) -> bytes:
    word = sum((0 if c is None else 3 if isinstance(c, list) else 1 + int(c)) << (2 * k) for k, c in enumerate(node))
    return word.to_bytes(2, "little") + b"".join(binary(child) for child in node if isinstance(child, list))


def full(node: Tree, odds: Any, colour: bytes = b"") -> bytes:
    children = node if isinstance(node, list) else [None] * 8
    value = 0.0 if isinstance(node, list) else odds(node)
    mask = sum(1 << k for k, child in enumerate(children) if child is not None)
    head = struct.pack("<f", value) + colour + bytes([mask])
    return head + b"".join(full(child, odds, colour) for child in children if child is not None)


def leaves(node: Tree, low: Any = (-(1 << 15),) * 3, edge: int = 1 << 16) -> list[tuple[int, ...]]:
    """Lower corners and edges of the occupied leaves, in cells."""
    if not isinstance(node, list):
        return [(*low, edge)] if node == OCCUPIED else []
    half, found = edge // 2, []
    for k, child in enumerate(node):
        corner = tuple(low[axis] + half * (k >> axis & 1) for axis in range(3))
        found += leaves(child, corner, half)
    return found


def voxels_of(fed: Fed) -> Any:
    (change,) = fed.changes
    assert isinstance(change, ObjectDescription) and change.static and not fed.refused
    ((shape, _),) = change.shapes
    return shape


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("kind", ["binary", "OcTree", "ColorOcTree"])
def test_occupied_leaves_are_voxels(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = sparse_tree(rng, int(rng.integers(9, 13)))  # leaves of up to 64 cells
    tree = [child if isinstance(child, list) else None for child in tree]
    while sum(6 * edge**2 for *_, edge in leaves(tree)) > 1e6 or not leaves(tree):
        tree = _without_large(sparse_tree(rng, 12))
    values = {FREE: -0.4, OCCUPIED: 0.0 if kind == "OcTree" else 3.5}  # a probability of 0.5 is occupied
    colour = b"\x01\x02\x03" if kind == "ColorOcTree" else b""
    data = binary(tree) if kind == "binary" else full(tree, values.get, colour)
    fed = Fed(MAP)
    fed.give(
        "/octomap", START, octomap("map", START, data, binary=kind == "binary", id=kind.replace("binary", "OcTree"))
    )
    found = voxels_of(fed)
    assert found.resolution == pytest.approx(0.1)
    assert sorted(map(tuple, np.column_stack([found.cells, found.edges]).tolist())) == sorted(leaves(tree))


def _without_large(node: Tree, edge: int = 1 << 16) -> Tree:
    if not isinstance(node, list):
        return node if edge <= 32 else None
    return [_without_large(child, edge // 2) for child in node]


def test_a_threshold_is_a_probability_and_an_empty_map_removes_the_object() -> None:
    node: Tree = [OCCUPIED, FREE, None, None, None, None, None, None]
    for _ in range(15):
        node = [node, *[None] * 7]
    odds = {OCCUPIED: math.log(0.7 / 0.3), FREE: math.log(0.6 / 0.4)}
    data = full(node, odds.get)
    for threshold, count in ((0.55, 2), (0.65, 1)):
        fed = Fed({"map": {**MAP["map"], "threshold": threshold}})
        fed.give("/octomap", START, octomap("map", START, data, binary=False, id="OcTree"))
        assert len(voxels_of(fed).cells) == count
    fed.give("/octomap", START + 1, octomap("map", START + 1, b"\0\0", binary=True, id="OcTree"))
    assert len(fed.changes) == 2 and not isinstance(fed.changes[-1], ObjectDescription)
    (problem,) = Fed({"map": {**MAP["map"], "threshold": 1}}).feed.bind("/octomap", "octomap_msgs/msg/Octomap").values()
    assert "map, threshold: expected a probability below 1, got 1" in problem


def _nested(levels: int) -> bytes:
    return b"\x03\x00" * levels + b"\x02\x00"


@pytest.mark.parametrize(
    ("data", "is_binary", "kind", "text"),
    [
        (_nested(15)[:-1], True, "OcTree", "data: expected a whole octree, got 31 bytes of it: it is cut"),
        (b"\x03", True, "OcTree", "it is cut"),
        (_nested(100), True, "OcTree", "data: expected 16 levels, got more at byte 32"),
        ((b"\0\0\0\0\x01") * 100, False, "OcTree", "data: expected 16 levels, got more at byte 85"),
        (_nested(15) + b"\0", True, "OcTree", "data: expected the end at byte 32, got 33 bytes"),
        (b"\0\0\0", False, "OcTree", "it is cut"),
        (b"\0\0\0\0\0", False, "CountingOcTree", "id: expected OcTree, OcTreeStamped, ColorOcTree in a full map"),
        (b"\x02\0", True, "OcTree", "Voxels edges: expected leaves of at most 12000000 unit faces"),
    ],
)
def test_a_damaged_octree_is_refused(data: bytes, is_binary: bool, kind: str, text: str) -> None:
    fed = Fed(MAP)
    fed.give("/octomap", START, octomap("map", START, data, binary=is_binary, id=kind))
    assert not fed.changes and any(text in each for each in fed.refused), list(fed.refused)


@pytest.mark.parametrize("resolution", [0.0, math.nan, -1.0, 1e300])
def test_a_resolution_that_is_none_is_refused(resolution: float) -> None:
    fed = Fed(MAP)
    fed.give("/octomap", START, octomap("map", START, _nested(15), resolution, binary=True, id="OcTree"))
    assert not fed.changes and any("Voxels" in each for each in fed.refused), list(fed.refused)


def test_random_bytes_are_an_octree_or_refused() -> None:
    rng = np.random.default_rng(7)
    for k in range(300):
        fed = Fed(MAP)
        data = rng.integers(0, 256, rng.integers(0, 400), np.uint8).tobytes()
        fed.give("/octomap", START, octomap("map", START, data, binary=bool(k % 2), id="OcTree"))
        assert bool(fed.changes) + bool(fed.refused) <= 1


LOADED = """
from fed import Fed
from collision_monitor.sources.messages.octomap_leaves import _read_binary, _read_full
fed = Fed({"map": {"topic": "/map"}})
for problem in fed.feed.bind("/map", "%s").values():
    raise SystemExit(problem)
print([len(each.overloads) for each in (_read_binary, _read_full)])
"""


@pytest.mark.parametrize("message", ["octomap_msgs/msg/Octomap", "moveit_msgs/msg/PlanningScene"])
def test_the_readers_are_loaded_before_a_message_arrives(message: str) -> None:
    """Else the first octomap of a scene held a new machine for as long as they take to compile."""
    done = subprocess.run(
        [sys.executable, "-c", LOADED % message],
        cwd=Path(__file__).parents[1] / "helpers",
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True, text=True, timeout=300.0,
    )  # fmt: skip
    assert done.stdout.strip() == "[1, 1]", done.stderr[-1500:]
