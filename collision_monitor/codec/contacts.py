"""ContactArray: the contacts after one step."""

from __future__ import annotations

from dataclasses import dataclass

from collision_monitor import records
from collision_monitor.codec.cdr import Buffer, Ids, Reader, Records, Writer, write_header


@dataclass(frozen=True, eq=False)
class ContactArray:
    """A ContactArray message. contacts (n,) of records.CONTACT, a read-only view."""

    stamp_ns: int
    frame_id: str
    step: int
    contacts: Records
    ids: Ids
    names: list[str]


def decode_contacts(data: Buffer) -> ContactArray:
    """Decode a ContactArray. Raises MessageError."""
    reader = Reader(data, "ContactArray")
    result = ContactArray(
        stamp_ns=reader.stamp_ns(),
        frame_id=reader.string("header.frame_id"),
        step=reader.scalar("u8", "step"),
        contacts=reader.sequence(records.CONTACT, 8, "contacts"),
        ids=reader.sequence("<u4", 4, "ids"),
        names=reader.strings("names"),
    )
    reader.finish()
    return result


def encode_contacts(stamp_ns: int, frame_id: str, step: int, contacts: Records, ids: Ids, names: list[str]) -> bytes:
    """Encode a ContactArray. Raises MessageError."""
    writer = Writer("ContactArray")
    write_header(writer, stamp_ns, frame_id)
    writer.scalar("u8", step, "step")
    writer.sequence(contacts, records.CONTACT, 8)
    writer.sequence(ids, "<u4", 4)
    writer.strings(names, "names")
    return writer.finish()
