"""Shapes: immutable, checked on construction, SI units, centred on the origin, axis along local z.

Every constructor raises ShapeError for impossible values.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.surface import Surface
from collision_monitor.tolerances import LARGEST_INPUT

Array = NDArray[np.float64]

MOST_CLOUD_POINTS: Final = 500_000
"""Points of one cloud. Larger: its tree takes longer than the 100 ms for which one message may hold the answers."""


def _positive(value: float, what: str, *, or_zero: bool = False) -> float:
    expected = f"{'0 or ' if or_zero else ''}a positive number of metres up to {LARGEST_INPUT:g}"
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what}: expected {expected}, got {value!r}") from None
    if not (0.0 < number <= LARGEST_INPUT or (or_zero and number == 0.0)):
        raise ShapeError(f"{what}: expected {expected}, got {number!r}")
    return number


def _points(value: ArrayLike, what: str, width: int, least: int) -> Array:
    try:
        points = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ShapeError(f"{what}: expected an array of shape (n, {width}), got {type(value).__name__}") from None
    if points.ndim != 2 or points.shape[1] != width or len(points) < least:
        raise ShapeError(f"{what}: expected at least {least} points, shape (n, {width}), got shape {points.shape}")
    if not (np.abs(points) <= LARGEST_INPUT).all():
        raise ShapeError(f"{what}: expected finite coordinates up to {LARGEST_INPUT:g}, got NaN, infinity or larger")
    points.setflags(write=False)
    return points


@dataclass(frozen=True, eq=False)
class Shape:
    """Base class of all shapes. Shapes with arrays compare by identity, the others by their sizes."""


def array_bytes(shape: Shape) -> int:
    """Bytes of the arrays of a shape: its points and faces."""
    return sum(value.nbytes for value in vars(shape).values() if isinstance(value, np.ndarray))


@dataclass(frozen=True)
class Sphere(Shape):
    """Sphere; radius in m.

    >>> Sphere(0.5)
    Sphere(radius=0.5)
    """

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", _positive(self.radius, "Sphere radius"))


@dataclass(frozen=True)
class Box(Shape):
    """Box; size: full extents (x, y, z) in m. Zero extents are allowed (a plate, a needle), but not all three.

    >>> Box((1, 2, 3)).size
    (1.0, 2.0, 3.0)
    """

    size: Any

    def __new__(cls, *args: Any, **kwargs: Any) -> Self:
        """Refuse three numbers in place of one size."""
        if len(args) > 1:
            raise ShapeError(f"Box: expected one size, got {len(args)} arguments; write Box((x, y, z))")
        return super().__new__(cls)

    def __post_init__(self) -> None:
        try:
            size = tuple(float(s) for s in self.size)
        except (TypeError, ValueError, OverflowError):
            raise ShapeError(f"Box size: expected 3 full extents in m, as Box((1, 1, 1)), got {self.size!r}") from None
        if len(size) != 3 or not all(0.0 <= s <= LARGEST_INPUT for s in size) or max(size) == 0.0:
            raise ShapeError(f"Box size: expected 3 extents from 0 to {LARGEST_INPUT:g}, not all zero, got {size}")
        object.__setattr__(self, "size", size)

    @property
    def corners(self) -> Array:
        """The eight corners (8, 3) in m."""
        return np.array(list(product((-0.5, 0.5), repeat=3))) * np.array(self.size)


@dataclass(frozen=True)
class Capsule(Shape):
    """Capsule; radius and length of the core segment (without the caps) in m.

    >>> Capsule(radius=0.2, length=1)  # 1.4 m from end to end
    Capsule(radius=0.2, length=1.0)
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", _positive(self.radius, "Capsule radius"))
        object.__setattr__(self, "length", _positive(self.length, "Capsule length"))


@dataclass(frozen=True)
class Cylinder(Shape):
    """Cylinder; radius and height (length) in m.

    >>> Cylinder(radius=0.2, length=1)
    Cylinder(radius=0.2, length=1.0)
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", _positive(self.radius, "Cylinder radius"))
        object.__setattr__(self, "length", _positive(self.length, "Cylinder length"))


@dataclass(frozen=True)
class Cone(Shape):
    """Cone; radius of the base and height (length) in m. The apex is at +length/2.

    >>> Cone(radius=0.2, length=1)
    Cone(radius=0.2, length=1.0)
    """

    radius: float
    length: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", _positive(self.radius, "Cone radius"))
        object.__setattr__(self, "length", _positive(self.length, "Cone length"))


@dataclass(frozen=True)
class Ellipsoid(Shape):
    """Ellipsoid; radii: half axes along x, y, z in m.

    >>> Ellipsoid((0.3, 0.2, 0.1))
    Ellipsoid(radii=(0.3, 0.2, 0.1))
    """

    radii: Any

    def __post_init__(self) -> None:
        try:
            radii = tuple(self.radii)
        except TypeError:
            raise ShapeError(f"Ellipsoid radii: expected 3 half axes in metres, got {self.radii!r}") from None
        if len(radii) != 3:
            raise ShapeError(f"Ellipsoid radii: expected 3 half axes in metres, got {self.radii!r}")
        object.__setattr__(self, "radii", tuple(_positive(radius, "Ellipsoid radii") for radius in radii))


@dataclass(frozen=True, eq=False)
class ConvexHull(Shape):
    """Convex hull of points (n, 3) in m, n >= 4 and not all in one plane; interior points are allowed.

    >>> ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]).points.shape
    (4, 3)
    """

    points: Any

    def __post_init__(self) -> None:
        points = _points(self.points, "ConvexHull points", 3, 4)
        scale = np.abs(points).max()
        spread = np.linalg.svd((points - points.mean(axis=0)) / (scale or 1.0), compute_uv=False)
        if not spread[2] > 1e-12 * spread[0]:
            raise ShapeError("ConvexHull points: expected a solid, got points in one plane (use a Box or a Mesh)")
        object.__setattr__(self, "points", points)


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Shape):
    """Triangle surface, convex or not: vertices (n, 3) in m, faces (m, 3) of vertex indices.

    Faces are counter-clockwise seen from outside. Vertices with equal coordinates are one point. Where the surface is
    not closed, the bounds of answers include what its unknown inside may change (see `surface`).

    >>> Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]).faces.shape
    (1, 3)
    """

    vertices: Any
    faces: Any

    def __post_init__(self) -> None:
        vertices = _points(self.vertices, "Mesh vertices", 3, 3)
        try:
            faces = np.array(self.faces)
        except (TypeError, ValueError, OverflowError):
            got = type(self.faces).__name__
            raise ShapeError(f"Mesh faces: expected an array of shape (m, 3), got {got}") from None
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0 or not np.issubdtype(faces.dtype, np.integer):
            raise ShapeError(f"Mesh faces: expected integers of shape (m, 3), m >= 1, got {faces.dtype} {faces.shape}")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise ShapeError(
                f"Mesh faces: expected indices from 0 to {len(vertices) - 1}, got {faces.min()} to {faces.max()}"
            )
        faces = faces.astype(np.int32)
        faces.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @cached_property
    def surface(self) -> Surface:
        """Welded faces, and whether they close and are oriented. Computed on first access."""
        return Surface(self.vertices, self.faces)

    def __repr__(self) -> str:
        welded = f", {self.surface.welded} of them welded" if self.surface.welded else ""
        return f"Mesh({len(self.vertices)} vertices{welded}, {len(self.faces)} faces: {self.surface})"


@dataclass(frozen=True, eq=False, repr=False)
class Points(Shape):
    """Cloud of points (n, 3) in m, each a ball of `radius` in m, as one object: a scan, a depth image, a map.

    The radius may be 0. At most MOST_CLOUD_POINTS points. A cloud encloses nothing.

    >>> Points([(0, 0, 0), (1, 0, 0)], 0.05)
    Points(2 points, radius=0.05)
    """

    points: Any
    radius: float = 0.0

    def __post_init__(self) -> None:
        points = _points(self.points, "Points", 3, 1)
        if len(points) > MOST_CLOUD_POINTS:
            raise ShapeError(
                f"Points: expected at most {MOST_CLOUD_POINTS} points, got {len(points)}; "
                "keep one for each cube of a grid, or only those within reach"
            )
        radius = _positive(self.radius, "Points radius", or_zero=True)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "radius", float(radius))

    def __repr__(self) -> str:
        return f"Points({len(self.points)} points, radius={self.radius!r})"


@dataclass(frozen=True, eq=False)
class Triangle(Shape):
    """One face of a `Mesh` as its pair tests see it: points (3, 3) in m, which may lie on one line or coincide."""

    points: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", _points(self.points, "Triangle points", 3, 3))


@dataclass(frozen=True, eq=False)
class HalfSpace(Shape):
    """Half-space {x : normal . x <= offset}, offset in m. The normal points out of the solid; both get normalised.

    >>> HalfSpace(normal=(0, 0, 2), offset=1).normal  # the floor z <= 0.5
    array([0., 0., 1.])
    """

    normal: Any
    offset: float = 0.0

    def __post_init__(self) -> None:
        try:
            normal = np.array(self.normal, dtype=np.float64)
            offset = float(self.offset)
        except (TypeError, ValueError, OverflowError):
            got = f"{self.normal!r}, {self.offset!r}"
            raise ShapeError(f"HalfSpace: expected a normal (3) and an offset, got {got}") from None
        with np.errstate(over="ignore"):  # an infinite length is refused below
            length = float(np.linalg.norm(normal)) if normal.shape == (3,) else 0.0
        if not (length > 0.0 and np.isfinite(length) and np.isfinite(offset)):
            raise ShapeError(
                f"HalfSpace: expected a non-zero, finite normal and a finite offset, got {self.normal}, {offset}"
            )
        normal, offset = normal / length, offset / length
        if not abs(offset) <= LARGEST_INPUT:
            raise ShapeError(f"HalfSpace offset: expected at most {LARGEST_INPUT:g} m, got {offset:g} m")
        normal.setflags(write=False)
        object.__setattr__(self, "normal", normal)
        object.__setattr__(self, "offset", offset)


@dataclass(frozen=True)
class Circle(Shape):
    """Circle in the x-y plane; radius in m.

    >>> Circle(0.5)
    Circle(radius=0.5)
    """

    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", _positive(self.radius, "Circle radius"))


@dataclass(frozen=True, eq=False)
class Polygon(Shape):
    """Polygon in the x-y plane: points (n, 2) in m around the boundary of a simple polygon, convex or concave.

    radius: the polygon is grown by this length (m), which rounds its corners. With a radius, two points make a capsule.

    >>> Polygon([(0, 0), (1, 0), (0, 1)]).points.shape
    (3, 2)
    """

    points: Any
    radius: float = 0.0

    def __post_init__(self) -> None:
        radius = _positive(self.radius, "Polygon radius", or_zero=True)
        points = _points(self.points, "Polygon points", 2, 2 if radius else 3)
        if len(points) == 2 and (points[0] == points[1]).all():
            raise ShapeError("Polygon points: expected two different points, got the same twice (use a Circle)")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "radius", float(radius))
