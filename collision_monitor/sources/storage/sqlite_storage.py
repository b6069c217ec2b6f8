"""A bag in an SQLite file, as rosbag2 writes it: a table of topics and a table of messages."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from collision_monitor.errors import SessionError
from collision_monitor.settings.regular_file import open_regular
from collision_monitor.sources.storage.stored_channel import LATEST, StoredChannel, StoredMessage, damaged_bag
from collision_monitor.sources.storage.time_order import Runs

SQLITE_MAGIC: Final = b"SQLite format 3\0"

MOST_TOPICS: Final = 10_000

_NO_TABLE: Final = re.compile(r"(?i)\bas\b|\bvirtual\b|\bview\b|\btrigger\b")
"""What no table of rosbag2 is made with: they are views, or have columns that are computed."""

_READABLE: Final = f"typeof(timestamp) = 'integer' AND timestamp BETWEEN 0 AND {LATEST} AND typeof(data) = 'blob'"


class SqliteStorage:
    """An SQLite file. Raises SessionError if it is damaged or no bag."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with open_regular(path, "a bag", refused=SessionError):
            pass
        try:
            self._base = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        except sqlite3.Error as error:
            raise self._damaged(error) from None
        self._base.text_factory = lambda text: text.decode("utf-8", "replace")
        try:
            self._base.execute("PRAGMA trusted_schema = OFF")
            self._check_tables()
            self.channels = self._read_channels()
            self._runs = self._read_runs()
        except (sqlite3.Error, TypeError, ValueError, OverflowError) as error:
            self.close()
            raise self._damaged(error) from None
        except BaseException:
            self.close()
            raise

    def messages(self, keys: Collection[int]) -> Iterator[StoredMessage]:
        """Yield the messages of these topics in order of time, those of one time in that of the table, run by run."""
        names = ", ".join(str(channel.key) for channel in self.channels if channel.key in keys)
        try:
            for run in self._runs:
                for key, time, data in self._base.execute(
                    f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({names}) AND {_READABLE} "
                    f"AND {run} ORDER BY timestamp, id"
                ):
                    yield StoredMessage(key, time, data)
        except sqlite3.Error as error:
            raise self._damaged(error) from None

    def close(self) -> None:
        """Close the file."""
        with suppress(sqlite3.Error):
            self._base.close()

    def _damaged(self, error: Exception) -> SessionError:
        return SessionError(damaged_bag(self._path, str(error) or type(error).__name__))

    def _check_tables(self) -> None:
        names = set()
        for kind, name, text in self._base.execute("SELECT type, name, sql FROM sqlite_master LIMIT 1000"):
            if kind not in ("table", "index") or _NO_TABLE.search(str(text or "")):
                raise SessionError(damaged_bag(self._path, f"a {kind} that rosbag2 does not make: {str(text)[:80]!r}"))
            names.add(name)
        if missing := {"topics", "messages"} - names:
            raise SessionError(damaged_bag(self._path, f"it has no table {' and '.join(sorted(missing))}"))

    def _read_channels(self) -> list[StoredChannel]:
        definitions: dict[str, tuple[str, str]] = {}
        if self._columns("message_definitions") >= {"topic_type", "encoding", "encoded_message_definition"}:
            for kind, form, text in self._base.execute(
                f"SELECT topic_type, encoding, encoded_message_definition FROM message_definitions LIMIT {MOST_TOPICS}"
            ):
                definitions.setdefault(str(kind), (str(form), str(text)))
        counts: dict[Any, tuple[int, int]] = {
            key: (count, readable)
            for key, count, readable in self._base.execute(
                f"SELECT topic_id, count(*), sum({_READABLE}) FROM messages GROUP BY topic_id LIMIT {MOST_TOPICS + 1}"
            )
        }
        channels = []
        for key, topic, kind, encoding in self._base.execute(
            f"SELECT id, name, type, serialization_format FROM topics ORDER BY id LIMIT {MOST_TOPICS + 1}"
        ):
            if not (isinstance(key, int) and isinstance(topic, str) and isinstance(kind, str)):
                raise SessionError(
                    damaged_bag(self._path, f"a topic with the id {key!r:.40} and the name {topic!r:.40}")
                )
            form, text = definitions.get(kind, ("", ""))
            count, readable = counts.pop(key, (0, 0))
            problem = "" if encoding == "cdr" else f"its messages are encoded as {encoding!r:.40}, and not as cdr"
            channels.append(
                StoredChannel(key, topic, kind, str(encoding), text, form, count, readable, problem=problem)
            )
        if len(channels) > MOST_TOPICS:
            raise SessionError(damaged_bag(self._path, f"it has more than {MOST_TOPICS} topics"))
        if counts:
            lost = sum(count for count, _ in counts.values())
            raise SessionError(damaged_bag(self._path, f"{lost} messages are of topics that it does not define"))
        return channels

    def _read_runs(self) -> list[str]:
        """Return conditions for the rows of each run (`time_order.Runs`)."""
        runs, starts = Runs(), []
        for number, key, time in self._base.execute(
            f"SELECT id, topic_id, timestamp FROM messages WHERE {_READABLE} ORDER BY id"
        ):
            if not isinstance(number, int):
                return ["TRUE"]
            if (start := runs.take(key, time, number)) is not None:
                starts.append(start)
        if not runs.numbers().any():
            return ["TRUE"]
        ends = [f"id < {end}" for end in starts[1:]] + ["TRUE"]
        return [f"id >= {start} AND {end}" for start, end in zip(starts, ends, strict=True)]

    def _columns(self, table: str) -> set[str]:
        return {row[1] for row in self._base.execute(f"PRAGMA table_info({table})")}
