"""The time line of the first `make demo` of a fresh clone, and of the second.

    python benchmarks/first_demo.py                              on two cores; takes 2 to 4 minutes
    python benchmarks/first_demo.py --cores 0-3 --plot first.svg

Clones this repository into a temporary folder, sets up everything there with an empty cache of pip, and deletes it.
The bars are the stages that the set-up prints; the start, the scene and the replay of the demo; and what compiles
meanwhile and afterwards at low priority.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from mcap.reader import make_reader

from collision_monitor.codec import decode_status
from collision_monitor.pipeline.topics import Topic

ROOT: Final = Path(__file__).resolve().parents[1]
STAGE: Final = re.compile(r"  (\w+) .*?([0-9.]+) s$")
SCENE_S: Final = 10.0
"""The demo's default duration."""


class Bar(NamedTuple):
    """A part of a start, in seconds after its begin."""

    name: str
    begin: float
    end: float


def start(folder: Path, cores: str) -> tuple[list[Bar], str]:
    """Run `make demo`. Return its bars, and its lines about the steps and the replay."""
    environment = {**os.environ, "PIP_CACHE_DIR": str(folder.parent / "pip"), "PYTHONUNBUFFERED": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    began, bars, last, steps = time.monotonic(), [], "", ""
    command = ["taskset", "-c", cores, "make", "-s", "demo"]
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        set_up = scene = 0.0
        for line in process.stdout:
            now, last = time.monotonic() - began, line.rstrip()
            if found := STAGE.match(last):
                bars.append(Bar(found[1], now - float(found[2]), now))
                set_up = now
            elif "touching" in last and not scene:
                scene = now
                bars.append(Bar("start of the demo", set_up, scene))
            elif last.startswith("steps"):
                steps = last.removeprefix("steps").strip()
            elif last.startswith("session"):
                bars.append(Bar("scene", scene, scene + SCENE_S))
                bars.append(Bar("end and replay", scene + SCENE_S, now))
    if process.returncode:
        raise SystemExit(f"make demo ended with {process.returncode}: {last}")
    with (folder / "build" / "set_up.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # held by the compilation in the background
    bars.append(Bar("the rest, at low priority", set_up, time.monotonic() - began))
    return bars, f"{steps}; {last}"


def steps_of(session: Path) -> str:
    """Return how many states a session holds, how many the node lost, and the longest delay of one that it received."""
    delays, lost = [], 0
    with session.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            if channel.topic.endswith(Topic.STATES.path):
                delays.append((message.log_time - message.publish_time) * 1e-6)
            elif channel.topic.endswith(Topic.STATUS.path):
                lost = decode_status(message.data).messages_lost
    return f"{len(delays)} states, {lost} messages lost, at most {max(delays):.1f} ms from a stamp to the node"


def plot(bars: list[Bar], path: str) -> None:
    """Draw the bars one below the other."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8, 0.32 * len(bars) + 0.9), layout="constrained")
    axes.barh([bar.name for bar in bars], [bar.end - bar.begin for bar in bars], left=[bar.begin for bar in bars])
    axes.bar_label(axes.containers[0], [f"{bar.end - bar.begin:.0f} s" for bar in bars], padding=3, fontsize=8)
    axes.invert_yaxis()
    axes.margins(x=0.06)
    axes.set_xlabel("seconds after `make demo` in a fresh clone")
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path)


def main() -> None:
    """Print a table of both starts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cores", default="0,1", help="cores to run on, as taskset takes them (default: 0,1)")
    parser.add_argument("--plot", metavar="FILE", help="draw the first start")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) / "collision_monitor"
        subprocess.run(["git", "clone", "-q", ROOT, folder], check=True)
        for title in ("first start", "second start"):
            bars, last = start(folder, args.cores)
            newest = max((folder / "sessions").iterdir(), key=lambda path: path.stat().st_mtime)
            print(f"{title}: {bars[-2].end:.0f} s; {steps_of(newest)}; {last}\n")
            print(f"    {'':26s}{'begin s':>8s}{'end s':>8s}")
            for bar in bars:
                print(f"    {bar.name:26s}{bar.begin:8.1f}{bar.end:8.1f}")
            print(flush=True)
            if args.plot and title == "first start":
                plot(sorted(bars, key=lambda bar: bar.begin), args.plot)


if __name__ == "__main__":
    main()
