"""After the warm-up a session waits for no compiler, and a start is quick."""

from __future__ import annotations

import json
import subprocess
import sys

SESSION = """
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
from collision_monitor.profiles import Profile
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
    result = monitor.step(step * 10_000_000, np.arange(300), poses, twists)
    first = first or time.perf_counter() - began
    poses[:, :3] += 0.01 * twists[:, :3]
    twists[rng.integers(0, 300, 3)] *= -1
    if step == 5:
        monitor.profile = monitor.profile.replace(contact_points=4)
    if step == 10:
        monitor.remove(7)
        monitor.add(2000, cm.Sphere(1))
print(json.dumps({"compiled": compiled, "contacts": len(result.contacts), "first": first}))
"""


def test_nothing_is_compiled_after_the_warm_up() -> None:
    subprocess.run([sys.executable, "-m", "collision_monitor.warm_up"], check=True)
    told = subprocess.run([sys.executable, "-c", SESSION], check=True, capture_output=True, text=True).stdout
    answer = json.loads(told)
    assert answer["compiled"] == []
    assert answer["contacts"] > 10
