"""Reference answers in decimals of 60 digits: slow, simple, and correct far beyond the last digit of a float.

A float is converted to the exact number that it represents. Vectors are lists of Decimal.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from decimal import Context, Decimal, localcontext
from functools import wraps
from itertools import product
from typing import Any, Final

DIGITS: Final = 60
_CONTEXT: Final = Context(prec=DIGITS, Emin=-999999, Emax=999999)

Vector = list[Decimal]
Matrix = list[Vector]


def exactly(function: Any) -> Any:
    """Make a function compute with DIGITS decimal digits."""

    @wraps(function)
    def run(*arguments: Any) -> Any:
        with localcontext(_CONTEXT):
            return function(*arguments)

    return run


def exact_vector(values: Iterable[float]) -> Vector:
    """Convert floats to decimals without rounding."""
    return [Decimal(float(x)) for x in values]


def exact_dot(a: Vector, b: Vector) -> Decimal:
    """Return a . b."""
    return sum((x * y for x, y in zip(a, b, strict=True)), Decimal(0))


def exact_minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return [x - y for x, y in zip(a, b, strict=True)]


def exact_cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def length(a: Vector) -> Decimal:
    """Return |a|."""
    return exact_dot(a, a).sqrt()


def axes(quaternion: Sequence[float]) -> Matrix:
    """Columns of the rotation matrix of a quaternion (x, y, z, w) of any length."""
    x, y, z, w = exact_vector(quaternion)
    s = 2 / (x * x + y * y + z * z + w * w)
    return [
        [1 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y)],
        [s * (x * y - w * z), 1 - s * (x * x + z * z), s * (y * z + w * x)],
        [s * (x * z + w * y), s * (y * z - w * x), 1 - s * (x * x + y * y)],
    ]


@exactly
def exact_sphere_sphere(p: Sequence[float], q: Sequence[float], r: float, s: float) -> Decimal:
    """Signed distance of two spheres at p and q with radii r and s."""
    return length(exact_minus(exact_vector(q), exact_vector(p))) - Decimal(r) - Decimal(s)


@exactly
def sphere_box(
    p: Sequence[float], r: float, q: Sequence[float], turn: Sequence[float], size: Sequence[float]
) -> Decimal:
    """Signed distance of a sphere at p and a box at q. With the centre inside, the depth is to the nearest face."""
    offset = exact_minus(exact_vector(p), exact_vector(q))
    local = [exact_dot(offset, axis) for axis in axes(turn)]
    out = [abs(x) - Decimal(s) / 2 for x, s in zip(local, size, strict=True)]
    if max(out) <= 0:
        return max(out) - Decimal(r)
    return length([max(x, Decimal(0)) for x in out]) - Decimal(r)


@exactly
def capsule_capsule(
    p: Sequence[float], u: Sequence[float], r: float, core_a: float,
    q: Sequence[float], v: Sequence[float], s: float, core_b: float,
) -> Decimal:  # fmt: skip
    """Signed distance of capsules at p and q with quaternions u and v, radii r and s, cores of core_a and core_b."""
    a, b = axes(u)[2], axes(v)[2]
    offset = exact_minus(exact_vector(q), exact_vector(p))
    half_a, half_b = Decimal(core_a) / 2, Decimal(core_b) / 2

    def apart(x: Decimal, y: Decimal) -> Decimal:
        return length([o + y * bi - x * ai for o, ai, bi in zip(offset, a, b, strict=True)])

    def within(x: Decimal, half: Decimal) -> Decimal:
        return max(-half, min(half, x))

    best = []
    for end in (-half_a, half_a):
        best.append(apart(end, within(end * exact_dot(a, b) - exact_dot(offset, b), half_b)))
    for end in (-half_b, half_b):
        best.append(apart(within(end * exact_dot(a, b) + exact_dot(offset, a), half_a), end))
    determinant = 1 - exact_dot(a, b) ** 2
    if determinant > 0:
        x = (exact_dot(offset, a) - exact_dot(a, b) * exact_dot(offset, b)) / determinant
        y = x * exact_dot(a, b) - exact_dot(offset, b)
        if abs(x) <= half_a and abs(y) <= half_b:
            best.append(apart(x, y))
    return min(best) - Decimal(r) - Decimal(s)


@exactly
def box_box_depth(
    p: Sequence[float], u: Sequence[float], size_a: Sequence[float],
    q: Sequence[float], v: Sequence[float], size_b: Sequence[float],
) -> Decimal | None:  # fmt: skip
    """Signed distance (negative) of overlapping boxes by the SAT with all fifteen axes. None if they do not overlap."""
    A, B = axes(u), axes(v)
    half_a, half_b = ([Decimal(float(s)) / 2 for s in size] for size in (size_a, size_b))
    offset = exact_minus(exact_vector(q), exact_vector(p))
    candidates = [*A, *B, *(exact_cross(a, b) for a, b in product(A, B))]
    worst: Decimal | None = None
    for axis in candidates:
        squared = exact_dot(axis, axis)
        if squared <= Decimal(10) ** (5 - DIGITS):
            continue
        reach = sum((h * abs(exact_dot(axis, e)) for h, e in zip(half_a + half_b, A + B, strict=True)), Decimal(0))
        gap = (abs(exact_dot(offset, axis)) - reach) / squared.sqrt()
        worst = gap if worst is None else max(worst, gap)
    return worst if worst is not None and worst <= 0 else None


@exactly
def spheres_meet(p: Sequence[float], v: Sequence[float], reach: Sequence[float]) -> Decimal | None:
    """Return the first time t >= 0 at which |p + v t| is at most the sum of `reach`, or None."""
    P, V, R = exact_vector(p), exact_vector(v), sum(exact_vector(reach), Decimal(0))
    a, b, c = exact_dot(V, V), exact_dot(P, V), exact_dot(P, P) - R * R
    if c <= 0:
        return Decimal(0)
    discriminant = b * b - a * c
    if b >= 0 or discriminant < 0:
        return None
    return c / (-b + discriminant.sqrt())


@exactly
def aligned_boxes_meet(
    p: Sequence[float], v: Sequence[float], size_a: Sequence[float], size_b: Sequence[float]
) -> Decimal | None:
    """Return the first time at which axis-aligned boxes touch, or None. The second box is at p with velocity v."""
    enter, leave = Decimal(0), Decimal("Infinity")
    for x, w, a, b in zip(exact_vector(p), exact_vector(v), exact_vector(size_a), exact_vector(size_b), strict=True):
        reach = (a + b) / 2
        if w == 0:
            if abs(x) > reach:
                return None
            continue
        first, last = sorted(((-reach - x) / w, (reach - x) / w))
        enter, leave = max(enter, first), min(leave, last)
    return enter if enter <= leave else None
