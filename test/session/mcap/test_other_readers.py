"""Other readers of a session: rosbags and mcap_ros2 decode every message."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import NonSeekingReader
from mcap_ros2.decoder import DecoderFactory
from session_scene import CONTACTS, STATES, TYPES

from collision_monitor.codec import decode_contacts
from collision_monitor.session import Recorder, Session


def whole(recorded: Path, target: Path) -> Path:
    """Write the session without its deliberately broken messages, for which other readers raise."""
    session = Session(recorded)
    with Recorder(target, TYPES, session.metadata) as recorder:
        for message in session.messages():
            if message.topic != STATES or len(message.data) > 100:
                recorder.write(message.topic, message.data, message.log_time, message.publish_time)
    return target


def test_mcap_ros2_decodes_every_message(recorded: Path, tmp_path: Path) -> None:
    from mcap.reader import make_reader

    path = whole(recorded, tmp_path / "a.mcap")
    count = len(list(Session(path).messages()))
    ours = iter([decode_contacts(m.data) for m in Session(path).messages() if m.topic == CONTACTS])
    with path.open("rb") as file:
        decoded = list(make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    assert len(decoded) == count
    for _, channel, _, message in decoded:
        if channel.topic == CONTACTS:
            expected = next(ours)
            distances = [c.signed_distance for c in message.contacts]
            np.testing.assert_array_equal(distances, expected.contacts["signed_distance"])
            assert list(message.names) == expected.names


def test_mcaps_streaming_reader_decodes_every_message(recorded: Path, tmp_path: Path) -> None:
    """A pipe allows neither seeking nor the use of the index."""
    path = whole(recorded, tmp_path / "a.mcap")
    with subprocess.Popen(["cat", path], stdout=subprocess.PIPE) as cat:
        assert cat.stdout is not None
        reader = NonSeekingReader(cat.stdout, validate_crcs=True, decoder_factories=[DecoderFactory()])
        decoded = [message.channel.topic for message in reader.iter_decoded_messages(log_time_order=False)]
    assert decoded == [m.topic for m in Session(path).messages()]


@pytest.mark.parametrize("name", ["a.mcap", "folder"])
def test_rosbags_decodes_every_message(recorded: Path, tmp_path: Path, name: str) -> None:
    from rosbags.highlevel import AnyReader

    path = whole(recorded, tmp_path / name)
    count = len(list(Session(path).messages()))
    ours = iter([decode_contacts(m.data) for m in Session(path).messages() if m.topic == CONTACTS])
    seen = 0
    with AnyReader([path]) as reader:
        assert {c.topic for c in reader.connections} == set(TYPES)
        if path.is_dir():  # rosbags does not read the hashes of a single file
            assert all(c.digest.startswith("RIHS01_") for c in reader.connections)
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            seen += 1
            if connection.topic == CONTACTS:
                expected = next(ours)
                distances = [c.signed_distance for c in message.contacts]
                np.testing.assert_array_equal(distances, expected.contacts["signed_distance"])
    assert seen == count
