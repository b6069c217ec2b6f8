"""Reads damaged copies of the files of others: bags, meshes, robot descriptions and YAML.

    make fuzz-inputs ARGS="--files 100000"
    python test/attacks/fuzz_inputs.py --files 1000 --seed 1 --kinds bag mesh
    python test/attacks/fuzz_inputs.py --only 4711      the file of one seed, kept, with what it led to

Each file is read within limits or refused with one line. A bag whose statistics are there gives as many messages as
they state. The seed alone determines the file.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final

HERE: Final = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(HERE.parents[1])]

import numpy as np  # noqa: E402
from foreign_bag import START, STORE, odometry, write_bag  # noqa: E402
from fuzz_sessions import print_problems  # noqa: E402
from mcap.writer import CompressionType, IndexType  # noqa: E402
from mesh_files import CUBE, CUBE_QUADS, glb, gltf_mesh, soup, stl, stl_text  # noqa: E402
from recorded_bags import KIND, ODOM, STEP, STILL, mcap, rows  # noqa: E402
from rosbags.rosbag1 import Writer as Ros1Writer  # noqa: E402
from rosbags.rosbag2 import StoragePlugin  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from collision_monitor.alerts.rules import Rules  # noqa: E402
from collision_monitor.errors import CollisionMonitorError  # noqa: E402
from collision_monitor.robots.robot import Description, Robot  # noqa: E402
from collision_monitor.settings.profile import Profile  # noqa: E402
from collision_monitor.shapes.mesh_file import load_mesh  # noqa: E402
from collision_monitor.sources.bag import Bag  # noqa: E402
from collision_monitor.sources.ground.mapping import load_mapping  # noqa: E402
from collision_monitor.sources.storage.bag_folder import read_bag_folder  # noqa: E402
from collision_monitor.tolerances import LARGEST_INPUT  # noqa: E402

SLOWEST: Final = 3.0
"""s of the processor for one file. Its base has at most 100 kB."""

LONGEST_ERROR: Final = 3000
"""Characters of a refusal."""

ROOT: Final = HERE.parents[1]
COUNT: Final = 40
"""Messages of each bag."""

NUMBERS: Final = (
    *(b"nan", b"-inf", b"1e999", b"-1", b"0", b"1e308", b"-0.0", b"4294967296", b"18446744073709551616", b"1e-320"),
    *(b"9" * 5000, b"0x7f", b"1_0", b"", b"1e18", b"2147483648", "\u0663".encode(), b"\0", b"true", b"~"),
)

WORDS: Final = (
    *(b"&a *a", b"!!python/object:os.system x", b"[" * 2000, b"{a: " * 500, b"<!DOCTYPE x [<!ENTITY y 'z'>]>", b"&y;"),
    *(b"<![CDATA[", b"../" * 50, "\u202egroß\u0000".encode(), b"\xff\xfe", b"x" * 20_000, b"$(find x)", b"${1/0}"),
    *(b"package://../../etc/passwd", b"<link name='x'/>", b"\r", b"\n", b"\x1b[31m"),
)


@dataclass
class Outcome:
    """What became of a file. problem: empty if it was answered within limits."""

    text: str
    problem: str = ""
    took: float = 0.0


@dataclass
class Found:
    """Outcomes by kind, and what is wrong by the seed of the file."""

    files: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    problems: dict[int, str] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, 0)


# -- files that are whole


def _bags(folder: Path) -> Iterator[tuple[str, bytes]]:
    options: list[dict[str, Any]] = [
        *({"chunk_size": 2000, "compression": each} for each in CompressionType),
        *({"chunk_size": 2000, "index_types": each} for each in (IndexType.NONE, IndexType.CHUNK, IndexType.MESSAGE)),
        *({"use_chunking": False, "use_statistics": each} for each in (True, False)),
        {"chunk_size": 2000, "use_statistics": False},
    ]
    for k, each in enumerate(options):
        yield ".mcap", mcap(folder / f"{k}.mcap", rows(COUNT), **each).read_bytes()
    messages = [(topic, stamp, (KIND, data)) for topic, stamp, data in rows(COUNT)]
    table = write_bag(folder / "table", messages, storage=StoragePlugin.SQLITE3)
    yield ".db3", next(table.glob("*.db3")).read_bytes()
    store = get_typestore(Stores.ROS1_NOETIC)
    for compression in (None, *Ros1Writer.CompressionFormat):
        path = folder / f"{compression}.bag"
        writer = Ros1Writer(path)
        if compression is not None:
            writer.set_compression(compression)
        with writer:
            odom = writer.add_connection(ODOM, KIND, typestore=store)
            for k in range(COUNT):
                kind, message = odometry("map", START + k * STEP, (k, 0, 0), *STILL)
                data = STORE.cdr_to_ros1(STORE.serialize_cdr(message, kind), kind)
                writer.write(odom, START + k * STEP, bytes(data))
        yield ".bag", path.read_bytes()


def _meshes(_: Path) -> Iterator[tuple[str, bytes]]:
    vertices, faces = soup(3, 12, 20)
    cube = np.array([[a, b, c] for a, b, c, d in CUBE_QUADS] + [[a, c, d] for a, b, c, d in CUBE_QUADS])
    yield ".stl", stl(CUBE, cube)
    yield ".stl", stl_text(CUBE, cube).encode()
    lines = [f"v {x} {y} {z}" for x, y, z in CUBE.tolist()] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in cube]
    yield ".obj", ("\n".join(lines) + "\n").encode()
    relative = [f"v {x} {y} {z}" for x, y, z in CUBE.tolist()] + [
        "f " + " ".join(str(i - len(CUBE)) for i in quad) for quad in CUBE_QUADS
    ]
    yield ".obj", ("\n".join(relative) + "\n").encode()
    head = f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    text = "\n".join([f"{x} {y} {z}" for x, y, z in vertices.tolist()] + [f"3 {a} {b} {c}" for a, b, c in faces])
    yield ".ply", (head + text + "\n").encode()
    binary = vertices.astype("<f4").tobytes() + b"".join(
        b"\x03" + np.array(face, "<i4").tobytes() for face in faces.tolist()
    )
    yield ".ply", head.replace("ascii", "binary_little_endian").encode() + binary
    yield ".glb", glb(*gltf_mesh(CUBE, cube))
    floats = " ".join(str(x) for x in CUBE.reshape(-1).tolist())
    corners = " ".join(str(i) for i in cube.reshape(-1).tolist())
    yield (
        ".dae",
        f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit name="meter" meter="1"/>
<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="p"><float_array id="f"
count="{CUBE.size}">{floats}</float_array><technique_common><accessor source="#f" count="{len(CUBE)}" stride="3">
<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common>
</source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="{len(cube)}">
<input semantic="VERTEX" source="#v" offset="0"/><p>{corners}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
""".encode(),
    )


def _robots(_: Path) -> Iterator[tuple[str, bytes]]:
    yield ".urdf", (ROOT / "examples/arm/arm.urdf").read_bytes()
    yield ".srdf", (ROOT / "examples/arm/arm.srdf").read_bytes()


def _texts(folder: Path) -> Iterator[tuple[str, bytes]]:
    yield ".sources.yaml", (ROOT / "examples/arm/sources.yaml").read_bytes()
    yield ".sources.yaml", (ROOT / "examples/tracked_objects.yaml").read_bytes()
    yield ".sources.yaml", (ROOT / "examples/robot_from_odometry.yaml").read_bytes()
    yield ".rules.yaml", (ROOT / "config/rules.yaml").read_bytes()
    yield ".rules.yaml", (ROOT / "config/guard_rules.yaml").read_bytes()
    yield ".profile.yaml", (ROOT / "config/balanced.yaml").read_bytes()
    messages = [(topic, stamp, (KIND, data)) for topic, stamp, data in rows(2)]
    yield ".metadata.yaml", (write_bag(folder / "metadata", messages) / "metadata.yaml").read_bytes()


BASES: Final[dict[str, Callable[[Path], Iterator[tuple[str, bytes]]]]] = {
    "bag": _bags,
    "mesh": _meshes,
    "robot": _robots,
    "yaml": _texts,
}


@cache
def bases(kind: str) -> list[tuple[str, bytes]]:
    """Return suffix and bytes of each whole file of a kind."""
    with tempfile.TemporaryDirectory() as folder:
        return list(BASES[kind](Path(folder)))


# -- damage


def mutate(data: bytes, random: Random) -> bytes:
    """Return a copy with one to four damages."""
    out = bytearray(data)
    is_text = b"\0" not in data[:2000]
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        (_damage_text if is_text and random.random() < 0.7 else _damage_bytes)(out, random)
    return bytes(out)


def _damage_bytes(out: bytearray, random: Random) -> None:
    if not out:
        out += b"\0"
    at = random.randrange(len(out))
    kind = random.randrange(9)
    size = random.choice((1, 2, 4, 8, 31, random.randrange(1, 1 + len(out))))
    if kind == 0:
        out[at] ^= 1 << random.randrange(8)
    elif kind == 1:
        del out[at:]
    elif kind == 2:
        del out[at : at + size]
    elif kind == 3:
        out[at:at] = random.randbytes(min(size, 4096))
    elif kind == 4:
        out[at:at] = out[at : at + size]
    elif kind == 5:
        value = random.choice((0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**32 - 4, 2**63 - 1, 2**64 - 1, len(out)))
        width = random.choice((2, 4, 8))
        out[at : at + width] = (value & ((1 << 8 * width) - 1)).to_bytes(width, "little")
    elif kind == 6:
        out[at : at + size] = bytes(min(size, len(out) - at))
    elif kind == 7:
        other = random.randrange(len(out))
        out[at : at + size] = out[other : other + size]
    else:
        out += random.choice((b"\0", b"\n", out[:at]))


_TOKEN: Final = re.compile(rb"[-+.\w]+")


def _damage_text(out: bytearray, random: Random) -> None:
    lines = bytes(out).split(b"\n")
    kind = random.randrange(6)
    k, other = random.randrange(len(lines)), random.randrange(len(lines))
    if kind == 0:
        del lines[k]
    elif kind == 1:
        lines.insert(other, lines[k])
    elif kind == 2:
        lines[k], lines[other] = lines[other], lines[k]
    else:
        tokens = list(_TOKEN.finditer(lines[k]))
        if tokens:
            token = random.choice(tokens)
            replaced = random.choice(NUMBERS if kind < 5 else WORDS)
            lines[k] = lines[k][: token.start()] + replaced + lines[k][token.end() :]
    out[:] = b"\n".join(lines)


# -- readers


def _read_bag(path: Path) -> str:
    with Bag(path) as bag:
        found = list(bag.messages([ODOM])) if ODOM in bag.topics else []
        bag.definitions(bag.topics)
        states = [each.stated for storage in bag._storages for each in storage.channels if each.topic == ODOM]
    if any(each is not None for each in states) and len(found) != sum(each or 0 for each in states):
        raise AssertionError(f"{len(found)} messages, stated are {states}")
    return f"read, {'all' if len(found) == COUNT else 'another number of'} messages"


def _read_mesh(path: Path) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh = load_mesh(path)
    if not (np.abs(mesh.vertices) <= LARGEST_INPUT).all():
        raise AssertionError("vertices that are no numbers")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise AssertionError("faces of vertices that are not there")
    return "read"


def _read_robot(path: Path) -> str:
    arm = ROOT / "examples/arm/arm.urdf"
    given = Description.read(path)
    robot = Robot(Description.read(arm), given) if path.suffix == ".srdf" else Robot(given)
    poses, twists = robot.states(np.zeros((len(robot.tree.joints), 2)), np.eye(1, 13, 6)[0])
    if not (np.isfinite(poses).all() and np.isfinite(twists).all()):
        raise AssertionError("poses that are no numbers")
    return f"read{', parts left out' * bool(robot.left_out)}"


def _read_text(path: Path) -> str:
    kind = path.suffixes[-2]
    if kind == ".sources":
        load_mapping(path)
    elif kind == ".rules":
        Rules.given(str(path))
    elif kind == ".profile":
        Profile.named(str(path))
    else:
        folder = path.with_suffix("")
        folder.mkdir(exist_ok=True)
        path.replace(folder / "metadata.yaml")
        (folder / "metadata.mcap").touch()
        read_bag_folder(folder)
    return "read"


READERS: Final[dict[str, Callable[[Path], str]]] = {
    "bag": _read_bag,
    "mesh": _read_mesh,
    "robot": _read_robot,
    "yaml": _read_text,
}


def damaged(kind: str, seed: int) -> tuple[str, bytes]:
    """Return suffix and bytes of the file of a seed."""
    random = Random(seed)
    suffix, data = random.choice(bases(kind))
    return suffix, mutate(data, random)


def answer(kind: str, path: Path) -> Outcome:
    """Read a file."""
    began = time.process_time()
    try:
        outcome = Outcome(READERS[kind](path))
    except CollisionMonitorError as error:
        text = str(error)
        outcome = Outcome("refused")
        if "\n" in text or len(text) > LONGEST_ERROR or not text.isprintable():
            outcome.problem = f"not one line of text: {text!r:.500}"
    except Exception:
        outcome = Outcome("problem", traceback.format_exc(limit=-4))
    outcome.took = time.process_time() - began
    if outcome.took > SLOWEST:
        outcome.problem = f"took {outcome.took:.1f} s"
    return outcome


def run(seeds: range, kinds: list[str], folder: Path, keep: Path | None = None) -> Found:
    """Read the files of the seeds, the kinds in turn. keep: folder for those with problems."""
    found = Found()
    for seed in seeds:
        kind = kinds[seed % len(kinds)]
        suffix, data = damaged(kind, seed)
        path = folder / f"{seed}{suffix}"
        path.write_bytes(data)
        outcome = answer(kind, path)
        found.files += 1
        found.outcomes[f"{suffix[1:]}: {outcome.text}"] += 1
        found.slowest = max(found.slowest, (outcome.took, seed))
        if outcome.problem:
            found.problems[seed] = outcome.problem
            if keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / path.name).write_bytes(data)
        path.unlink(missing_ok=True)
    return found


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=1000, metavar="N", help="number of files (default: 1000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first file; each file has the next one")
    parser.add_argument("--kinds", nargs="+", choices=tuple(BASES), default=list(BASES))
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"), help="folder for files with problems")
    parser.add_argument("--only", type=int, metavar="SEED", help="read the file of this seed, and keep it")
    args = parser.parse_args()
    if args.only is not None:
        args.seed, args.files = args.only, 1
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        found = run(range(args.seed, args.seed + args.files), args.kinds, Path(folder), args.keep)
    for outcome, count in sorted(found.outcomes.items()):
        print(f"{count:9d}  {outcome}")
    print(f"slowest    {found.slowest[0]:.2f} s (seed {found.slowest[1]})")
    return print_problems(found.files, found.problems, began)


if __name__ == "__main__":
    sys.exit(main())
