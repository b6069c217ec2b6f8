"""Compares poses and twists of all links with Pinocchio at random states, for URDFs of any robots.

    python benchmarks/links_against_pin.py [--states 10000] [URDF ...]
    python benchmarks/links_against_pin.py --write test/robots/pin_reference.npz    # what test_against_pin.py reads

Needs `pip install pin` (450 MB). Without URDFs it takes those of the tests, and five public robots if
`example-robot-data` is installed: two arms, two grippers of mimic joints, a mobile base and a quadruped.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from collision_monitor.robots.kinematic_tree import KinematicTree, kinematic_tree
from collision_monitor.robots.link_motions import link_motions
from collision_monitor.robots.urdf import parse_urdf

ROOT: Final = Path(__file__).parents[1]
OWN: Final = (ROOT / "examples/arm/arm.urdf", *sorted((ROOT / "test/robots/models").glob("*.urdf")))
PUBLIC: Final = (
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "talos_data/robots/talos_full_v2.urdf",  # with two grippers of seven mimic joints each
    "tiago_pro_description/robots/tiago_pro.urdf",  # a mobile base with two arms
    "go2_description/urdf/go2.urdf",
)


class Oracle:
    """The same robot in Pinocchio, with a base that floats."""

    def __init__(self, urdf: str, tree: KinematicTree) -> None:
        urdf = urdf.replace('type="floating"', 'type="fixed"')  # ours begins behind it
        self.model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())  # its mimic joints fail on some files
        self.data = self.model.createData()
        self.frames = [self.model.getFrameId(name) for name in tree.links]
        self.names = tree.joints
        self.mimics = {
            joint.get("name"): (each.get("joint"), float(each.get("multiplier", 1)), float(each.get("offset", 0)))
            for joint in ElementTree.fromstring(urdf).iter("joint")
            for each in joint.iter("mimic")
        }

    def motions(self, joints: Any, base: Any) -> tuple[Any, Any, Any]:
        """Return positions (L, 3), rotation matrices (L, 3, 3), twists (L, 6) of one state."""
        q, v = pin.neutral(self.model), np.zeros(self.model.nv)
        R_WB = pin.Quaternion(base[3:7]).matrix()
        q[:7], v[:3], v[3:6] = base[:7], R_WB.T @ base[7:10], R_WB.T @ base[10:]
        states = dict(zip(self.names, joints, strict=True))
        for name, (leader, multiplier, offset) in self.mimics.items():
            states[name] = multiplier * states[leader] + (offset, 0.0)
        for name, (position, speed) in states.items():
            joint = self.model.joints[self.model.getJointId(name)]
            is_circle = joint.nq == 2  # a continuous joint is a point of the unit circle
            q[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(position), np.sin(position)) if is_circle else position
            v[joint.idx_v] = speed
        pin.forwardKinematics(self.model, self.data, q, v)
        pin.updateFramePlacements(self.model, self.data)
        placements = [self.data.oMf[frame] for frame in self.frames]
        world = pin.LOCAL_WORLD_ALIGNED
        twists = [pin.getFrameVelocity(self.model, self.data, frame, world).vector for frame in self.frames]
        positions, rotations = [m.translation for m in placements], [m.rotation for m in placements]
        return np.array(positions), np.array(rotations), np.array(twists)


def random_states(tree: KinematicTree, count: int, seed: int) -> tuple[Any, Any]:
    """Return joints (n, J, 2) within 3 rad or m and 3 rad/s or m/s, and bases (n, 13) within some metres."""
    rng = np.random.default_rng(seed)
    joints = rng.uniform(-3.0, 3.0, (count, len(tree.joints), 2))
    base = rng.normal(size=(count, 13)) * 2.0
    base[:, 3:7] /= np.linalg.norm(base[:, 3:7], axis=1, keepdims=True)
    return joints, base


def compare(path: Path, count: int, seed: int) -> None:
    """Print the largest differences of one robot."""
    text = path.read_text()
    tree = kinematic_tree(parse_urdf(text, str(path)))
    oracle = Oracle(text, tree)
    joints, base = random_states(tree, count, seed)
    link_motions(tree.table, joints[:1], base[:1])
    began = time.perf_counter()
    poses, twists = link_motions(tree.table, joints, base)
    microseconds = (time.perf_counter() - began) / count * 1e6
    worst = np.zeros(3)
    for n in range(count):
        p, R, v = oracle.motions(joints[n], base[n])
        turned = np.array([pin.Quaternion(q).matrix() for q in poses[n, :, 3:]])
        found = np.abs(p - poses[n, :, :3]).max(), np.abs(R - turned).max(), np.abs(v - twists[n]).max()
        worst = np.maximum(worst, found)
    print(
        f"{path.name:22} {len(tree.links):5} {len(tree.joints):6} {count:8} "
        f"{worst[0]:22.1e} {worst[1]:10.1e} {worst[2]:11.1e} {microseconds:10.2f}",
        flush=True,
    )


def write(target: Path) -> None:
    """Write eight states of each own robot with Pinocchio's answers."""
    arrays = {}
    for path in OWN:
        tree = kinematic_tree(parse_urdf(path.read_text(), str(path)))
        oracle = Oracle(path.read_text(), tree)
        joints, base = random_states(tree, 8, 1)
        p, R, v = zip(*map(oracle.motions, joints, base), strict=True)
        for name, value in {"joints": joints, "base": base, "position": p, "rotation": R, "twist": v}.items():
            arrays[f"{path.stem}.{name}"] = np.array(value)
    np.savez_compressed(target, **arrays)


def public() -> list[Path]:
    """Return the URDFs of example-robot-data that are installed."""
    found = importlib.util.find_spec("pinocchio")
    prefix = Path(str(found and found.origin)).parents[4]
    return [path for path in (prefix / "share/example-robot-data/robots" / name for name in PUBLIC) if path.exists()]


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdf", nargs="*", type=Path)
    parser.add_argument("--states", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", type=Path, metavar="NPZ", help="write the reference of the tests and stop")
    arguments = parser.parse_args()
    if arguments.write:
        write(arguments.write)
        sys.exit()
    print(f"{'robot':22} links joints   states  largest difference: m   rotation  m/s, rad/s   us/state")
    for path in arguments.urdf or [*OWN, *public()]:
        compare(path, arguments.states, arguments.seed)


if __name__ == "__main__":
    main()
