"""Attack the pipeline with hostile messages, in this process or a node over DDS; or the sources with those of others.

    make fuzz                                           # 100,000 messages
    make fuzz ARGS="--messages 1000000 --seed 7"
    make fuzz ARGS="--dds --messages 20000"             # a node in its own process, on a ROS domain of its own
    make fuzz ARGS="--sources --messages 1000000"       # messages of other programs, of all types of docs/sources.md
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
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from os import cpu_count
from pathlib import Path
from typing import Any, Final

HERE: Final = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(HERE.parents[1])]

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


def results(args: argparse.Namespace, run_one: Callable[[int, int], Any]) -> Iterator[Any]:
    """Run all campaigns on several processes, each by `run_one` with its seed and number of messages."""
    wanted = runs(args.seed, args.messages)
    jobs = args.jobs
    if jobs == 1 or len(wanted) == 1:
        for each in wanted:
            yield run_one(*each)
        return
    with ProcessPoolExecutor(jobs, get_context("spawn")) as processes:
        futures = [processes.submit(run_one, *each) for each in wanted]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            processes.shutdown(cancel_futures=True)


def reproduce(path: Path) -> list[str]:
    """Return what a saved input breaks: first alone, and if it then breaks nothing, behind all inputs before it."""
    content = json.loads(path.read_text())
    if "line" in content:  # that a node or an import kept
        return reproduce_source(path)
    failure = Failure(**content)
    if failure.topic in Topic.__members__:
        problems = is_broken_by(Topic[failure.topic], base64.b64decode(failure.data))
        if problems:
            return problems
    if failure.topic.startswith("/"):
        summary = run_sources(failure.seed, failure.index + 1)
    else:
        summary = Campaign(failure.seed).run(failure.index + 1)
    return [each.problem for each in summary.failures]


def reproduce_source(path: Path) -> list[str]:
    """Return what a message breaks that a node kept for a report, in sources of all types."""
    from source_campaign import broken_by

    from collision_monitor.sources.failures import read_failure

    return broken_by(read_failure(path))


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
        for summary, memory in results(args, run):
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


def run_sources(seed: int, messages: int) -> Any:
    """Run one campaign against the sources. Return its summary."""
    from source_campaign import SourceCampaign

    return SourceCampaign(seed).run(messages)


def against_sources(args: argparse.Namespace) -> dict[str, Any]:
    """Attack the sources. Return the totals."""
    began = time.monotonic()
    totals: dict[str, Any] = {"messages": 0, "known objects": 0, "states": 0, "descriptions": 0, "refused": 0}
    by_topic: Counter[str] = Counter()
    slowest: dict[str, float] = {}
    failures: list[Failure] = []
    console = Console(stderr=True)
    columns = ("attacks on the sources", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=args.messages)
        for summary in results(args, run_sources):
            bar.update(task, advance=summary.messages)
            for name, value in zip(totals, (summary.messages, summary.known, summary.states), strict=False):
                totals[name] += value
            totals["descriptions"] += summary.descriptions
            totals["refused"] += summary.refused
            by_topic += summary.by_topic
            for topic, took in summary.slowest.items():
                slowest[topic] = max(slowest.get(topic, 0.0), took)
            failures += summary.failures
            if len(failures) >= args.failures:
                break
    worst = sorted(slowest.items(), key=lambda each: -each[1])
    totals["slowest"] = ", ".join(f"{topic} {1e3 * took:.0f} ms" for topic, took in worst[:5])
    totals["seconds"] = round(time.monotonic() - began, 1)
    totals["failures"] = [str(each.save(args.folder)) for each in failures]
    totals["problems"] = [each.problem for each in failures]
    return {**totals, "by topic": dict(sorted(by_topic.items()))}


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
    parser.add_argument("--sources", action="store_true", help="attack the sources with messages of other programs")
    parser.add_argument("--dds", action="store_true", help="attack a node in its own process, over DDS")
    parser.add_argument("--rate", type=float, default=500.0, help="messages per second over DDS")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    args = parser.parse_args(arguments)
    if args.reproduce:
        problems = reproduce(args.reproduce)
        print("\n".join(problems) or "it breaks nothing any more")
        return FAILED if problems else 0
    attack = against_sources if args.sources else over_dds if args.dds else in_process
    totals = attack(args)
    if args.json:
        print(json.dumps(totals))
    else:
        for name, value in totals.items():
            if name not in ("digests", "by topic"):
                print(f"{name:15} {value:,}" if isinstance(value, int) else f"{name:15} {value}")
    return FAILED if totals["failures"] else 0


if __name__ == "__main__":
    sys.exit(main())
