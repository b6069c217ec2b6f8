"""Where the time of a first and of a second start goes, and the compile time of each kernel.

    python benchmarks/first_start.py                 warm starts only: 10 s
    python benchmarks/first_start.py --compile       compile everything into a new cache first: some minutes
    python benchmarks/first_start.py --compile --kernels 40

Starts are processes of their own, in turns with `import numba`; the table has the best and the median of all rounds.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from typing import Final

import numpy as np

PROGRAMS: Final = {
    "import numba": "import numba",
    "import collision_monitor": "import collision_monitor",
    "first contact": "import collision_monitor as cm\ncm.contact(cm.Box((1, 1, 1)), cm.Pose(), cm.Capsule(0.2, 1), "
    "cm.Pose((0, 0, 2)))",
    "first step of a Monitor": "import collision_monitor as cm\nm = cm.Monitor()\nm.add(1, cm.Box((1, 1, 1)))\n"
    "m.add(2, cm.Sphere(0.5))\nm.step(0, [1, 2], [(0, 0, 0, 0, 0, 0, 1), (0, 0, 2, 0, 0, 0, 1)], "
    "[(0, 0, 0, 0, 0, 0), (0, 0, -1, 0, 0, 0)])",
}

COMPILE: Final = """
import sys, time
from numba.core import event
rows, stack = [], []

class Listener(event.Listener):
    def on_start(self, e): stack.append([time.process_time(), 0.0])
    def on_end(self, e):
        begin, inner = stack.pop()
        spent = time.process_time() - begin
        if stack: stack[-1][1] += spent
        function = e.data["dispatcher"].py_func
        rows.append((spent - inner, f"{function.__module__}.{function.__qualname__}"))

event.register("numba:compile", Listener())
from collision_monitor import warm_up
begin = time.process_time()
warm_up.PARTS[sys.argv[1]]()
print(f"{sys.argv[1]}: {time.process_time() - begin:.0f} s of CPU, {len(rows)} functions compiled")
for spent, name in sorted(rows, reverse=True)[:int(sys.argv[2])]:
    print(f"  {spent:6.2f} s  {name.removeprefix('collision_monitor.')}")
"""


def start(program: str, environment: dict[str, str]) -> float:
    """Seconds of a process from its start to its end."""
    begin = time.perf_counter()
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)
    return time.perf_counter() - begin


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--compile", action="store_true", help="compile into a new cache, and time it")
    parser.add_argument("--kernels", type=int, default=20, help="rows of the table of compile times")
    parser.add_argument("--rounds", type=int, default=7)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        if args.compile:
            environment["NUMBA_CACHE_DIR"] = folder
            for part in ("monitor", "options", "functions"):
                subprocess.run([sys.executable, "-c", COMPILE, part, str(args.kernels)], check=True, env=environment)
        times: dict[str, list[float]] = {name: [] for name in PROGRAMS}
        for _ in range(args.rounds + 1):
            for name, program in PROGRAMS.items():
                times[name].append(start(program, environment))
        best = {name: min(each[1:]) for name, each in times.items()}
        print(f"\n{'':28s}{'best s':>8s}{'median s':>10s}{'/ numba':>9s}")
        for name, each in times.items():
            print(f"{name:28s}{best[name]:8.2f}{np.median(each[1:]):10.2f}{best[name] / best['import numba']:9.2f}")


if __name__ == "__main__":
    main()
