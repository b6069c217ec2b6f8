"""Metadata that colcon reads from setup.py: the files of a ROS 2 package and its executables.

The other metadata is in pyproject.toml. `python_requires` and `license` are here because colcon cannot read the form
that setuptools gives them there, and because setuptools 68 (Ubuntu 24.04) and 77 disagree on how to write a licence.
"""

from glob import glob

from setuptools import setup

PACKAGE = "collision_monitor"

setup(
    python_requires=">=3.11",
    license="Apache-2.0",
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/config", sorted(glob("config/*.*"))),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.py"))),
    ],
    entry_points={
        "console_scripts": [
            "collision-monitor = collision_monitor.cli.main:main",
            "monitor = collision_monitor.ros.executables:monitor",
            "guard = collision_monitor.ros.executables:guard",
            "gate = collision_monitor.ros.executables:gate",
            "world = collision_monitor.ros.executables:world",
            "replay = collision_monitor.cli.main:replay_main",
        ],
        "pytest11": ["collision_monitor = collision_monitor.session.pytest_plugin"],
    },
)
