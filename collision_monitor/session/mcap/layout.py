"""The layout of an MCAP file: magic bytes, records and their fields; and the names of a session's own records.

Source: the MCAP specification, version 0 (mcap.dev/spec). All numbers are little-endian. A uint32 or uint64 length
precedes each text, map, list and block of data.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
from mcap.opcode import Opcode

MAGIC: Final = b"\x89MCAP0\r\n"
"""The first and the last bytes of a file."""

SEQUENCE_MASK: Final = 0xFFFFFFFF
"""The sequence numbers of messages are uint32 and wrap."""

SEQUENCE_HALF: Final = 1 << 31
"""A sequence number that seems farther ahead than this lies behind."""

# -- fixed fields

_HEAD_FIELDS: Final = (("opcode", "<u1"), ("length", "<u8"))
_MESSAGE_FIELDS: Final = (("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<u8"), ("publish_time", "<u8"))

MESSAGE_HEAD: Final = np.dtype([*_HEAD_FIELDS, *_MESSAGE_FIELDS])
"""The record of a message up to its data."""


def _struct(fields: tuple[tuple[str, str], ...]) -> struct.Struct:
    codes = {"<u1": "B", "<u2": "H", "<u4": "I", "<u8": "Q"}
    return struct.Struct("<" + "".join(codes[kind] for _, kind in fields))


HEAD: Final = _struct(_HEAD_FIELDS)
"""Head of every record: opcode, length of the content that follows."""

MESSAGE: Final = _struct(_MESSAGE_FIELDS)
"""Fields of a message before its data: channel, sequence, log time, publish time."""

LOG_TIME: Final = MESSAGE_HEAD.fields["log_time"][1] - HEAD.size  # type: ignore[index]
"""Offset of the log time in a message, and of the first log time in a message index."""

TIMES: Final = struct.Struct("<QQ")
"""First and last log time of a chunk, or log time and creation time of an attachment (ns)."""

CHUNK_HEAD: Final = struct.Struct("<QQQI")
"""The two times, unpacked size, checksum. The name of the compression and the packed records follow."""

SPAN: Final = struct.Struct("<QQ")
"""Offset and length of a record in the file."""

STATISTICS: Final = struct.Struct("<QHIIIIQQ")
"""Numbers of messages, schemas, channels, attachments, metadata records and chunks; first and last log time."""

SUMMARY_OFFSET: Final = struct.Struct("<BQQ")
"""Opcode of a group of records, its offset and length."""

FOOTER: Final = struct.Struct("<QQI")
"""Offsets of the summary and of the summary's offsets, checksum."""

# -- all fields

FIELDS: Final[dict[int, tuple[int, ...]]] = {
    Opcode.HEADER: (-4, -4),
    Opcode.FOOTER: (FOOTER.size,),
    Opcode.SCHEMA: (2, -4, -4, -4),
    Opcode.CHANNEL: (4, -4, -4, -4),
    Opcode.CHUNK: (CHUNK_HEAD.size, -4, -8),
    Opcode.MESSAGE_INDEX: (2, -4),
    Opcode.CHUNK_INDEX: (TIMES.size + SPAN.size, -4, 8, -4, 16),
    Opcode.ATTACHMENT: (TIMES.size, -4, -4, -8, 4),
    Opcode.ATTACHMENT_INDEX: (SPAN.size + TIMES.size + 8, -4, -4),
    Opcode.STATISTICS: (STATISTICS.size, -4),
    Opcode.METADATA: (-4, -4),
    Opcode.METADATA_INDEX: (SPAN.size, -4),
    Opcode.SUMMARY_OFFSET: (SUMMARY_OFFSET.size,),
    Opcode.DATA_END: (4,),
}
"""Bytes of each field; -n: an n-byte length, then as many bytes. Only a message does not show its own length."""

OPCODES: Final = frozenset({*FIELDS, Opcode.MESSAGE})

# -- a session's own records

LIBRARY: Final = "collision_monitor"
"""The first word of the library in the header of every file that this package writes."""

METADATA: Final = "collision_monitor"
"""Name of the metadata record that makes an MCAP file a session."""

RECORDING, NUMBER, REPEATED = "recording", "file", "repeated"
"""Keys of that record: an id that the files of one recording share, the file's index among them from 0, and how many of
its first messages only repeat the descriptions in force at its begin."""

SNAPSHOT: Final = "snapshot_before_"
"""Prefix of the names of attachments with snapshots. The number of the message that follows comes next."""

SALVAGE: Final = "collision_monitor_salvage"
"""Name of the metadata record that lists what is missing in a salvaged file."""
