"""Measure the monitor's memory: bytes for each object with its events, and growth over an hour.

    python benchmarks/memory.py             # three minutes
    python benchmarks/memory.py --quick     # six simulated minutes instead of an hour

Objects: memory after two simulated seconds at 100 Hz. Held are arrays and Python objects of the monitor, its answers
and the states. Resident is the growth of the process after the kernels were loaded and the boxes made.
Hour: 1,000 boxes at 10 Hz. 1 % change course in each step; objects are removed and added.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import tracemalloc
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from event_list import Boxes
from rich.console import Console
from rich.progress import track
from rich.table import Table

from collision_monitor import Box, Monitor
from collision_monitor.settings.profile import Profile

PAGE = os.sysconf("SC_PAGESIZE")


def resident() -> int:
    """Resident memory of this process (bytes)."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def monitor_of(boxes: Boxes) -> Monitor:
    """Monitor of the boxes."""
    monitor = Monitor(Profile(threads=1))
    for i, size in enumerate(boxes.size):
        monitor.add(i, Box(size))
    return monitor


def step_for(seconds: float, monitor: Monitor, boxes: Boxes) -> int:
    """Step at 100 Hz; returns the number of events pending at the end."""
    for step in range(round(100 * seconds)):
        answer = monitor.step(step * 10_000_000, boxes.states(0.0))
        boxes.move(0.01, 0.01)
    return answer.status.events_pending


def each_object(n: int) -> dict[str, float]:
    """Memory of each of n objects (bytes)."""
    few, boxes = Boxes(100, seed=2), Boxes(n, seed=1)
    step_for(1.0, monitor_of(few), few)  # loads the kernels
    before = resident()
    monitor = monitor_of(boxes)
    events = step_for(2.0, monitor, boxes)
    grown = resident() - before
    tracemalloc.start()
    monitor = monitor_of(boxes)
    step_for(2.0, monitor, boxes)
    held = tracemalloc.get_traced_memory()[0]
    return {"objects": n, "held_bytes": held / n, "resident_bytes": grown / n, "events_per_object": events / n}


def an_hour(seconds: int) -> list[tuple[int, float]]:
    """Resident memory after each tenth of the time, as (simulated s, MB)."""
    boxes = Boxes(1000, seed=1)
    monitor = monitor_of(boxes)
    rows = []
    steps = 10 * seconds
    rng = np.random.default_rng(2)
    for step in track(range(steps + 1), description="hour", console=Console(stderr=True), transient=True):
        monitor.step(step * 100_000_000, boxes.states(0.0))
        boxes.move(0.1, 0.01)
        boxes.walls()
        gone = int(rng.integers(1000))
        monitor.remove(gone)
        monitor.add(gone, Box(boxes.size[gone]))
        if step % (steps // 10) == 0:
            rows.append((step // 10, resident() / 1e6))
    return rows


def main() -> None:
    """Measure and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="six simulated minutes instead of an hour")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    args = parser.parse_args()
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as process:  # a process for each
        objects = list(process.map(each_object, (1_000, 10_000, 30_000)))
        hour = process.submit(an_hour, 360 if args.quick else 3600).result()
    if args.json:
        print(json.dumps({"objects": objects, "hour": hour}))
        return
    table = Table("objects", "held [B each]", "resident [B each]", "events each", title="Memory of boxes at 100 Hz")
    for row in objects:
        numbers = [f"{row[key]:,.0f}" for key in ("objects", "held_bytes", "resident_bytes")]
        table.add_row(*numbers, f"{row['events_per_object']:.2f}")
    Console().print(table)
    table = Table("simulated s", "resident [MB]", title="1,000 boxes at 10 Hz")
    for seconds, size in hour:
        table.add_row(f"{seconds:,}", f"{size:.1f}")
    Console().print(table)


if __name__ == "__main__":
    main()
