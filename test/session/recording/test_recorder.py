"""The recorder: the files that it writes, and that no failure reaches the caller."""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader

from collision_monitor.errors import SessionError
from collision_monitor.session import Recorder, Recording, Session

TYPES = {"/m/contacts": "ContactArray", "/m/status": "MonitorStatus"}
METADATA = {"profile": "{}", "frame_id": "world"}
DATA = b"\x00\x01\x00\x00" + os.urandom(2000)  # does not compress


def test_messages_come_back_in_the_order_of_writing(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, TYPES, METADATA) as recorder:
        times = [100, 90, 110, 110, 105]  # the clock jumps back
        for k, log_time in enumerate(times):
            recorder.write(list(TYPES)[k % 2], DATA + bytes([k]), log_time, log_time - 1000)
    messages = list(Session(path).messages())
    assert [m.data[-1] for m in messages] == [0, 1, 2, 3, 4]
    assert [m.log_time for m in messages] == [100, 100, 110, 110, 110]
    assert [m.publish_time for m in messages] == [0, 0, 0, 0, 0]
    assert [m.sequence for m in messages] == [0, 1, 2, 3, 4]
    assert [m.topic for m in messages[:2]] == list(TYPES)
    assert [m.type for m in messages[:2]] == list(TYPES.values())
    assert recorder.status() == {
        "recording": Recording.ON,
        "recorded_messages": 5,
        "recorded_bytes": path.stat().st_size,
        "recording_dropped": 0,
        "recording_path": str(path),
        "recording_error": "",
    }


def test_the_file_keeps_rosbag2s_conventions(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, TYPES, METADATA) as recorder:
        recorder.write("/m/contacts", DATA, 1_000, 2_000)
        recorder.write("/m/contacts", DATA, 5_000, 2_000)
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert reader.get_header().library.startswith("collision_monitor ")
        summary = reader.get_summary()
        assert summary is not None
        assert {c.topic: c.message_encoding for c in summary.channels.values()} == dict.fromkeys(TYPES, "cdr")
        assert {s.encoding for s in summary.schemas.values()} == {"ros2msg"}
        assert {s.name for s in summary.schemas.values()} == {f"collision_monitor_msgs/msg/{n}" for n in TYPES.values()}
        for channel in summary.channels.values():
            (qos,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert qos["reliability"] == "reliable"
            assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
    assert metadata["collision_monitor"] == METADATA
    bag = yaml.safe_load(metadata["rosbag2"]["serialized_metadata"])["rosbag2_bagfile_information"]
    assert (bag["storage_identifier"], bag["message_count"], bag["relative_file_paths"]) == ("mcap", 2, ["a.mcap"])
    assert bag["starting_time"]["nanoseconds_since_epoch"] == 1_000
    assert bag["duration"]["nanoseconds"] == 4_000
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in bag["topics_with_message_count"]}
    assert counts == {"/m/contacts": 2, "/m/status": 0}


def test_a_path_without_suffix_is_a_folder_as_ros2_bag_makes_it(tmp_path: Path) -> None:
    path = tmp_path / "run"
    with Recorder(path, TYPES, METADATA) as recorder:
        recorder.write("/m/status", DATA, 1, 1)
    assert sorted(p.name for p in path.iterdir()) == ["metadata.yaml", "run_0.mcap"]
    assert yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]["message_count"] == 1


def test_the_metadata_is_on_disk_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, TYPES, {**METADATA, "profile": "{}"})
    assert Session(path).metadata["frame_id"] == "world"
    recorder.close()


def test_what_cannot_be_opened_is_said_before_anything_starts(tmp_path: Path) -> None:
    there = tmp_path / "there.mcap"
    there.write_bytes(b"precious")
    with pytest.raises(SessionError, match="expected a new file, got one that exists"):
        Recorder(there, TYPES, METADATA)
    with pytest.raises(SessionError, match="expected a new file"):
        Recorder(tmp_path, TYPES, METADATA)
    assert there.read_bytes() == b"precious"
    with pytest.raises(SessionError, match="expected an existing folder"):
        Recorder(tmp_path / "nowhere" / "a.mcap", TYPES, METADATA)
    with pytest.raises(SessionError, match="got: Not a directory"):
        Recorder(there / "a.mcap", TYPES, METADATA)
    with pytest.raises(SessionError, match="message type: expected one of"):
        Recorder(tmp_path / "b.mcap", {"/x": "Strange"}, METADATA)
    Recorder(there, TYPES, METADATA, overwrite=True).close()
    assert _messages_of(there) == []


def _messages_of(path: Path) -> list[object]:
    with path.open("rb") as file:
        return list(make_reader(file).iter_messages())


def test_a_full_queue_drops_and_counts_and_leaves_a_gap_in_the_sequence(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, TYPES, {**METADATA, "profile": "{}"}, queue_bytes=10_000)
    for k in range(100):
        recorder.write("/m/status", DATA, k, k)
    assert recorder.status()["recording_dropped"] > 80
    time.sleep(0.6)
    recorder.write("/m/status", DATA, 200, 200)
    recorder.close()
    sequences = [m.sequence for m in Session(path).messages()]
    assert sequences[-1] == 100
    assert len(sequences) == 101 - int(recorder.status()["recording_dropped"])


def test_writing_after_the_end_is_counted(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", TYPES, METADATA)
    recorder.close()
    recorder.write("/m/status", DATA, 1, 1)
    recorder.close()
    assert recorder.status()["recording_dropped"] == 1


FULL_DISK = """
import resource, signal, sys, time
resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
import os
from collision_monitor.session import Recorder
recorder = Recorder(sys.argv[1], {"/m/status": "MonitorStatus"}, {"profile": "{}"})
end = time.monotonic() + 20
while recorder.status()["recording"] == 1 and time.monotonic() < end:
    for _ in range(50):
        recorder.write("/m/status", os.urandom(1000), 1, 1)
    time.sleep(0.05)
recorder.write("/m/status", b"", 1, 1)
dropped = recorder.status()["recording_dropped"]
recorder.write("/m/status", b"", 1, 1)
recorder.close()
status = recorder.status()
assert status["recording_dropped"] == dropped + 1, status
print(status["recording"], status["recorded_messages"], status["recording_dropped"], status["recording_error"])
"""


def test_a_full_disk_fails_the_recording_and_not_the_caller(tmp_path: Path) -> None:
    """RLIMIT_FSIZE makes the kernel refuse to grow the file, as a full disk does."""
    path = tmp_path / "a.mcap"
    run = subprocess.run([sys.executable, "-c", FULL_DISK, path], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    state, recorded, dropped, error = run.stdout.strip().split(" ", 3)
    assert int(state) == Recording.FAILED
    assert error == f"{path}: File too large"
    session = Session(path)
    assert len(list(session.messages())) >= int(recorded) > 0
    assert "cut off" in session.damage[0]
    assert int(dropped) > 0


@pytest.mark.parametrize("name", ["a.mcap", "run"])
@pytest.mark.parametrize("overwrite", [False, True])
def test_a_recording_whose_beginning_does_not_fit_on_the_disk_leaves_nothing(
    tmp_path: Path, name: str, overwrite: bool
) -> None:
    other = tmp_path / "other.txt"
    other.touch()
    if overwrite:
        Recorder(tmp_path / name, TYPES, METADATA).close()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, hard))
    try:
        with pytest.raises(SessionError, match="expected to be able to write there, got: File too large"):
            Recorder(tmp_path / name, TYPES, METADATA, overwrite=overwrite)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [path for path in tmp_path.rglob("*") if not path.is_dir()] == [other]
    assert overwrite or list(tmp_path.iterdir()) == [other]


def test_a_recording_that_cannot_begin_removes_no_file_that_it_did_not_write(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "notes.txt").touch()
    (folder / "run_0.mcap").mkdir()  # so that the first file cannot be made
    with pytest.raises(SessionError, match="expected to be able to write there"):
        Recorder(folder, TYPES, METADATA, overwrite=True)
    assert sorted(path.name for path in folder.iterdir()) == ["notes.txt", "run_0.mcap"]


@pytest.mark.parametrize("name", ["a.mcap", "split"])
def test_a_removed_recording_fails_once_and_not_the_caller(tmp_path: Path, name: str) -> None:
    """The system keeps on taking what is written to a removed file, so no write fails."""
    folder = tmp_path / "runs"
    folder.mkdir()
    with Recorder(folder / name, TYPES, METADATA) as recorder:
        recorder.write("/m/status", DATA, 1, 1)
        _until(lambda: recorder.status()["recorded_messages"] == 1)
        assert recorder.status()["recording"] == Recording.ON
        shutil.rmtree(folder)
        recorder.write("/m/status", DATA, 2, 2)
        _until(lambda: recorder.status()["recording"] == Recording.FAILED)
        error = f"{folder / name}: the file was removed or renamed during the recording"
        assert recorder.status()["recording_error"] == error
        recorder.write("/m/status", DATA, 3, 3)
    status = recorder.status()
    assert (status["recorded_messages"], status["recording_dropped"], status["recording_error"]) == (1, 2, error)
    assert not folder.exists()


def _until(condition: Callable[[], bool], timeout: float = 10.0) -> None:
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


KILLED = """
import sys, time
from collision_monitor.session import Recorder
recorder = Recorder(sys.argv[1], {"/m/status": "MonitorStatus"}, {"profile": "{}"})
k = 0
while True:
    recorder.write("/m/status", k.to_bytes(8, "little") + bytes(100), time.time_ns(), 1)
    if k % 20 == 0:
        print(k, time.time_ns(), flush=True)
    k += 1
    time.sleep(0.001)
"""


def test_a_killed_process_loses_at_most_half_a_second(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    process = subprocess.Popen([sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if int(line.split()[0]) >= 1500:
            break
    process.send_signal(signal.SIGKILL)
    killed_at = int(line.split()[1])
    assert process.wait() == -signal.SIGKILL
    session = Session(path)
    messages = list(session.messages())
    assert [int.from_bytes(m.data[:8], "little") for m in messages] == list(range(len(messages)))
    assert killed_at - messages[-1].log_time < 0.5e9
    assert session.damage == ["the recording was not closed: it ends without a summary"]


def test_forty_thousand_messages_at_once_are_all_recorded(tmp_path: Path) -> None:
    count, data = 40_000, bytes(1_000)
    recorder = Recorder(tmp_path / "a.mcap", TYPES, METADATA)
    for k in range(count):
        recorder.write("/m/status", data, k, k)
    recorder.close()
    status = recorder.status()
    assert (status["recorded_messages"], status["recording_dropped"]) == (count, 0)
