"""The time of the sources: the one owner of stamps, steps and restarts. No clock is read.

Time is that of the stamps of the messages. It goes back when a bag is played in a loop or a simulation is reset; then
everything that holds a stamp begins anew: the steps, the history of tf, joints, waiting states, estimates and tracks.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Final, NamedTuple

from collision_monitor.errors import InputError
from collision_monitor.monitor.state.timeline import Order, Progress, Timeline

MAX_TIME_STEP: Final = 10.0
"""s by which a stamp may jump; a larger jump needs a second message, as in the monitor. A stamp ahead may jump by what
has passed since the last message besides, by the clock of receipt."""

PATIENCE: Final = 0.5
"""s that a publisher with earlier stamps must go on before its time counts."""

MOST_STREAMS: Final = 20_000
"""Streams whose last stamps are known: topics, frames of tf, publishers of joints. Further ones prove nothing, unless
others are older than MAX_TIME_STEP and make room."""

_NANOSECOND: Final = 1e-9
_SECOND: Final = 1_000_000_000
_END: Final = 2**31 * _SECOND
"""ns: the first time after those that a stamp can hold, in 2038."""


class _Stream:
    """The last stamp of a stream, when it was received, and the longest delay between both, all in ns.

    delay: None while the clock of receipt stands still, as in messages that a program makes. late: the longest delay of
    messages before the last one, which counts when the stream has gone on.
    """

    __slots__ = ("delay", "late", "received", "stamp")

    def __init__(self, stamp: int, received: int) -> None:
        self.stamp, self.received = stamp, received
        self.delay: int | None = None
        self.late: int | None = None

    def add(self, stamp: int, received: int) -> None:
        """Take a message that is not before the last one."""
        if received > self.received:
            known = [each for each in (self.delay, self.late) if each is not None]
            self.delay = max(*known, received - stamp, received - stamp)
        self.stamp, self.received, self.late = stamp, received, None

    def went_back(self, stamp: int, received: int) -> bool:
        """Whether time went back for a message before the last one; not if it is late, as others of the stream were."""
        if received <= self.received:
            return True
        delay = received - stamp
        self.late = delay if self.late is None else max(self.late, delay)
        return self.delay is None or delay > self.delay


class Clock:
    """The latest time of a family of streams, which tells late messages from a time that goes back.

    A stream of messages has rising stamps. A message before the last one of its stream is late, unless a second one
    agrees before the time advances. A message that is later than others of its stream were before, by no more than
    they, is one of a slower publisher. Stamps that jump by more than MAX_TIME_STEP need a second message too, unless as
    much time has passed by the clock of receipt.
    """

    def __init__(self, max_age: float) -> None:
        self._max_age = round(max_age * _SECOND)
        self._timeline = Timeline()
        self._streams: dict[Hashable, _Stream] = {}
        self._back: int | None = None  # stamp of the last message for which time went back, since it last advanced
        self._next_look = 0  # ns: no earlier look for old streams while there is no room, because it takes 1 ms
        self._received = 0  # receipt of the last message that was not refused, ns

    @property
    def has_begun(self) -> bool:
        """Whether there is a latest time."""
        return self._timeline.has_begun

    @property
    def now_ns(self) -> int:
        """The latest time."""
        return self._timeline.now_ns

    def begin(self, stamp: int) -> None:
        """Forget all streams and begin at a stamp."""
        self.forget()
        self._timeline.advance(stamp, Order.IN_ORDER, MAX_TIME_STEP, PATIENCE)

    def forget(self) -> None:
        """Forget all streams and the time."""
        self._timeline = Timeline()
        self._streams.clear()
        self._back, self._next_look = None, 0

    def advance(self, stream: Hashable, stamp: int, received: int) -> Progress:
        """Take a stamp of a stream. RESTARTS: the time begins anew, at this stamp. REFUSED: a jump, to be confirmed."""
        known = self._streams.get(stream)
        if self.has_begun and stamp == self.now_ns and (known is None or stamp >= known.stamp):
            self._note(stream, known, stamp, received)
            return Progress.CONTINUES
        if known is not None and stamp < known.stamp and known.went_back(stamp, received):
            if self._back is not None and stamp > self._back:
                self._restart(stream, stamp, received)
                return Progress.RESTARTS
            self._back = stamp
        before, has_begun = self._timeline.now_ns, self.has_begun
        is_late = has_begun and before - stamp > self._max_age
        order, silent = Order.LATE if is_late else Order.IN_ORDER, max(received - self._received, 0) * _NANOSECOND
        limit = MAX_TIME_STEP + (silent if has_begun and stamp > before else 0.0)
        progress = self._timeline.advance(stamp, order, limit, PATIENCE)
        if progress is Progress.RESTARTS:
            self._restart(stream, stamp, received)
        elif progress is Progress.CONTINUES:
            if self._timeline.now_ns > before:
                self._back = None
            self._note(stream, known, stamp, received)
        return progress

    def _note(self, stream: Hashable, known: _Stream | None, stamp: int, received: int) -> None:
        self._received = received
        if known is None:
            if len(self._streams) >= MOST_STREAMS and self.now_ns >= self._next_look:
                oldest = self.now_ns - round(MAX_TIME_STEP * _SECOND)
                self._streams = {key: each for key, each in self._streams.items() if each.stamp >= oldest}
                self._next_look = self.now_ns + _SECOND
            if len(self._streams) < MOST_STREAMS:
                self._streams[stream] = _Stream(stamp, received)
        elif stamp >= known.stamp:
            known.add(stamp, received)

    def _restart(self, stream: Hashable, stamp: int, received: int) -> None:
        self.begin(stamp)
        self._received = received
        self._streams[stream] = _Stream(stamp, received)


class _Others:
    """The time of the messages with stamps, for those without: it goes on as it did by the clock of receipt.

    latest: the latest stamp, ns; None before the first. A simulation may be slower than the clock of receipt, which is
    measured whenever PATIENCE is over. A faster one counts as equally fast, because its next stamp is soon there.
    """

    __slots__ = ("_advanced", "_heard", "_pace", "_since", "latest")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.latest: int | None = None
        self._pace = 1.0  # of the stamps, by the clock of receipt
        self._heard = self._advanced = 0  # receipt of the last message, and of that with the latest stamp, ns
        self._since = 0, 0  # stamp and receipt from which the pace is measured

    def note(self, stamp: int, received: int) -> None:
        """Take the stamp of a message."""
        began = self.latest is None or received < self._since[1]
        self._heard = received
        if self.latest is not None and stamp <= self.latest:
            return
        self.latest, self._advanced = stamp, received
        elapsed = received - self._since[1]
        if began:
            self._since = stamp, received
        elif elapsed >= PATIENCE * _SECOND:
            self._pace = min((stamp - self._since[0]) / elapsed, 1.0)
            self._since = stamp, received

    def at(self, received: int) -> int:
        """Return their time at a time of receipt."""
        assert self.latest is not None
        return min(self.latest + round(self._pace * max(received - self._advanced, 0)), _END - 1)

    def are_silent(self, received: int) -> bool:
        """Whether the last one is longer ago than PATIENCE, or none came."""
        return self.latest is None or not 0 <= received - self._heard <= PATIENCE * _SECOND


class MessageStamp(NamedTuple):
    """The stamp of a message. advances: whether time goes on with it. is_own: whether the message holds it."""

    ns: int
    advances: bool
    is_own: bool


class SourceTime:
    """Stamps of messages, and the stamps of the steps.

    by_header: the stamps are those of the headers; else the times of receipt. rate: Hz of the steps, or 0. step_topic:
    whose messages make the steps, or empty. max_age: s. least_period: s between two steps at a rate or with a topic.
    """

    def __init__(self, *, by_header: bool, rate: float, step_topic: str, max_age: float) -> None:
        self.least_period = 0.0
        self._by_header = by_header
        self._rate, self._step_topic = rate, step_topic
        self._messages = Clock(max_age)
        self._transforms = Clock(max_age)  # tf is ahead of the other topics, or behind them, and makes no steps
        self._others = _Others()  # the messages with stamps
        self._other_transforms = _Others()  # what counts while no other message has a stamp
        self._is_stamped = not by_header  # whether the time is one of stamps, not of receipt for lack of stamps
        self._tick: int | None = None  # the number of the last step at a rate
        self._last_step: int | None = None  # its stamp, or that of the last one with a topic

    @property
    def has_begun(self) -> bool:
        """Whether there is a latest time."""
        return self._messages.has_begun

    @property
    def now_ns(self) -> int:
        """The latest time."""
        return self._messages.now_ns

    def now_or(self, received: int) -> int:
        """Return the latest time; before the first stamp, a time of receipt."""
        begun = [clock for clock in (self._messages, self._transforms) if clock.has_begun]
        return begun[0].now_ns if begun else received

    # -- stamps

    def stamp_of(self, given: int, otherwise: int) -> int:
        """Return the stamp (ns) of a part of a message; `otherwise` if it is zero, or if the file selects receipt.

        given: that of its header. Raises InputError for a stamp that no clock shows.
        """
        if not self._by_header:
            return otherwise
        if not 0 <= given < _END:
            raise InputError(f"stamp: expected a time from 1970 to 2038, got {given * _NANOSECOND:.9f} s")
        return given or otherwise

    def part_stamp(self, given: int, of_message: int) -> int:
        """Return the stamp (ns) of a part of a message with a header of its own, which must be near the latest time.

        Raises InputError.
        """
        stamp = self.stamp_of(given, of_message)
        if self.has_begun and abs(stamp - self.now_ns) > MAX_TIME_STEP * _SECOND:
            raise InputError(f"stamp: expected one within {MAX_TIME_STEP:g} s of the others, got one further away")
        return stamp

    def message_stamp(self, given: int, received: int) -> MessageStamp:
        """Return the stamp of a message. given: that of its header, ns.

        A message without a stamp is as of the latest time of the others, and what passed since by the clock of receipt;
        only while the others are silent, time goes on with it. Before the first stamp, the time is that of receipt.
        Raises InputError for a stamp that no clock shows.
        """
        stamp = self.stamp_of(given, 0)
        if stamp:
            return MessageStamp(stamp, True, True)
        known = next((it for it in (self._others, self._other_transforms) if it.latest is not None), None)
        if self._by_header and known is not None:
            return MessageStamp(known.at(received), self._others.are_silent(received), False)
        if not 0 <= received < _END:
            raise InputError(f"time of receipt: expected one from 1970 to 2038, got {received * _NANOSECOND:.9f} s")
        return MessageStamp(received, True, not self._by_header)

    def advance(self, stream: Hashable, stamp: MessageStamp, received: int) -> Progress:
        """Take the stamp of a message. RESTARTS: forget all earlier times."""
        if not stamp.advances:
            return Progress.CONTINUES
        if stamp.is_own and self._leaves_receipt(stamp.ns):
            self._messages.begin(stamp.ns)
            progress = Progress.RESTARTS
        else:
            progress = self._messages.advance(stream, stamp.ns, received)
        if progress is Progress.RESTARTS:
            self._transforms.forget()
            self._restarted()
            if stamp.is_own:
                self._others.forget()
                self._other_transforms.forget()
        if stamp.is_own and progress is not Progress.REFUSED:
            self._others.note(stamp.ns, received)
        return progress

    def advance_transforms(self, frame: str, stamp: int, received: int) -> Progress:
        """Take the stamp of a transform to a frame. RESTARTS: forget all earlier times."""
        progress = self._transforms.advance(frame, stamp, received)
        if self._leaves_receipt(stamp):
            progress = Progress.RESTARTS
        if progress is Progress.RESTARTS:
            if self.has_begun:
                self._messages.begin(stamp)
            self._others.forget()
            self._other_transforms.forget()
            self._restarted()
        if progress is not Progress.REFUSED:
            self._other_transforms.note(stamp, received)
        return progress

    def _leaves_receipt(self, stamp: int) -> bool:
        """Take the first stamp; return whether the time so far was the clock of receipt, and another one."""
        was_stamped, self._is_stamped = self._is_stamped, True
        return not was_stamped and self.has_begun and abs(stamp - self.now_ns) > MAX_TIME_STEP * _SECOND

    def _restarted(self) -> None:
        self._tick = self._last_step = None

    # -- steps

    @property
    def has_own_steps(self) -> bool:
        """Whether steps are made at a rate or with a topic; else each message makes one."""
        return bool(self._rate or self._step_topic)

    def step_due(self, topic: str, stamp: int) -> int | None:
        """Return the stamp of the step that is due with a message; None if there is none."""
        if not self.has_own_steps:
            return self.now_ns
        if self._step_topic:
            return stamp if topic == self._step_topic and not self._is_too_soon(stamp) else None
        period = round(_SECOND / self._rate)
        tick = self.now_ns // period
        if (self._tick is not None and tick <= self._tick) or self._is_too_soon(tick * period):
            return None
        self._tick = tick
        return tick * period

    def _is_too_soon(self, stamp: int) -> bool:
        """Whether the least period after the last step is not over. If it is, this step is the last one."""
        if self._last_step is not None and 0 <= stamp - self._last_step < self.least_period * _SECOND:
            return True
        self._last_step = stamp
        return False
