"""Two monitors of one name on one domain: each one goes on, and each one's log says so."""

import itertools
from collections import Counter

import numpy as np

from collision_monitor import records
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.registry import Sphere

WARNING = "another node has the name /object_monitor"


def overlapping():
    rows = np.zeros(2, records.STATE)
    rows["id"], rows["quaternion"][:, 3], rows["position"][:, 0] = (1, 2), 1.0, (0.0, 0.9)
    return rows


def test_each_of_two_nodes_of_one_name_goes_on_and_warns(start, team):
    first = start("run")
    team.meet()
    assert WARNING not in first.words
    second = start("run")
    team.until(lambda: WARNING in first.words and WARNING in second.words, 60.0)
    team.describe(*(ObjectDescription(i, Sphere(0.5)) for i in (1, 2)))
    team.listen(0.5)
    stamps = itertools.count(team.now, 10_000_000)

    def both_answer():
        """Whether both answered ten of the states so far, each with the contact. Sends one more: some are lost."""
        team.say(*overlapping(), stamp=next(stamps))
        team.listen(0.02)
        answers = Counter((m.header.stamp.sec, m.header.stamp.nanosec) for m in team.contacts if len(m.contacts) == 1)
        return list(answers.values()).count(2) >= 10

    team.until(both_answer)
    assert first.running and second.running
    assert second.stop() == 0
    team.until(lambda: "no other node has the name /object_monitor any more" in first.words)
    team.ask(*overlapping())
    assert first.words.count(WARNING) == 1, "once, not at each look"
    assert first.stop() == 0
