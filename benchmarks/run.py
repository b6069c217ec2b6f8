"""Compare full detection with every installed peer, one after the other on the same saved scenes.

    python benchmarks/run.py                 everything: about half an hour
    python benchmarks/run.py --quick         a few peers, small scenes: about a minute
    python benchmarks/run.py --scenes boxes --n 10000 --only native-fcl,native-bullet

Prints milliseconds per frame and the ratio to our time for each peer; writes results.json and results.png into
benchmarks/results/. `make bench-peers` installs the peers; --peers names their runner, which is not in this repository.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from collision_monitor._version import VERSION
from collision_monitor.accuracy.detection_time import CHECKED_FRAME
from collision_monitor.detection.detector import Detector
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.world.moving_bodies import BENCHMARK_SCENES, load_moving_bodies, make_moving_bodies

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
PEERS_FOLDER = ROOT / ".venv-peers"
QUICK = "native-fcl,native-bullet,native-coal,rapier-sensor,mujoco"


def peers_python() -> str:
    """Path of the Python with the peers' packages."""
    own = PEERS_FOLDER / "bin" / "python"
    return str(own) if own.exists() else sys.executable


def run_peers(runner: Path, scene: str, n: int, args: argparse.Namespace, folder: Path) -> list[dict[str, Any]]:
    """Run the peers on one scene, which they save in `folder`; returns their results."""
    answer = folder / "peers.json"
    command = [peers_python(), str(runner), "--scene", scene, "--n", str(n), "--seed", str(args.seed)]
    command += ["--peers", args.only, "--budget", str(args.budget), "--json", str(answer), "--save-scenes", str(folder)]
    command += ["--node-dir", str(PEERS_FOLDER)]
    result = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"})
    if result.returncode:
        print(f"the peers' runner failed: {result.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return []
    rows: list[dict[str, Any]] = json.loads(answer.read_text())
    return rows


def run_ours(file: Path, threads: int) -> dict[str, Any]:
    """Run our detector in its own process, like the peers; returns its result."""
    command = [sys.executable, "-m", "collision_monitor", "bench", "--scene-file", str(file), "--json"]
    result = subprocess.run([*command, "--threads", str(threads)], capture_output=True, text=True)
    if result.returncode:
        raise SystemExit(f"collision-monitor bench failed: {result.stderr.strip()}")
    row: dict[str, Any] = json.loads(result.stdout)
    return row


def check(runner: Path, file: Path, folder: Path) -> dict[str, Any]:
    """Compare our pairs and depths with the peers' reference."""
    scene = load_moving_bodies(file)
    contacts = Detector(scene.shapes).detect(scene.positions[CHECKED_FRAME], scene.quaternions[CHECKED_FRAME])
    ours = folder / "ours.npz"
    np.savez(ours, pairs=contacts.pairs, depth=-contacts.signed_distance)
    command = [peers_python(), str(ROOT / "benchmarks" / "check_pairs.py"), str(runner), str(file), str(ours)]
    result = subprocess.run(command, capture_output=True, text=True)
    answer: dict[str, Any] = json.loads(result.stdout) if result.returncode == 0 else {"reference": None}
    return answer


def show(scene: str, n: int, ours: list[dict[str, Any]], peers: list[dict[str, Any]], checked: dict[str, Any]) -> None:
    """Print the table of one scene."""
    best = min(row["median_ms"] for row in ours)
    print(f"\n{scene}, {n} objects: {ours[0]['pairs']} colliding pairs", end="")
    if checked.get("reference"):
        print(
            f"; against {checked['reference']}: {checked['missing']} missing, {checked['extra']} extra, "
            f"depths within {checked['worst_depth_difference_m']:.1e} m",
            end="",
        )
    print(f"\n  {'':28s}{'ms':>10s}{'ratio':>8s}")
    for row in ours:
        name = f"ours, {row['threads']} thread{'s'[: row['threads'] > 1]}"
        print(f"  {name:28s}{row['median_ms']:10.4f}{row['median_ms'] / best:8.1f}")
    for row in sorted((row for row in peers if "error" not in row), key=lambda row: row["total_ms"]):
        print(f"  {row['peer']:28s}{row['total_ms']:10.4f}{row['total_ms'] / best:8.1f}")
    failed = [row["peer"] for row in peers if "error" in row]
    if failed:
        print(f"  without a result: {', '.join(failed)}")


def plot(results: list[dict[str, Any]], file: Path) -> None:
    """Plot the time against the number of objects, log-log, with a panel for each scene."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    scenes = [scene for scene in BENCHMARK_SCENES if any(entry["scene"] == scene for entry in results)]
    figure, axes = pyplot.subplots(
        1, len(scenes), figsize=(3.6 * len(scenes) + 1.6, 4.6), sharey=True, squeeze=False, layout="constrained"
    )
    curves: dict[str, dict[str, list[tuple[int, float]]]] = {scene: {} for scene in scenes}
    for entry in results:
        mine = [(f"ours, {row['threads']} thr.", row["median_ms"]) for row in entry["ours"]]
        theirs = [(row["peer"], row["total_ms"]) for row in entry["peers"] if "error" not in row]
        for name, ms in mine + theirs:
            curves[entry["scene"]].setdefault(name, []).append((entry["n"], ms))
    names = sorted({name for of_scene in curves.values() for name in of_scene if not name.startswith("ours")})
    colours = dict(zip(names, pyplot.get_cmap("tab20").colors, strict=False))
    lines: dict[str, Any] = {}
    for axis, scene in zip(axes[0], scenes, strict=True):
        for name, points in curves[scene].items():
            ours = name.startswith("ours")
            style = {"linewidth": 2.6, "color": "black"} if ours else {"linewidth": 1.0, "color": colours.get(name)}
            dashes = "--" if name == "ours, 1 thr." else "-"
            (line,) = axis.plot(*zip(*sorted(points), strict=True), dashes, marker="o", markersize=3, **style)
            lines[name] = line
        axis.set(xscale="log", yscale="log", title=scene, xlabel="objects")
        axis.grid(which="both", linewidth=0.3)
    axes[0][0].set_ylabel("ms per frame, every pose new")
    best = {name: min(max(of_scene[name])[1] for of_scene in curves.values() if name in of_scene) for name in lines}
    order = sorted(lines, key=lambda name: -best[name])  # in the order of the lines from top to bottom
    figure.legend([lines[name] for name in order], order, loc="outside right center", fontsize=7)
    figure.savefig(file, dpi=90)


def main() -> int:
    """Run the comparison; the exit code is 0 even if a peer fails."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=f"100 and 1,000 objects, {QUICK}")
    parser.add_argument("--peers", type=Path, default=ROOT.parent / "shared" / "bench" / "peers.py", metavar="PEERS.PY")
    parser.add_argument("--only", metavar="A,B", help="run only these peers (default: all)")
    parser.add_argument("--scenes", default=",".join(BENCHMARK_SCENES), metavar="A,B")
    parser.add_argument("--n", metavar="N,M", help="numbers of objects (default: 100,1000,10000)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--budget", type=float, help="seconds of frames for each peer and scene (default: 20)")
    parser.add_argument("--out", type=Path, default=RESULTS, metavar="FOLDER")
    args = parser.parse_args()
    args.only = args.only or (QUICK if args.quick else "all")
    args.budget = args.budget or (1.0 if args.quick else 20.0)
    numbers = [int(n) for n in (args.n or ("100,1000" if args.quick else "100,1000,10000")).split(",")]
    threads = sorted({1, min(2, os.cpu_count() or 1)})
    there = args.peers.is_file()
    if not there:
        print(f"no peers: their runner is not at {args.peers} (set it with --peers); ours alone", file=sys.stderr)
    args.out.mkdir(parents=True, exist_ok=True)
    results = []
    for scene in args.scenes.split(","):
        for n in numbers:
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                peers = run_peers(args.peers, scene, n, args, folder) if there else []
                file = folder / f"{scene}_{n}_seed{args.seed}.npz"
                if not file.exists():
                    make_moving_bodies(scene, n, args.seed).save(file)
                ours = [run_ours(file, count) for count in threads]
                checked = check(args.peers, file, folder) if there else {}
            show(scene, n, ours, peers, checked)
            results.append({"scene": scene, "n": n, "ours": ours, "check": checked, "peers": peers})
    about = {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "version": VERSION,
        "python": platform.python_version(),
        "processors": os.cpu_count(),
        "load": os.getloadavg()[0],
        "command": " ".join(["python", "benchmarks/run.py", *sys.argv[1:]]),
    }
    (args.out / "results.json").write_text(json.dumps({"about": about, "results": results}, indent=1) + "\n")
    plot(results, args.out / "results.png")
    print(f"\nwritten: {args.out / 'results.json'}, {args.out / 'results.png'}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except CollisionMonitorError as error:
        sys.exit(f"error: {error}")
