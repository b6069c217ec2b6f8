"""Recordings of several files: split by size and time, and made around events only."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from session_scene import CONTACTS, SHAPES, START, STATES, STEP, record

from collision_monitor.cli.main import main
from collision_monitor.codec import decode_contacts, decode_descriptions
from collision_monitor.errors import SessionError
from collision_monitor.records import Phase
from collision_monitor.session import Recorded, Recording, Session, Splitting
from collision_monitor.session.recording.event_window import EventWindow
from collision_monitor.session.recording.queue_entry import QueueEntry
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict

BY_TIME = Splitting(duration=0.26)


def files_of(folder: Path) -> list[Path]:
    """Return the files in the order of metadata.yaml, which has to name them all."""
    text = (folder / "metadata.yaml").read_text()
    names = yaml.safe_load(text)["rosbag2_bagfile_information"]["relative_file_paths"]
    assert sorted(names) == sorted(path.name for path in folder.glob("*.mcap"))
    return [folder / name for name in names]


def begins(messages: list[Recorded]) -> list[int]:
    """Return the log times of the steps in which a contact begins."""
    found = [m for m in messages if m.topic == CONTACTS]
    return [m.log_time for m in found if (decode_contacts(m.data).contacts["phase"] == Phase.BEGIN).any()]


@pytest.mark.parametrize(
    ("splitting", "count"), [(BY_TIME, 3), (Splitting(size=1), 56), (Splitting(size=10**9, duration=1e6), 1)]
)
def test_all_files_together_are_the_one_file(recorded: Path, tmp_path: Path, splitting: Splitting, count: int) -> None:
    recorder = record(tmp_path / "run", splitting=splitting)
    files = files_of(tmp_path / "run")
    assert len(files) == count
    session = Session(tmp_path / "run")
    assert list(session.messages()) == list(Session(recorded).messages())
    assert session.damage == []
    assert session.position == session.size == recorder.status()["recorded_bytes"]
    report = replay(Session(tmp_path / "run"))
    assert (report.verdict, report.notes) == (Verdict.IDENTICAL, [])
    assert report.digest == replay(Session(recorded)).digest
    assert main(["replay", str(tmp_path / "run")]) == 0


def test_each_file_stands_alone_with_settings_and_objects(recorded: Path, tmp_path: Path) -> None:
    record(tmp_path / "run", splitting=BY_TIME)
    whole = Session(recorded)
    for k, path in enumerate(files_of(tmp_path / "run")):
        session = Session(path)
        assert (session.profile, session.frame_id) == (whole.profile, whole.frame_id)
        assert session.metadata["determinism_key"] == whole.metadata["determinism_key"]
        report = replay(session)
        if k == 0:
            assert report.verdict is Verdict.IDENTICAL
            continue
        assert (report.verdict, report.late, report.compared) == (Verdict.NOT_COMPARABLE, True, 0)
        assert "messages after its recording" in report.notes[0]
        assert report.digest != 0, "the replay finds contacts among the file's objects"
        first, *others = session.messages()
        ids = [each.object_id for each in decode_descriptions(first.data).objects]
        # the earlier descriptions: body 3 disappears at step 20 and returns at step 30
        assert ids == ([1, 2, 4, 5, 6, 9] if k == 1 else [1, 2, 4, 5, 6, 9, 3])
        assert decode_descriptions(first.data).snapshot
        assert others[0].sequence == first.sequence + 1
        assert others[0].topic in (STATES, SHAPES), "answers stay in the file of their inputs"


def test_rosbags_reads_the_folder(recorded: Path, tmp_path: Path) -> None:
    from rosbags.rosbag2 import Reader

    for name, splitting in {"run": BY_TIME, "events": Splitting(on_event=True, before=0.02, after=0.02)}.items():
        record(tmp_path / name, splitting=splitting)
        count = sum(len(list(Session(path).messages())) for path in files_of(tmp_path / name))
        with Reader(tmp_path / name) as reader:
            assert len(list(reader.messages())) == reader.message_count == count > 0


def test_a_missing_file_and_two_recordings_in_one_folder_are_reported(tmp_path: Path) -> None:
    record(tmp_path / "run", splitting=BY_TIME)
    record(tmp_path / "other", splitting=BY_TIME)
    last = tmp_path / "run" / "run_2.mcap"
    shutil.move(last, tmp_path / "away.mcap")
    session = Session(tmp_path / "run")
    report = replay(session)
    assert report.first_difference is None
    assert session.damage == ["run_2.mcap is not there"] == report.notes
    shutil.copy(tmp_path / "other" / "other_1.mcap", tmp_path / "run")
    with pytest.raises(SessionError, match="expected the files of one recording, got those of several; name one of"):
        Session(tmp_path / "run")
    (tmp_path / "run" / "other_1.mcap").unlink()
    shutil.move(tmp_path / "away.mcap", last)
    (tmp_path / "run" / "run_1.mcap").unlink()
    report = replay(Session(tmp_path / "run"))
    assert report.verdict is Verdict.NOT_COMPARABLE
    assert "messages are missing after step" in report.notes[0]


def test_only_what_is_around_collisions_is_kept(recorded: Path, tmp_path: Path) -> None:
    whole = list(Session(recorded).messages())
    events = begins(whole)
    before = after = STEP
    recorder = record(tmp_path / "run", splitting=Splitting(on_event=True, before=before / 1e9, after=after / 1e9))
    files = files_of(tmp_path / "run")
    assert 2 <= len(files) <= len(events)
    kept = [m for path in files for m in Session(path).messages() if m in whole]  # without the repeated objects
    near = [m for m in whole if any(t - before <= m.log_time <= t + after for t in events)]
    assert kept == near
    assert len(near) < len(whole)
    status = recorder.status()
    assert (status["recording"], status["recorded_messages"]) == (Recording.ON, len(near))
    assert status["recording_dropped"] == 0
    for path in files:
        report = replay(Session(path))
        assert (report.verdict, report.late) == (Verdict.NOT_COMPARABLE, True)
        assert report.steps == sum(m.topic == CONTACTS for m in Session(path).messages())
        assert main(["replay", str(path)]) == 4
    session = Session(tmp_path / "run")
    assert replay(session).verdict is Verdict.NOT_COMPARABLE
    # one file after the other, each with the objects at its begin
    assert sum(m.topic == SHAPES for m in session.messages()) >= len(files)


def test_a_window_from_the_very_start_replays_exactly(recorded: Path, tmp_path: Path) -> None:
    record(tmp_path / "run", splitting=Splitting(on_event=True, before=100, after=100))
    assert list(Session(tmp_path / "run").messages()) == list(Session(recorded).messages())
    assert replay(Session(tmp_path / "run")).verdict is Verdict.IDENTICAL


def test_without_a_collision_there_is_no_file(tmp_path: Path) -> None:
    record(tmp_path / "run", steps=0, splitting=Splitting(on_event=True, before=0.01, after=0.01))
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["metadata.yaml"]
    with pytest.raises(SessionError, match=r"expected a folder with .mcap files, got none in it"):
        Session(tmp_path / "run")


@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=40), st.integers(0, 8), st.integers(0, 8))
def test_the_window_keeps_what_is_near_an_event_and_nothing_else(
    gaps: list[tuple[int, bool]], before: int, after: int
) -> None:
    window = EventWindow(before * 1e-9, after * 1e-9, 1 << 30)
    time, entries = START, []
    for k, (gap, event) in enumerate(gaps):
        time += gap
        entries.append(QueueEntry("/x", b"", time, 0, k, event and k % 4 == 0))
    decided = [each for entry in entries for each in window.take(entry)]
    assert [entry for entry, _ in decided] == entries[: len(decided)]
    events = [(k, e.log_time) for k, e in enumerate(entries) if e.event]
    for entry, kept in decided:
        near = any(
            t - before <= entry.log_time and (entry.sequence <= k or entry.log_time <= t + after) for k, t in events
        ) and any(t - before <= entry.log_time <= t + after for _, t in events)
        assert kept == near
    for entry in entries[len(decided) :]:
        assert not any(t - before <= entry.log_time <= t + after for _, t in events)


def test_the_oldest_that_is_held_back_goes_where_there_is_too_much() -> None:
    window = EventWindow(1e6, 1.0, 10 * QueueEntry("", bytes(100), 0, 0, 0).cost)
    decided = [each for k in range(30) for each in window.take(QueueEntry("", bytes(100), k, 0, k))]
    assert [(entry.sequence, kept) for entry, kept in decided] == [(k, False) for k in range(20)]
    rest = list(window.take(QueueEntry("", b"", 30, 0, 30, event=True)))
    assert [(entry.sequence, kept) for entry, kept in rest] == [(k, True) for k in range(20, 31)]


def test_settings_that_cannot_be_are_named(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="duration: expected a finite number, at least 0, got -1"):
        Splitting(duration=-1)
    with pytest.raises(SessionError, match=r"expected a folder, a name without \.mcap"):
        record(tmp_path / "a.mcap", splitting=BY_TIME)
    assert not list(tmp_path.iterdir())


def test_files_of_an_older_recording_do_not_stay(recorded: Path, tmp_path: Path) -> None:
    record(tmp_path / "run", splitting=Splitting(size=1))
    record(tmp_path / "run", splitting=BY_TIME, overwrite=True)
    assert len(files_of(tmp_path / "run")) == 3
    assert list(Session(tmp_path / "run").messages()) == list(Session(recorded).messages())
