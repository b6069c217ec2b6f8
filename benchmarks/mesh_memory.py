"""Measure the memory of meshes beside FCL and Coal: that which a mesh keeps, and the most while it is made.

    python benchmarks/mesh_memory.py             terrains of 100,000 and 1,000,000 triangles

Each model is made in a process of its own, after a small one that loads the code. The user's arrays count for none.
"mesh": a Mesh with its tree; "monitor": a monitor with it besides. Coal is installed by `make bench-peers`. Linux only.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]
PEERS = ROOT / ".venv-peers" / "bin" / "python"
SIDES = (225, 708)
"""Vertices along each side of the terrains."""


def terrain(n: int) -> tuple[Any, Any]:
    """Vertices (n^2, 3) in m and faces (2 (n - 1)^2, 3)."""
    x, y = np.meshgrid(np.linspace(-50, 50, n), np.linspace(-50, 50, n), indexing="ij")
    k = np.arange(n * n, dtype=np.int32).reshape(n, n)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], -1).reshape(-1, 4)
    height = 0.5 * np.sin(0.5 * x) * np.cos(0.4 * y)
    return np.stack([x, y, height], -1).reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def maker(kind: str) -> Callable[[Any, Any], Any]:
    """Function that makes a model of vertices and faces."""
    if kind == "fcl":
        import fcl

        def make_fcl(vertices: Any, faces: Any) -> Any:
            model = fcl.BVHModel()
            model.beginModel(len(vertices), len(faces))
            model.addSubModel(vertices, faces)
            model.endModel()
            return model

        return make_fcl
    if kind == "coal":
        import coal

        def make_coal(vertices: Any, faces: Any) -> Any:
            model = coal.BVHModelOBBRSS()
            model.beginModel(len(faces), len(vertices))
            model.addVertices(vertices)
            model.addTriangles(faces.astype(np.int64))
            model.endModel()
            return model

        return make_coal

    import collision_monitor as cm
    from collision_monitor.meshes.trees.shape_trees import shape_tree

    def make_mesh(vertices: Any, faces: Any) -> Any:
        mesh = cm.Mesh(vertices, faces)
        if kind == "mesh":
            return mesh, shape_tree(mesh)
        monitor = cm.Monitor()
        monitor.add(1, mesh, static=True, pose=cm.Pose())
        return monitor, mesh

    return make_mesh


def memory(field: str) -> int:
    """Bytes of this process: VmRSS now, or VmHWM at most since `clear_refs`."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(field))
    return int(line.split()[1]) * 1024


def measure(kind: str, n: int) -> None:
    """Print the figures of one model."""
    vertices, faces = terrain(n)
    make = maker(kind)
    small = make(vertices[faces[:8].ravel()], np.arange(24, dtype=np.int32).reshape(8, 3))
    before = memory("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")
    kept = make(vertices, faces)
    each, most = ((memory(field) - before) / len(faces) for field in ("VmRSS", "VmHWM"))
    print(f"{kind:8s} {len(faces):8d} triangles: {each:4.0f} bytes per triangle, {most:4.0f} at most")
    del small, kept


def main() -> int:
    """Measure each kind in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--one", nargs=2, metavar=("KIND", "N"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.one:
        measure(args.one[0], int(args.one[1]))
        return 0
    for n in SIDES:
        for kind in ("fcl", "coal", "mesh", "monitor"):
            if kind == "coal" and not PEERS.exists():
                continue
            python = str(PEERS) if kind == "coal" else sys.executable
            subprocess.run([python, "-W", "ignore", __file__, "--one", kind, str(n)], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
