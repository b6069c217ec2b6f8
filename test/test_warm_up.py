"""Tests that a session compiles nothing after the warm-up."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

START = """
import json, time
began = time.perf_counter()
import numpy as np
from numba.core import event
compiled = []

class Listener(event.Listener):
    def on_start(self, e): compiled.append(str(e.data["dispatcher"]))
    def on_end(self, e): pass

event.register("numba:compile", Listener())
import collision_monitor as cm
"""

SESSION = """
from collision_monitor.settings.profile import Profile
monitor = cm.Monitor(Profile(threads=2))
rng = np.random.default_rng(0)
kinds = [cm.Box((1, 2, 3)), cm.Sphere(0.5), cm.Capsule(0.2, 1), cm.Cylinder(0.3, 1), cm.Cone(0.3, 1),
         cm.ConvexHull(rng.normal(size=(20, 3)))]
for i in range(300):
    monitor.add(i, kinds[i % 6] if i % 5 else [(kinds[0], cm.Pose()), (kinds[1], cm.Pose((1, 0, 0)))])
monitor.add(1000, cm.HalfSpace((0, 0, 1)), static=True, pose=cm.Pose())
poses = np.zeros((300, 7)); poses[:, 6] = 1; poses[:, :3] = rng.uniform(0, 12, (300, 3))
twists = rng.uniform(-1, 1, (300, 6))
first = None
for step in range(30):
    stamp = step * 10_000_000
    result = monitor.step(stamp, np.arange(300), poses, twists, now_ns=stamp + 2_000_000)
    first = first or time.perf_counter() - began
    poses[:, :3] += 0.01 * twists[:, :3]
    twists[rng.integers(0, 300, 3)] *= -1
    if step == 5:
        monitor.profile = monitor.profile.replace(contact_points=4)
    if step in (20, 22, 24):
        monitor.profile = monitor.profile.replace(budget_ms=1000.0 if step == 22 else 0.2)
    if step in (8, 12):
        monitor.follow(9, cm.Trajectory([0, 1, 2], [poses[9], poses[8], poses[8]], between="arc"))
    if step == 10:
        monitor.remove(7)
        monitor.add(2000, cm.Sphere(1))
print(json.dumps({"compiled": compiled, "contacts": len(result.contacts), "first": first}))
"""


FUNCTIONS = """
from collision_monitor.detection.detector import Detector
rng = np.random.default_rng(0)
solids = [cm.Sphere(0.5), cm.Box((1, 2, 3)), cm.Capsule(0.2, 1), cm.Cylinder(0.3, 1), cm.Cone(0.3, 1),
          cm.ConvexHull(rng.normal(size=(20, 3)))]
corners = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2))], float)
sides = [t for i in range(6) for j in [(i + 1) % 6] for t in ((i, j, 6 + j), (i, 6 + j, 6 + i))]
ends = [t for i in range(1, 5) for t in ((0, i + 1, i), (6, 6 + i, 7 + i))]
corner = cm.Mesh(corners, [*sides, *ends])
flat = [cm.Circle(1), cm.Polygon(corners[:6, :2]), cm.Polygon([(0, 0), (1, 0), (0, 1)])]
still, aside = cm.Pose(), cm.Pose((0.5, 0.1, 0))
first = None
for kinds in ([*solids, corner, [(solids[0], still), (solids[1], aside)]], flat):
    for a in kinds:
        for b in kinds:
            cm.contact(a, still, b, aside)
            first = first or time.perf_counter() - began
            moving = cm.Motion(cm.Pose((5, 0, 0)), (-1, 0, 0), (0, 0, 0.5))
            cm.time_of_impact(a, cm.Motion(still), b, moving)
            cm.time_of_impact(a, cm.Motion(still), b, cm.Motion(moving.pose, acceleration=(-1, 0, 0)))
for a, x in ((solids[1], 1), (corner, 2)):  # they touch
    cm.time_of_impact(a, cm.Motion(still), a, cm.Motion(cm.Pose((x, 0, 0)), (-1, 0, 0)))
plan = cm.Trajectory([0, 1, 2], [(5, 0, 0), (0, 0, 0), (0, 5, 0)], np.eye(3))
for a in (*solids, corner):
    cm.impacts(a, plan, corner, cm.Motion(still))
poses = np.zeros((9, 7)); poses[:, 6] = 1
for a in (*solids, corner):
    cm.time_of_impact_batch(a, poses, np.ones((9, 6)), corner, poses + 5 * np.eye(1, 7), np.zeros((9, 6)))
    cm.contact(a, still, cm.HalfSpace((0, 0, 1)), still)
for a in solids[1::4]:
    cm.contact_features(cm.contact(a, still, solids[1], aside), a, still, solids[1], aside)
for test in ("contact", "cascade", "sat"):
    cm.overlap(solids[1], still, solids[1], aside, test)
cm.vertex_face_impact(rng.normal(size=(8, 3)))
cm.edge_edge_impact(rng.normal(size=(5, 8, 3)))
for threads in (1, 2):
    for kinds in (solids[:1], solids[1:2], solids):
        detector = Detector([kinds[i % len(kinds)] for i in range(4000)], threads=threads)
        turned = rng.normal(size=(4000, 4))
        turned /= np.linalg.norm(turned, axis=1)[:, None]
        contacts = detector.detect(rng.uniform(0, 30, (4000, 3)), turned)
print(json.dumps({"compiled": compiled, "contacts": len(contacts), "first": first}))
"""

MESHES = """
from collision_monitor.world.arm import lathe
monitor = cm.Monitor("fast")
rng = np.random.default_rng(0)
for i in range(40):
    monitor.add(i, lathe([(0.06, -0.2), (0.06, -0.12), (0.03, -0.1), (0.03, 0.1), (0.06, 0.12), (0.06, 0.2)], 16))
poses = np.zeros((40, 7)); poses[:, 6] = 1; poses[:, :3] = rng.uniform(0, 1, (40, 3))
twists = rng.uniform(-0.3, 0.3, (40, 6))
contacts = 0
for step in range(40):
    contacts += len(monitor.step(step * 10_000_000, np.arange(40), poses, twists).contacts)
    poses[:, :3] += 0.01 * twists[:, :3]
assert contacts > 10
print(json.dumps({"compiled": compiled, "contacts": contacts}))
"""


@pytest.fixture(scope="module")
def warmed() -> None:
    """Compile what is not compiled yet, as the set-up does."""
    subprocess.run([sys.executable, "-m", "collision_monitor.warm_up"], check=True)


def test_the_command_compiles_what_is_not_compiled_and_says_where_it_is(warmed: None) -> None:
    command = [sys.executable, "-m", "collision_monitor", "warm-up"]
    done = subprocess.run([*command, "functions"], capture_output=True, text=True, timeout=600)
    said = re.fullmatch(r"0 functions compiled in \d+ s; the kernels are in (.*)\n", done.stdout)
    assert said and list(Path(said[1]).iterdir()), (done.stdout, done.stderr)
    wrong = subprocess.run([*command, "robots"], capture_output=True, text=True, timeout=60)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "expected parts of monitor, options, functions, got 'robots'" in wrong.stderr


WATCHED = (
    START
    + """
from collision_monitor import warm_up
from collision_monitor._jit.kernel_cache import KernelCache
from collision_monitor.settings.profile import Profile
WARM_UP
loaded, load = [], KernelCache.load_overload

def watch(self, sig, target):
    loaded.append(self._name)
    return load(self, sig, target)

KernelCache.load_overload = watch
"""
)
CERTAIN_SESSION = re.sub(r"    if step == 5:\n.*\n    if step in .*\n.*\n", "", SESSION)


@pytest.mark.parametrize(
    ("warm_up", "session"),
    [
        ("warm_up.warm_up_monitor()", SESSION),
        ("warm_up.warm_up_monitor(Profile(uncertainty=False))", CERTAIN_SESSION),
        ("warm_up.warm_up_monitor(); warm_up.warm_up_functions()", FUNCTIONS),
        ("warm_up.warm_up_monitor(); warm_up.warm_up_functions()", MESHES),
        ("warm_up.warm_up_monitor(Profile.named('fast')); warm_up.warm_up_functions()", MESHES),
    ],
    ids=["all", "certain", "functions", "meshes", "meshes fast"],
)
def test_nothing_is_compiled_or_loaded_after_the_warm_up(warmed: None, warm_up: str, session: str) -> None:
    """The first step of a node once compiled a kernel for 0.5 s that the warm-up did not call.

    A program without a warm-up of its own finds the same kernels compiled, because this one's warm-up compiles none.
    """
    assert "contact_points" in SESSION and "contact_points" not in CERTAIN_SESSION
    session = session.replace('json.dumps({"compiled"', 'json.dumps({"loaded": loaded, "compiled"')
    program = WATCHED.replace("WARM_UP", warm_up) + session
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert (answer["compiled"], answer["loaded"]) == ([], [])
    assert answer["contacts"] > 10


@pytest.mark.parametrize("when", ["Monitor(limited)", "Monitor(); monitor.profile = limited"])
def test_no_step_with_a_budget_is_the_first_to_load_a_kernel(when: str) -> None:
    """Without the warm-up, the first step with time left loaded a kernel: 28 ms in a step of 1.6 ms."""
    program = (
        "from collision_monitor.monitor.monitor import Monitor, Profile\n"
        "from collision_monitor.impact import pair_impacts, sphere_trees\n"
        "limited = Profile(budget_ms=1.0)\n"
        f"monitor = {when}\n"
        "print(len(pair_impacts.predict_pairs.signatures), len(sphere_trees.tighten.signatures))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=300)
    assert done.stdout.split() == ["1", "1"], done.stderr


VOLUME = """
import json
from collision_monitor import warm_up
from collision_monitor._jit.kernel_cache import KernelCache
from collision_monitor._jit.places import kernel_places
files, find = set(), KernelCache._file

def watch(self, signature, target):
    files.add((self._folder, find(self, signature, target)))
    return find(self, signature, target)

KernelCache._file = watch
for part in warm_up.PARTS.values():
    part()
places = list(kernel_places())
paths = [next(path for place in places if (path := place / folder / name).exists()) for folder, name in files]
print(json.dumps([len(files), sum(each.stat().st_size for each in paths)]))
"""


def test_kernels_do_not_repeat_large_functions(warmed: None) -> None:
    """With the time of impact in each of ten kernels, all kernels had five times as many instructions."""
    done = subprocess.run([sys.executable, "-c", VOLUME], check=True, capture_output=True, text=True)
    functions, size = json.loads(done.stdout)
    assert functions < 140 and size < 14_000_000
