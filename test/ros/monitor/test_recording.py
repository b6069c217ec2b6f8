"""The session that the node records, which gives the same answers again without ROS."""

import resource
import shutil

import numpy as np
import pytest

from collision_monitor import records
from collision_monitor.codec import decode_contacts, decode_descriptions
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session import Session
from collision_monitor.shapes.registry import Box
from collision_monitor_msgs.msg import MonitorStatus


def states(step):
    rows = np.zeros(20, records.STATE)
    rows["id"] = np.arange(1, 21)
    rows["quaternion"][:, 3] = 1.0
    rows["linear"][:, 0] = np.where(rows["id"] % 2, 0.5, -0.5)
    rows["position"][:, 0] = np.where(rows["id"] % 2, -1.5, 1.5) + rows["linear"][:, 0] * step * 0.05
    rows["position"][:, 1] = 3.0 * ((rows["id"] - 1) // 2)
    rows["angular"][:, 2] = 0.3
    return rows


def test_a_recorded_session_replays_to_the_same_bytes(start, team, tmp_path):
    monitor = start("run", "--record", "run.mcap")
    team.meet()
    team.describe(*(ObjectDescription(i, Box((1, 1, 1))) for i in range(1, 21)))
    team.status(lambda s: s.objects == 20)
    for step in range(60):
        team.say(*states(step))
        team.listen(0.02)
    team.publish_states(b"\xff" * 100)  # a refused message is part of the session
    status = team.status(lambda s: s.step == 60 and s.refused_malformed == 1 and s.recorded_messages > 180)
    assert status.recording == MonitorStatus.RECORDING_ON
    assert status.recording_path == "run.mcap"
    assert status.recording_dropped == 0
    assert monitor.stop() == 0

    topics = [message.topic for message in Session(tmp_path / "run.mcap").messages()]
    assert topics.count("/object_monitor/objects/shapes") == 1
    assert topics.count("/object_monitor/objects/states") == 61
    first = topics.index("/object_monitor/objects/states")
    assert topics[first : first + 3] == [
        "/object_monitor/objects/states",
        "/object_monitor/contacts",
        "/object_monitor/predictions",
    ]
    replay = start("replay", "run.mcap")
    assert replay.wait() == 0, replay.words
    assert "identical" in replay.words
    assert Session(tmp_path / "run.mcap").timeline().snapshots == (), "it is far too short"
    assert sum(len(m.predictions) for m in team.predictions) > 100
    assert sum(len(m.contacts) for m in team.contacts) > 100


def test_a_recording_that_exists_is_not_overwritten(start, tmp_path):
    (tmp_path / "run.mcap").write_bytes(b"precious")
    monitor = start("run", "--record", "run.mcap")
    assert monitor.wait() == 1
    assert "run.mcap is there already" in monitor.words
    assert (tmp_path / "run.mcap").read_bytes() == b"precious"


@pytest.mark.parametrize("path", ["missing/run.mcap", "there.mcap"])
def test_a_recording_that_fails_does_not_stop_the_monitor(start, team, tmp_path, path):
    (tmp_path / "there.mcap").write_bytes(b"precious")
    monitor = start("run", "--ros-args", "-p", f"record:={path}")
    team.meet()
    team.describe(*(ObjectDescription(i, Box((1, 1, 1))) for i in range(1, 21)))
    team.status(lambda s: s.objects == 20)
    _, predictions = team.ask(*states(0))
    assert len(predictions.predictions) == 10
    status = team.status(lambda s: s.step == 1)
    assert status.recording == MonitorStatus.RECORDING_FAILED
    assert path in status.recording_error
    assert monitor.stop() == 0
    assert "not recording" in monitor.words
    assert (tmp_path / "there.mcap").read_bytes() == b"precious"


def test_only_what_is_around_collisions_is_recorded(start, team, tmp_path):
    options = ("--on-event", "--before", "0.3", "--after", "0.2")
    monitor = start("run", "--record", "events", *options)
    team.meet()
    team.describe(*(ObjectDescription(i, Box((1, 1, 1))) for i in range(1, 21)))
    team.status(lambda s: s.objects == 20)
    for step in (*range(10), *range(30, 60), *range(10)):  # apart, in contact from about step 40 on, apart
        team.say(*states(step))
        team.listen(0.03)
    team.listen(0.5)
    status = team.status(lambda s: s.step == 50)
    assert status.recording == MonitorStatus.RECORDING_ON
    assert monitor.stop() == 0
    (path,) = (tmp_path / "events").glob("*.mcap")
    messages = list(Session(path).messages())
    steps = [decode_contacts(m.data) for m in messages if m.type == "ContactArray"]
    begins = next(k for k, each in enumerate(steps) if len(each.contacts))
    assert 0 < begins < len(steps) - 1 < 45
    assert messages[0].type == "ObjectDescriptionArray"
    assert len(decode_descriptions(messages[0].data).objects) == 20
    replay = start("replay", "events")  # from the snapshot at its begin
    assert replay.wait() == 0, replay.words


def test_a_removed_folder_fails_the_recording_once_and_the_monitoring_goes_on(start, team, tmp_path):
    monitor = start("run", "--record", "runs")
    team.meet()
    team.describe(*(ObjectDescription(i, Box((1, 1, 1))) for i in range(1, 21)))
    team.status(lambda s: s.objects == 20 and s.recorded_messages > 0)
    shutil.rmtree(tmp_path / "runs")
    team.ask(*states(0))
    status = team.status(lambda s: s.recording == MonitorStatus.RECORDING_FAILED)
    assert status.recording_error.endswith(": the file was removed or renamed during the recording")
    for step in range(1, 4):
        _, predictions = team.ask(*states(0.1 * step))
        assert len(predictions.predictions) == 10
        team.listen(0.6)  # longer than the period of the watchdog, which logs
    assert monitor.stop() == 0
    assert monitor.words.count("the recording failed, the monitoring goes on: ") == 1
    assert "too slow" not in monitor.words
    assert not (tmp_path / "runs").exists()


def test_a_full_disk_is_reported_and_does_not_stop_the_monitor(start, team, tmp_path):
    """RLIMIT_FSIZE makes the kernel refuse to grow the file, as a full disk does."""
    monitor = start("run", "--record", "run.mcap")
    team.meet()
    team.describe(*(ObjectDescription(i, Box((1, 1, 1))) for i in range(1, 21)))
    team.status(lambda s: s.objects == 20)
    team.ask(*states(0))
    limit = 60_000
    resource.prlimit(monitor.pid, resource.RLIMIT_FSIZE, (limit, limit))
    for step in range(1, 400):
        team.say(*states(0.1 * step))
        team.listen(0.005)
        if team.statuses[-1].recording == MonitorStatus.RECORDING_FAILED:
            break
    status = team.status(lambda s: s.recording == MonitorStatus.RECORDING_FAILED)
    assert "run.mcap: File too large" in status.recording_error
    _, predictions = team.ask(*states(0.1 * step + 0.1))
    assert len(predictions.predictions) == 10
    dropped = status.recording_dropped
    status = team.status(lambda s: s.recording_dropped > dropped)
    assert monitor.running
    assert monitor.stop() == 0
    assert "the recording failed, the monitoring goes on: run.mcap: File too large" in monitor.words
    assert "too slow" not in monitor.words
    assert 0 < (tmp_path / "run.mcap").stat().st_size <= limit
    assert len(list(Session(tmp_path / "run.mcap").messages())) >= status.recorded_messages > 3
