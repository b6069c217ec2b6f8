"""What a sources file asked for and was not there is in the session of an import, and on the page of its report."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from foreign_bag import SECOND, START, odometry, pose_stamped, write_bag

from collision_monitor.codec import decode_diagnostics
from collision_monitor.report import write_report
from collision_monitor.session import Session
from collision_monitor.session.history.read_history import read_history
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.sources import import_bag
from collision_monitor.sources.ground.mapping import make_mapping

MAPPING: dict[str, Any] = {
    "frame": "map",
    "objects": {
        "cart": {"topic": "/odom", "shape": {"box": [1.2, 0.8, 0.5]}},
        "person": {"topic": "/person", "shape": {"cylinder": [0.3, 1.8]}},
    },
}
URDF = """<robot name="two"><link name="base"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
<joint name="a" type="fixed"><parent link="base"/><child link="forearm"/></joint><link name="forearm"><collision>
<geometry><mesh filename="package://nowhere/&lt;b&gt;.stl"/></geometry></collision></link></robot>"""


def scene(late: float) -> Iterator[tuple[str, int, tuple[str, Any]]]:
    """A cart for 4 s, and a person whose topic begins late (s)."""
    for k in range(80):
        stamp = START + k * SECOND // 20
        yield "/odom", stamp, odometry("map", stamp, (0.1 * k, 0, 0), (0, 0, 0, 1), (2, 0, 0), (0, 0, 0))
        if k >= 20 * late:
            yield "/person", stamp + 1000, pose_stamped("map", stamp, (0, 9, 0))


@pytest.fixture
def session(tmp_path: Path) -> Path:
    (tmp_path / "arm.urdf").write_text(URDF)
    arm = {"urdf": str(tmp_path / "arm.urdf"), "base": {"pose": [0, 20, 0]}}
    import_bag(
        write_bag(tmp_path / "bag", scene(2.5)),
        tmp_path / "run.mcap",
        make_mapping({**MAPPING, "robots": {"arm": arm}}),
    )
    return tmp_path / "run.mcap"


def test_the_session_holds_the_list_at_each_change(session: Path) -> None:
    found = [decode_diagnostics(m.data) for m in Session(session).messages() if m.topic == "/object_monitor/sources"]
    named = [[status.name.rpartition(": ")[2] for status in each.statuses] for each in found]
    assert named[-2:] == [["/person", "arm/forearm"], ["arm/forearm"]]
    assert {status.level for each in found for status in each.statuses} == {2}
    assert (found[-1].stamp_ns - START) / SECOND == pytest.approx(2.5, abs=0.06)
    assert replay(Session(session)).verdict is Verdict.IDENTICAL


def test_the_report_lists_what_was_missing_and_when(session: Path, tmp_path: Path) -> None:
    history = read_history(Session(session))
    spans = {each.text.partition(":")[0]: each for each in history.unmonitored if each.is_lasting}
    assert set(spans) == {"person", "arm"}
    assert spans["person"].begin <= 0.0
    assert spans["person"].end == pytest.approx(2.5, abs=0.06)
    assert spans["arm"].end is None
    write_report(history, tmp_path / "run.html")
    page = (tmp_path / "run.html").read_text()
    assert "<h2>Not monitored</h2>" in page
    assert "not monitored: person: no message on /person yet" in page
    assert "nowhere/&lt;b&gt;.stl" in page and "<b>" not in page
    assert "not everything is known" in page


def test_what_comes_with_the_first_messages_is_not_worth_a_word(tmp_path: Path) -> None:
    import_bag(write_bag(tmp_path / "bag", scene(0.0)), tmp_path / "run.mcap", make_mapping(MAPPING))
    history = read_history(Session(tmp_path / "run.mcap"))
    assert not [each for each in history.unmonitored if each.is_lasting]
    write_report(history, tmp_path / "run.html")
    assert "Not monitored" not in (tmp_path / "run.html").read_text()
