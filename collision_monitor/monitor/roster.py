"""Objects by id: slots, shapes, allowed pairs."""

from __future__ import annotations

from collision_monitor._jit import kernel


@kernel
def count_bodies(bodies, count, now, stale_after):
    """How many of the first `count` slots hold bodies that are static, that nothing was heard of, and that are stale:
    that nothing was heard of for stale_after (s).
    """
    static = unseen = stale = 0
    for i in range(count):
        if bodies.used[i]:
            static += bodies.static[i]
            unseen += not bodies.seen[i]
            stale += bodies.seen[i] and not bodies.static[i] and now - bodies.time[i] > stale_after
    return static, unseen, stale
