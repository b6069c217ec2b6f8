"""The live view: a real monitor over DDS, and its page in a headless Chromium."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest
from browser import CHROMIUM, Browser, until

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, Sphere


def state(object_id, x, speed=0.0):
    row = np.zeros((), records.STATE)
    row["id"], row["position"][0], row["quaternion"], row["linear"][0] = object_id, x, (0, 0, 0, 1), speed
    return row


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium")
def test_the_page_follows_the_monitor_and_says_when_it_is_gone(start, team, tmp_path):
    monitor, view = start("run"), start("view", "--port", "0")
    until(lambda: "http" in view.words)
    url = re.search(r"http://[\d.]+:\d+", view.words)[0]
    browser = Browser(tmp_path / "browser", 900, 700)
    browser.open(url)
    browser.until_shown("waiting for answers of /object_monitor", "not known")
    team.meet()
    wall = ObjectDescription(2, Box((0.2, 2, 2)), name="wall", static=True, pose=Pose((5, 0, 0)))
    team.describe(ObjectDescription(1, Sphere(0.5), name="ball"), wall, snapshot=True)

    def shown(*parts, x, speed=0.0):
        def publish_and_look():
            team.say(state(1, x, speed))
            team.listen(0.1)
            return all(part in browser.text for part in parts)

        until(publish_and_look, lambda: f"{parts} in {browser.text}; {view.words}")

    shown("2 objects", "0 touching", "none is predicted", x=0.0)
    shown("1 predicted", "s ball – wall", x=3.4, speed=1.0)
    shown("1 touching", "now, ", "ball – wall", x=4.5)
    team.describe(ObjectDescription(3, Sphere(0.1), name="new one"))
    shown("2 objects", "1 without a pose", x=4.5)
    monitor.stop()
    browser.until_shown("NO ANSWERS for", "touching and predicted pairs are not known")
    browser.close()
    assert browser.requests() and all(each.startswith(f"ws{url[4:]}") for each in browser.requests())
    time.sleep(0.2)
    assert view.stop() == 0 and "Traceback" not in view.words
