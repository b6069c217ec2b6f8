"""A session of 28 November 2026, before shapes had `data`, is read and replayed to the bit."""

from __future__ import annotations

from pathlib import Path

import pytest

from collision_monitor.codec import decode_descriptions
from collision_monitor.codec.older_messages import lacks_data, with_data
from collision_monitor.errors import MessageError
from collision_monitor.session import Session
from collision_monitor.session.mcap.record_reader import McapReader, Message
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict

OLDER = Path(__file__).parent / "recorded_before_maps.mcap"


def raw_descriptions(path: Path) -> list[bytes]:
    """The messages of descriptions as they stand in the file."""
    names = {each.type: each.topic for each in Session(path).messages()}
    channels, found = {}, []
    for record in McapReader(path):
        if isinstance(record, Message):
            if channels.get(record.channel_id) == names["ObjectDescriptionArray"]:
                found.append(record.data)
        elif hasattr(record, "topic"):
            channels[record.id] = record.topic
    return found


def test_it_has_its_objects_and_is_replayed_to_the_bit() -> None:
    assert replay(Session(OLDER)).verdict is Verdict.IDENTICAL
    described = [each for each in Session(OLDER).messages() if each.type == "ObjectDescriptionArray"]
    objects = [decode_descriptions(each.data).objects for each in described]
    assert sorted({it.object_id for each in objects for it in each}) == [1, 2, 3, 4, 5, 6, 9]


def test_a_message_that_is_cut_or_of_today_is_refused() -> None:
    (data, *_) = raw_descriptions(OLDER)
    with pytest.raises(MessageError):
        decode_descriptions(data)
    renewed = with_data(data)
    assert not decode_descriptions(renewed).refused
    for end in range(0, len(data) - 3, 7):
        with pytest.raises(MessageError):
            with_data(data[:end])
    with pytest.raises(MessageError):
        with_data(renewed)


def test_the_definition_says_whether_a_message_lacks_it() -> None:
    assert lacks_data(b"uint32[] triangles")
    assert not lacks_data(b"uint8[] data    # packed") and not lacks_data(b"")
