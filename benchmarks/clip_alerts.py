"""The alerts of recorded clips beside what plain predictions would have reported.

Plain: a warning for each unbroken run of predictions of a cart and a person. Alerts: by the rule of
config/rules.yaml, with its debounce. Prints a Markdown table.

    python benchmarks/clip_alerts.py ../shared/data/citr
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np

from collision_monitor.alerts.rules import Rules
from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.codec import CollisionAlert, decode_alert, encode_descriptions, encode_states
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.world.recorded_tracks import FRAME_RATE, RecordedTracks

ROOT = Path(__file__).parents[1]


def play(prefix: Path, rules: Rules) -> tuple[dict[tuple[int, int], list[int]], list[CollisionAlert]]:
    """Return the frames with a prediction of each pair of a cart and a person, and the alerts."""
    scene = RecordedTracks(None, None, prefix)
    pipeline = Pipeline(rules=rules)
    pipeline.on_shapes(encode_descriptions(0, "world", scene.descriptions))
    carts = {each.object_id for each in scene.descriptions if "cart" in each.name}
    predicted: dict[tuple[int, int], list[int]] = {}
    alerts: list[CollisionAlert] = []
    frames = round(scene.duration * FRAME_RATE) + 1
    for frame in range(frames):
        scene.time = frame / FRAME_RATE
        data = encode_states(round(1e9 * frame / FRAME_RATE), "world", frame, scene.states())
        outputs = pipeline.on_states(data)
        assert outputs is not None
        for row in outputs.result.predictions:
            pair = int(row["id_a"]), int(row["id_b"])
            if len(carts & set(pair)) == 1:
                predicted.setdefault(pair, []).append(frame)
        alerts += map(decode_alert, outputs.alerts)
    return predicted, alerts


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with the clips")
    parser.add_argument("--list", action="store_true", help="print every alert")
    args = parser.parse_args()
    rules = Rules.given(str(ROOT / "config/rules.yaml"))
    heads = ("clip", "runs of predictions", "of 1 or 2 frames", "alerts raised", *LEVELS, "shortest alert (s)")
    print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
    for path in sorted(args.folder.glob("*_ped.csv")):
        prefix = path.with_name(path.name.removesuffix("_ped.csv"))
        predicted, alerts = play(prefix, rules)
        lengths = []
        for frames in predicted.values():
            breaks = np.flatnonzero([b - a > 1 for a, b in pairwise(frames)]) + 1
            lengths += [len(run) for run in np.split(np.array(frames), breaks)]
        alerts = [each for each in alerts if each.rule == "person near vehicle"]
        raised = sum(not each.previous_level for each in alerts)
        highest = [sum(each.previous_level < k <= each.level for each in alerts) for k in (1, 2, 3)]
        lasted = [(each.stamp_ns - each.since_ns) * 1e-9 for each in alerts if not each.level]
        short = sum(length <= 2 for length in lengths)
        counts = " | ".join(map(str, highest))
        print(f"| {prefix.name} | {len(lengths)} | {short} | {raised} | {counts} | {min(lasted, default=np.nan):.2f} |")
        for each in alerts if args.list else ():
            print(f"    {each.stamp_ns * 1e-9:6.2f} s  {each.previous_level} -> {each.level}  {each.text}")


if __name__ == "__main__":
    main()
