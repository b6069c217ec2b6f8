"""Draws the picture of docs/robots.md: the arm of examples/arm as the monitor sees it, before its hand hits the post.

python docs/draw_robot.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from collision_monitor import Cylinder, Monitor, Pose
from collision_monitor.robots.robot import Description, Robot
from collision_monitor.shapes.registry import Shape, kind_of

ROOT = Path(__file__).parents[1]
SWING = (-0.2, 0.2, 0.62)  # rad of joint_1, one picture each
AT_REST = [0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.03]
SPEED = 0.98  # rad/s of joint_1
POST = Pose((0.3, 0.48, 0.5)), Cylinder(0.04, 1.0)
PLAIN, HIT, QUIET = "#a9cdf5", "#ff6f61", "#e6e6e6"


def draw(axes: Any, shape: Shape, pose: Pose, color: str) -> None:
    """Draw a shape at a pose."""
    faces = kind_of(shape).triangles(shape) @ pose.rotation.T + pose.position
    axes.add_collection3d(Poly3DCollection(faces, facecolors=color, edgecolors=color, linewidths=0.1, shade=True))


def predicted(robot: Robot, joints: Any) -> tuple[set[str], str]:
    """Return the link that hits the post first, and when, as the monitor predicts it."""
    monitor = Monitor()
    monitor.add(0, POST[1], static=True, pose=POST[0])
    poses, twists = robot.states(joints, np.eye(1, 13, 6)[0])
    allowed = list(range(1, len(robot.links) + 1))
    for k, shapes in enumerate(robot.shapes, start=1):
        monitor.add(k, shapes, allowed=allowed)
    result = monitor.step(0, np.array(allowed), poses[robot.rows], twists[robot.rows])
    first = min(result.predictions, key=lambda each: each["lower"], default=None)
    if first is None:
        return set(), "no impact within the horizon"
    link = robot.links[int(first["id_b"]) - 1]
    return {link}, f"{link} meets the post in {first['lower']:.2f} s"


def main() -> None:
    """Write docs/images/arm.png."""
    robot = Robot(Description.read(ROOT / "examples/arm/arm.urdf"))
    figure = plt.figure(figsize=(9.4, 3.4), dpi=120)
    for k, angle in enumerate(SWING):
        joints = np.zeros((8, 2))
        joints[:, 0] = [angle, *AT_REST[1:]]
        joints[0, 1] = SPEED
        hit, text = predicted(robot, joints)
        axes = figure.add_subplot(1, 3, k + 1, projection="3d", computed_zorder=True)
        poses, _ = robot.states(joints, np.eye(1, 13, 6)[0])
        for link, row, shapes in zip(robot.links, robot.rows, robot.shapes, strict=True):
            for shape, at in shapes:
                draw(axes, shape, Pose(poses[row, :3], poses[row, 3:]) @ at, HIT if link in hit else PLAIN)
        draw(axes, POST[1], POST[0], QUIET)
        axes.set(xlim=(-0.3, 0.7), ylim=(-0.4, 0.6), zlim=(0.0, 1.0))
        axes.set_axis_off()
        axes.view_init(28, 35)
        axes.set_box_aspect(None, zoom=1.35)
        axes.set_title(text, fontsize=9, y=0.93)
    figure.subplots_adjust(0, 0, 1, 0.97, 0, 0)
    figure.savefig(ROOT / "docs/images/arm.png")


if __name__ == "__main__":
    main()
