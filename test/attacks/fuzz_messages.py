"""Attack the pipeline with hostile messages, in this process or a node over DDS.

    make fuzz                                           # 100,000 messages
    make fuzz ARGS="--messages 1000000 --seed 7"
    make fuzz ARGS="--dds --messages 20000"             # a node in its own process, on a ROS domain of its own
    make fuzz ARGS="--reproduce attack_7_123.json"

Each run of 5,000 messages has its own seed and pipeline, so that a failure is reproduced in seconds. Between the
attacks a scene with answers in closed form has to be answered right. Exit code 3: an attack succeeded; its input is in
a file.
"""

from __future__ import annotations

import argparse
import base64
import json
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any, Final

HERE: Final = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

from campaign import RUN, Campaign, Failure, Summary, is_broken_by, resident  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn  # noqa: E402

from collision_monitor.pipeline.topics import Topic  # noqa: E402

FAILED: Final = 3
"""Exit code if an attack succeeded."""

WORKER_GROWTH: Final = 64e6
"""Bytes by which a process may grow over many runs."""


def run(seed: int, messages: int) -> tuple[Summary, int]:
    """Run one campaign. Return its summary and the resident memory afterwards (bytes)."""
    return Campaign(seed).run(messages), resident()


def runs(seed: int, messages: int) -> list[tuple[int, int]]:
    """Return (seed, messages) of each run."""
    whole, rest = divmod(messages, RUN)
    return [(seed + k, RUN) for k in range(whole)] + ([(seed + whole, rest)] if rest else [])


def summaries(args: argparse.Namespace) -> Iterator[tuple[Summary, int]]:
    """Run all campaigns on several processes."""
    wanted = runs(args.seed, args.messages)
    jobs = args.jobs
    if jobs == 1 or len(wanted) == 1:
        for each in wanted:
            yield run(*each)
        return
    with ProcessPoolExecutor(jobs, get_context("spawn")) as processes:
        futures = [processes.submit(run, *each) for each in wanted]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            processes.shutdown(cancel_futures=True)


def reproduce(path: Path) -> list[str]:
    """Return what a saved input breaks: first alone, and if it then breaks nothing, behind all inputs before it."""
    failure = Failure(**json.loads(path.read_text()))
    if failure.topic:
        problems = is_broken_by(Topic[failure.topic], base64.b64decode(failure.data))
        if problems:
            return problems
    summary = Campaign(failure.seed).run(failure.index + 1)
    return [each.problem for each in summary.failures]


def in_process(args: argparse.Namespace) -> dict[str, Any]:
    """Run the campaigns with a progress bar. Return the totals."""
    began = time.monotonic()
    totals: dict[str, Any] = {"messages": 0, "steps": 0, "known answers": 0, "restarts": 0, "refused": 0}
    failures: list[Failure] = []
    slowest, first, last = (0.0, 0.0, 0, 0), 0, 0
    digests: dict[int, str] = {}
    console = Console(stderr=True)
    columns = ("attacks", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=args.messages)
        for summary, memory in summaries(args):
            bar.update(task, advance=summary.messages)
            totals["messages"] += summary.messages
            totals["steps"] += summary.steps
            totals["known answers"] += summary.accepted
            totals["restarts"] += summary.restarts
            totals["refused"] += sum(summary.refused.values())
            failures += summary.failures
            slowest = max(slowest, *summary.slowest, (0.0, 0.0, 0, 0))
            first, last = first or memory, max(last, memory)
            digests[summary.seed] = f"{summary.digest:016x}"
            if len(failures) >= args.failures:
                break
    totals["slowest input"] = f"{1e3 * slowest[0]:.0f} ms, {slowest[3]:,} bytes"
    totals["memory"] = f"{last / 1e6:.0f} MB, {(last - first) / 1e6:+.0f} MB since the first run"
    totals["seconds"] = round(time.monotonic() - began, 1)
    totals["failures"] = [str(each.save(args.folder)) for each in failures]
    totals["problems"] = [each.problem for each in failures]
    if args.jobs == 1 and last - first > WORKER_GROWTH:
        totals["failures"].append("memory")
    return {**totals, "digests": dict(sorted(digests.items()))}


def over_dds(args: argparse.Namespace) -> dict[str, Any]:
    """Attack a node in its own process."""
    from dds_campaign import attack_node  # imports rclpy

    console = Console(stderr=True)
    columns = ("attacks over DDS", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=args.messages)
        return attack_node(args.seed, args.messages, args.rate, args.folder, lambda n: bar.update(task, advance=n))


def main(arguments: list[str] | None = None) -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1, help="seed of the first run; the next runs have the next ones")
    parser.add_argument("--jobs", type=int, default=max(1, (cpu_count() or 2) - 1), help="processes")
    parser.add_argument("--failures", type=int, default=5, help="end after so many")
    parser.add_argument("--folder", type=Path, default=Path("build/fuzz"), help="for the inputs of failures")
    parser.add_argument("--reproduce", type=Path, metavar="FILE", help="send a saved input again")
    parser.add_argument("--dds", action="store_true", help="attack a node in its own process, over DDS")
    parser.add_argument("--rate", type=float, default=500.0, help="messages per second over DDS")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    args = parser.parse_args(arguments)
    if args.reproduce:
        problems = reproduce(args.reproduce)
        print("\n".join(problems) or "it breaks nothing any more")
        return FAILED if problems else 0
    totals = over_dds(args) if args.dds else in_process(args)
    if args.json:
        print(json.dumps(totals))
    else:
        for name, value in totals.items():
            if name != "digests":
                print(f"{name:15} {value:,}" if isinstance(value, int) else f"{name:15} {value}")
    return FAILED if totals["failures"] else 0


if __name__ == "__main__":
    sys.exit(main())
