"""Reads damaged and hostile copies of sessions, and reports each that is not answered within limits.

python test/attacks/fuzz_sessions.py --files 100000 --seed 1 --jobs 4
python test/attacks/fuzz_sessions.py --only 4711        the file of one seed, kept, with its outcomes
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(HERE.parents[1])]

from session_mutations import mutate, repacked, steady  # noqa: E402
from session_scene import record  # noqa: E402

from collision_monitor.pipeline.pipeline import Pipeline  # noqa: E402
from collision_monitor.session import Session  # noqa: E402
from collision_monitor.session.mcap.salvage import salvage  # noqa: E402
from collision_monitor.session.recording import recorder, recording_files  # noqa: E402
from collision_monitor.session.replaying.replay import replay  # noqa: E402
from collision_monitor.session.replaying.replay_report import Verdict  # noqa: E402
from collision_monitor.settings.profile import Profile  # noqa: E402

CHILD_FILES = 100
"""Files that one child reads before another takes its place."""


@dataclass
class Found:
    """Result: number of files, of each outcome, and of each way to break one with the seeds that did."""

    files: int = 0
    outcomes: Counter[str] = field(default_factory=Counter)
    problems: dict[int, str] = field(default_factory=dict)
    slowest: tuple[float, int] = (0.0, 0)
    largest: tuple[float, int] = (0.0, 0)


def make_bases(folder: Path) -> list[bytes]:
    """Whole sessions: ours with snapshots and a change of settings, cut, and the same packed in other ways."""
    with (  # a snapshot each 0.1 s, however small the session
        patch.multiple(recorder, SNAPSHOT_PERIOD=0.1, EVENT_SNAPSHOT_PERIODS=(0.02, 0.02)),
        patch.multiple(recording_files, SNAPSHOT_PERIOD=0.1, SNAPSHOT_SHARE=1e9),
    ):
        pipeline = Pipeline("balanced", timed=False)
        record(folder / "new.mcap", 20, pipeline=pipeline, snapshots=True, switches={10: Profile.named("fast")})
    ours = steady((folder / "new.mcap").read_bytes())
    (folder / "base.mcap").write_bytes(ours)
    assert replay(Session(folder / "base.mcap")).verdict is Verdict.IDENTICAL
    salvage(folder / "base.mcap", folder / "indexed.mcap")
    indexed = (folder / "indexed.mcap").read_bytes()
    return [ours, ours, indexed, *(repacked(ours, kind) for kind in ("lz4", "", "none"))]


class Child:
    """A process that reads the files named to it."""

    def __init__(self, warm: Path) -> None:
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115  (closed with the child)
        self._process = subprocess.Popen(
            [sys.executable, str(HERE / "session_child.py"), str(warm)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, sys.path[:3])), "NUMBA_NUM_THREADS": "1"},
        )

    def read(self, path: Path) -> dict[str, Any] | None:
        """Return the child's answer; None if it ended."""
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            self._process.stdin.write(f"{path}\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return None
        line = self._process.stdout.readline()
        return json.loads(line) if line else None

    def close(self) -> str:
        """End the child and return the end of what it wrote on stderr."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        code = self._process.wait(timeout=60)
        self._errors.seek(0)
        return f"the process ended with {code}\n{self._errors.read()[-3000:]}"


def run(
    seeds: range,
    bases: list[bytes],
    folder: Path,
    *,
    jobs: int = 1,
    child_files: int = CHILD_FILES,
    keep: Path | None = None,
    progress: Callable[[Found], None] = lambda _: None,
) -> Found:
    """Read the files of the seeds. folder: of `make_bases`. keep: folder for those with problems.

    progress: called after each file.
    """
    found = Found()

    def lot(part: range) -> Iterator[tuple[int, str, dict[str, Any]]]:
        child = Child(folder / "base.mcap")
        for seed in part:
            data, what = mutate(bases, seed)
            path = folder / f"{seed}.mcap"
            path.write_bytes(data)
            answer = child.read(path)
            if answer is None:
                answer = {"problem": child.close(), "outcomes": {}}
                child = Child(folder / "base.mcap")
            if answer["problem"] and keep is not None:
                keep.mkdir(parents=True, exist_ok=True)
                (keep / path.name).write_bytes(data)
            path.unlink()
            yield seed, what, answer
        child.close()

    def take(part: range) -> None:
        for seed, what, answer in lot(part):
            found.files += 1
            if answer["problem"]:
                found.problems[seed] = f"{what}: {answer['problem']}"
            for way, (text, took, grown) in answer["outcomes"].items():
                found.outcomes[f"{way}: {text.partition(':')[0].lstrip('0123456789 ').split(',')[0]}"] += 1
                found.slowest = max(found.slowest, (took, seed))
                found.largest = max(found.largest, (grown, seed))
            progress(found)

    lots = [seeds[k : k + child_files] for k in range(0, len(seeds), child_files)]
    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(take, lots))
    return found


def print_problems(files: int, problems: dict[int, str], began: float) -> int:
    """Print the problems by seed, and how many files were read since `began` (s). Return the exit code."""
    for seed, problem in sorted(problems.items())[:50]:
        print(f"seed {seed}: {problem}")
    print(f"{files} files in {time.monotonic() - began:.0f} s, {len(problems)} with problems")
    return 1 if problems else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=1000, metavar="N", help="number of files (default: 1000)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first file; each file has the next one")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes")
    parser.add_argument("--keep", type=Path, default=Path("build/fuzz"), help="folder for files with problems")
    parser.add_argument("--only", type=int, metavar="SEED", help="read the file of this seed, and keep it")
    args = parser.parse_args()
    if args.only is not None:
        args.seed, args.files, args.jobs = args.only, 1, 1
    begin = time.monotonic()

    def show(found: Found) -> None:
        if sys.stderr.isatty() or found.files % 1000 == 0:
            rate = found.files / (time.monotonic() - begin)
            done = 30 * found.files // args.files
            bar = "#" * done + "." * (30 - done)
            line = f"[{bar}] {found.files}/{args.files} files, {rate:.1f}/s, {len(found.problems)} problems"
            print(line, end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr, flush=True)

    with tempfile.TemporaryDirectory() as folder:
        bases = make_bases(Path(folder))
        seeds = range(args.seed, args.seed + args.files)
        found = run(seeds, bases, Path(folder), jobs=args.jobs, keep=args.keep, progress=show)
    print(file=sys.stderr)
    for outcome, count in found.outcomes.most_common(40):
        print(f"{count:9d}  {outcome}")
    print(f"slowest    {found.slowest[0]:.2f} s (seed {found.slowest[1]})")
    print(f"largest    {found.largest[0]:.0f} MiB (seed {found.largest[1]})")
    return print_problems(found.files, found.problems, begin)


if __name__ == "__main__":
    sys.exit(main())
