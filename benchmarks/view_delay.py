"""Delay of the page of `view` with many moving objects: from a step to the browser that shows it.

python benchmarks/view_delay.py --objects 1000 --rate 20 --seconds 60     needs Chromium

Feeds the view's scene with states and with answers without pairs, and reads from the page, in a headless Chromium that
renders in software, the number of the step that it shows. Prints for each part of the time the delay of the page behind
the feed, the pictures a second, and what a picture costs the server. A delay that grows would show in the last rows.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "test" / "helpers")]

from browser import Browser  # noqa: E402

from collision_monitor import records  # noqa: E402
from collision_monitor.codec import encode_contacts, encode_descriptions, encode_predictions, encode_states  # noqa: E402
from collision_monitor.objects.description import ObjectDescription  # noqa: E402
from collision_monitor.shapes.registry import Box, Capsule, Sphere  # noqa: E402
from collision_monitor.view.server import start_server, stop_server  # noqa: E402
from collision_monitor.view.topic_content import TopicContent  # noqa: E402
from collision_monitor.view.view import View  # noqa: E402
from collision_monitor.world.scene import state_array  # noqa: E402

PARTS = 6


def main() -> None:
    """Run the measurement and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=1000)
    parser.add_argument("--rate", type=float, default=20.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--width", type=int, default=900, help="of the window (pixels)")
    parser.add_argument("--height", type=int, default=700)
    args = parser.parse_args()
    server = start_server(port=0)
    view = View(server)
    view.panel.add_rest()
    scene = TopicContent()
    shapes = (Sphere(0.3), Box((0.6, 0.4, 0.5)), Capsule(0.2, 0.6))
    objects = [ObjectDescription(k, shapes[k % 3]) for k in range(args.objects)]
    scene.take("ObjectDescriptionArray", encode_descriptions(1, "world", objects, snapshot=True))
    with tempfile.TemporaryDirectory() as folder:
        browser = Browser(Path(folder) / "browser", args.width, args.height)
        browser.open(f"http://127.0.0.1:{server.get_port()}")
        seen: list[tuple[float, int]] = []
        done = threading.Event()

        def watch() -> None:
            while not done.is_set():
                text = browser.text
                if "step " in text:
                    seen.append((time.monotonic(), int(text.split("step ")[1].split()[0])))
                time.sleep(0.02)

        watcher = threading.Thread(target=watch)
        watcher.start()
        published, costs = _feed(view, scene, args)
        done.set()
        watcher.join()
        browser.close()
    stop_server(server)
    _report(seen, published, costs, args.seconds)


def _feed(view: View, scene: TopicContent, args: argparse.Namespace) -> tuple[list[float], list[float]]:
    """Take steps at the rate and show each. Return when each was published (s), and what its picture cost (s)."""
    while not view.is_watched:
        time.sleep(0.05)
    ids = np.arange(args.objects, dtype=np.uint32)
    rows = state_array(ids)
    side = int(np.ceil(np.sqrt(args.objects)))
    home = 1.5 * np.stack([ids % side, ids // side, 0 * ids], axis=1)
    none = np.zeros(0, np.uint32)
    published, costs = [], []
    begin = time.monotonic()
    for step in range(int(args.seconds * args.rate)):
        t = step / args.rate
        rows["position"] = home + 0.4 * np.stack([np.sin(t + ids), np.cos(t + ids), 0 * ids], axis=1)
        stamp = round(1e9 * (1.0 + t))
        scene.take("ObjectStateArray", encode_states(stamp, "world", step, rows))
        contacts = encode_contacts(stamp, "world", step, np.zeros(0, records.CONTACT), none, [])
        scene.take("ContactArray", contacts)
        predictions = encode_predictions(stamp, "world", step, 2.0, np.zeros(0, records.PREDICTION), none, [])
        scene.take("PredictedCollisionArray", predictions)
        published.append(time.monotonic())
        moment = scene.moment()
        view.show(moment, f"bench, step {moment.step}", [])
        costs.append(time.monotonic() - published[-1])
        time.sleep(max(0.0, begin + (step + 1) / args.rate - time.monotonic()))
    time.sleep(1.0)
    return published, costs


def _report(seen: list[tuple[float, int]], published: list[float], costs: list[float], seconds: float) -> None:
    begin = published[0]
    median, tail = 1e3 * np.quantile(costs, [0.5, 0.99])
    print(f"a picture costs the server {median:.1f} ms (median), {tail:.1f} ms (99 %)")
    print(f"{'from':>6}{'to':>6}{'delay median':>14}{'worst':>9}{'pictures/s':>12}")
    for part in range(PARTS):
        low, high = part * seconds / PARTS, (part + 1) * seconds / PARTS
        mine = [(at, step) for at, step in seen if low <= at - begin < high]
        delay = np.array([at - published[min(step, len(published) - 1)] for at, step in mine])
        rate = len({step for _, step in mine}) / (high - low)
        print(f"{low:5.0f}s{high:5.0f}s{1e3 * np.median(delay):11.0f} ms{1e3 * delay.max():6.0f} ms{rate:12.1f}")


if __name__ == "__main__":
    main()
