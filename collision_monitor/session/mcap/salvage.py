"""Recovers the whole records of an MCAP file that was cut off, overwritten or has flipped bits, and reports the losses.

Nothing that cannot be checked is trusted: a chunk counts if its checksum is right. If the end of the file cuts a chunk,
all of its complete messages count, because its remaining bytes are as they were written.
"""

from __future__ import annotations

import mmap
import os
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import Writer

from collision_monitor._version import VERSION
from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.damaged import Damage, RecoveredRecord, Section, Trust, walk
from collision_monitor.session.mcap.definitions_in_force import DefinitionsInForce
from collision_monitor.session.mcap.layout import LIBRARY, MESSAGE, SALVAGE, SEQUENCE_HALF
from collision_monitor.session.mcap.sentences import add_sentence
from collision_monitor.session.output_file import check_output
from collision_monitor.settings.regular_file import FOLDER, found_instead, open_regular

_DECODERS: Final[dict[int, Any]] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
    Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
}


@dataclass
class Salvaged:
    """Result of a salvage.

    losses: one sentence for each, in the order of the file; empty: nothing is lost. notes: the same for damage that
    cost nothing. unverified: number of messages without a right checksum that would show them unchanged.
    """

    messages: int = 0
    unverified: int = 0
    topics: dict[str, int] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def salvage(source: str | Path, target: str | Path, *, unverified: bool = False, overwrite: bool = False) -> Salvaged:
    """Copy every complete message of `source` into the new file `target`, with its topic, type, times and sequence.

    unverified: also copy messages of chunks with a wrong checksum, which may hold wrong bytes. Raises SessionError if
    nothing can be recovered, or if `target` exists and `overwrite` is false.
    """
    source, target = Path(source), Path(target)
    if found := found_instead(source):
        raise SessionError(
            f"{source}: expected an MCAP file, got {found}{': name one of its files' if found == FOLDER else ''}"
        )
    if target.exists() and not (target.is_file() or target.is_dir()):  # it would be replaced by a file
        raise SessionError(f"{target}: expected a file that can be written, got {found_instead(target)}")
    check_output(target, overwrite=overwrite, inputs=[source])
    try:
        with open_regular(source, "an MCAP file", refused=SessionError) as file:
            if os.fstat(file.fileno()).st_size == 0:
                raise SessionError(f"{source}: expected an MCAP file, but the file is empty")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _write(data, source, target, unverified)
    except OSError as error:
        raise SessionError(f"{error.filename or target}: expected to read and write, got: {error.strerror}") from None


def _write(data: mmap.mmap, source: Path, target: Path, unverified: bool) -> Salvaged:
    """Write into a file beside the target, and put it in the target's place when it is finished."""
    contents = _Contents(data)
    unfinished = target.with_name(f"{target.name}.{os.getpid()}.part")
    stream = unfinished.open("xb")  # a file of that name, even the damaged one, stays as it is
    try:
        with stream:
            copy = _Copy(contents, Writer(stream), unverified)
            result = copy.run(data)
            if not result.messages:
                found = "; ".join(result.losses[:2]) or "no damage"
                raise SessionError(f"{source}: expected messages of an MCAP file, found none that is whole; {found}")
            copy.finish(source.name)
        os.replace(unfinished, target)
    finally:
        unfinished.unlink(missing_ok=True)
    return result


def _read(record: RecoveredRecord) -> Any:
    """Return the decoded record, or None if the bytes are not one."""
    try:
        return _DECODERS[record.opcode].read(ReadDataStream(BytesIO(record.payload)))
    except Exception:  # the library raises many kinds of errors for wrong bytes
        return None


class _Contents:
    """Header, schemas and channels from anywhere in the file, and the contents of its summary."""

    def __init__(self, data: mmap.mmap) -> None:
        self.profile = "ros2"
        self.chunked = False
        self.library = ""
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.statistics: Statistics | None = None
        self.names: list[str] = []  # of metadata and attachments in the summary
        trust: dict[tuple[int, int], Trust] = {}  # by opcode and id: the most trusted copy counts
        in_force = DefinitionsInForce()
        for each in walk(data):
            if isinstance(each, Damage) or each.opcode not in _DECODERS or each.opcode == Opcode.MESSAGE_INDEX:
                continue
            self.chunked |= each.section is Section.CHUNK
            match _read(each):
                case Header() as header:
                    self.profile = header.profile
                    self.library = header.library
                case (Schema() | Channel()) as record if each.trust > trust.get((each.opcode, record.id), -1):
                    try:
                        in_force.add(each.opcode, record.id, len(each.payload))
                    except ValueError:
                        continue
                    if isinstance(record, Schema) and record.name and record.id:
                        self.schemas[record.id] = record
                    elif isinstance(record, Channel) and record.topic and record.message_encoding:
                        self.channels[record.id] = record
                    else:
                        continue
                    trust[each.opcode, record.id] = each.trust
                case Statistics() as statistics if each.section is Section.SUMMARY:
                    self.statistics = statistics
                case (MetadataIndex() | AttachmentIndex()) as index if each.section is Section.SUMMARY:
                    self.names.append(index.name)


class _Copy:
    """The new file, and the account of the losses."""

    def __init__(self, contents: _Contents, writer: Writer, unverified: bool) -> None:
        self._contents = contents
        self._writer = writer
        self._unverified = unverified
        self._result = Salvaged()
        self._counts: Counter[int] = Counter()  # of messages, by channel
        self._names: list[str] = []  # of metadata and attachments
        self._nameless = 0
        self._begin: int | None = None
        self._last: tuple[int, int] | None = None  # sequence and log time of the last message that was kept
        self._indexed: Counter[int] = Counter()  # messages of a damaged chunk by its indexes, by channel
        self._kept: Counter[int] = Counter()  # messages kept of it, by channel
        self._damaged = False
        self._stray = 0  # messages found among the damage
        self._doubt: list[tuple[int, int]] = []  # the first and the last of a run of messages without a checksum
        writer.start(profile=contents.profile, library=contents.library or f"{LIBRARY} {VERSION} salvage")
        ids = {
            i: writer.register_schema(s.name, s.encoding, s.data) if s else 0
            for i, s in sorted(contents.schemas.items())
        }
        self._ids = {
            i: writer.register_channel(c.topic, c.message_encoding, ids.get(c.schema_id, 0), c.metadata)
            for i, c in sorted(contents.channels.items())
        }

    def run(self, data: mmap.mmap) -> Salvaged:
        """Copy everything, determine the losses and return the result."""
        for each in walk(data):
            if isinstance(each, Damage):
                self._settle_chunk()
                self._damaged = True
                self._lose(each.text)
            elif each.opcode == Opcode.MESSAGE:
                self._message(each)
            elif each.opcode == Opcode.MESSAGE_INDEX:
                if self._damaged and (index := _read(each)) is not None:
                    self._indexed[index.channel_id] += len(index.records)
            elif each.opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
                self._by_name(_read(each))
        self._settle_chunk()
        self._settle()
        return self._result

    def finish(self, source: str) -> None:
        """Write the losses into the file for its readers, and close it."""
        if self._result.losses:
            self._writer.add_metadata(SALVAGE, {"source": source, "losses": "\n".join(self._result.losses)})
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _by_name(self, record: Metadata | Attachment | None) -> None:
        if isinstance(record, Metadata):
            self._writer.add_metadata(record.name, record.metadata)
        elif record is not None:
            self._writer.flush()  # type: ignore[no-untyped-call]  # keeps it behind the messages before it
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        if record is not None:
            self._names.append(record.name)

    def _message(self, each: RecoveredRecord) -> None:
        # outside of chunks, amid the damage of a file with chunks: the rest of a damaged chunk
        stray = each.section is Section.DATA and self._damaged and self._contents.chunked
        self._stray += stray
        if (stray or each.trust is Trust.NONE) and not self._unverified:
            return
        channel, sequence, log_time, publish_time = MESSAGE.unpack_from(each.payload)
        if each.trust is Trust.CHECKED:
            self._settle_chunk()
        if channel not in self._ids:
            self._nameless += 1
            return
        self._begin = log_time if self._begin is None else self._begin
        self._note_gap(sequence, log_time)
        self._writer.add_message(self._ids[channel], log_time, each.payload[MESSAGE.size :], publish_time, sequence)
        topic = self._contents.channels[channel].topic
        self._result.messages += 1
        self._result.topics[topic] = self._result.topics.get(topic, 0) + 1
        self._counts[channel] += 1
        self._kept[channel] += self._damaged
        self._last = sequence, log_time
        if each.trust is Trust.CHECKED:
            self._settle_doubt()
        else:
            self._result.unverified += 1
            self._doubt = [*self._doubt[:1], self._last]

    # -- the account

    def _lose(self, text: str) -> None:
        add_sentence(self._result.losses, text)

    def _seconds(self, log_time: int) -> str:
        return f"{(log_time - (self._begin or 0)) * 1e-9:.3f} s"

    def _note_gap(self, sequence: int, log_time: int) -> None:
        """Note the messages missing between the last message and this one. A session numbers all of its messages."""
        if self._last is None and not self._result.losses:
            return  # a later file of a split recording
        first = 0 if self._last is None else self._last[0] + 1
        if self._contents.library.startswith(LIBRARY) and 0 < sequence - first < SEQUENCE_HALF:
            since = "the beginning" if self._last is None else self._seconds(self._last[1])
            self._lose(f"messages {first} to {sequence - 1}, from {since} to {self._seconds(log_time)}, are not there")

    def _settle_chunk(self) -> None:
        """Note the losses of a damaged chunk, by the indexes behind it."""
        if self._stray:
            self._lose(f"{self._stray} messages in it are complete and cannot be trusted")
        missing = self._indexed - self._kept
        if missing:
            parts = ", ".join(f"{count} of {self._topic(i)}" for i, count in sorted(missing.items()))
            self._lose(f"in it were, by the index behind it, {parts}")
        self._indexed.clear()
        self._kept.clear()
        self._stray = 0
        self._damaged = False

    def _settle_doubt(self) -> None:
        if self._doubt:
            (first, begin), (last, end) = self._doubt[0], self._doubt[-1]
            add_sentence(
                self._result.notes,
                f"messages {first} to {last}, from {self._seconds(begin)} to {self._seconds(end)}, are complete and "
                "have no checksum that is right",
            )
        self._doubt = []

    def _settle(self) -> None:
        """Compare the result with the file's summary, which may also show that damage cost nothing."""
        self._settle_doubt()
        result, statistics = self._result, self._contents.statistics
        lost = []
        if self._nameless:
            lost.append(f"{self._nameless} messages whose topic is not known any more")
        if statistics is not None:
            for i, count in sorted(statistics.channel_message_counts.items()):
                missing = count - self._counts[i]
                if missing > 0:
                    lost.append(f"{missing} of the {count} messages of {self._topic(i)}, as the summary has them")
        for name, count in sorted((Counter(self._contents.names) - Counter(self._names)).items()):
            lost.append(f"{count} of the metadata or attachments named {name!r}, as the summary has them")
        if statistics is not None and not lost and self._all_there(statistics):
            result.notes = [*result.losses, *result.notes]
            result.losses = []
        result.losses += lost

    def _all_there(self, statistics: Statistics) -> bool:
        expected = statistics.message_count, statistics.metadata_count + statistics.attachment_count
        return not self._result.unverified and (self._result.messages, len(self._names)) == expected

    def _topic(self, channel: int) -> str:
        return self._contents.channels[channel].topic if channel in self._contents.channels else f"channel {channel}"
