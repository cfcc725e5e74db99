"""The bounding volumes of Kang, Lee and Lee (2023) and their collision tests, as published.

Figure 1 of the paper compares the axis-aligned box, the oriented box and the polytope of fixed directions [1]; its
tracking joins oriented boxes that collide (step 2.5). `linework.methods.obb` keeps the centres, directions and extents
of its boxes in columns and tests rectangles in plan; these classes hold one volume each, in space.

References
----------
.. [1] S. Kang, J. Lee, J. Lee (2023), doi:10.3390/rs15194656.
.. [2] J. Klosowski et al. (1998), Efficient collision detection using bounding volume hierarchies of k-DOPs,
   doi:10.1109/2945.675649.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from linework.arrays import BoolArray, FloatArray, checked
from linework.kernels.tracking.track import collides_in_plan

#: Tolerance for rounding of a point on the side of a box; less than any scanner resolves. [m]
ROUNDING_M = 1e-9


@dataclass(frozen=True, slots=True)
class AABB:
    """Axis-aligned box: lowest and highest east, north, up, each (3,) [m].

    >>> AABB.of(np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.5]])).centre.tolist()
    [1.0, 0.5, 0.25]
    """

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, xyz: FloatArray) -> AABB:
        """Return the smallest box around points (n, 3) [m].

        Raises
        ------
        ValueError
            There are no points, or they have another shape.
        """
        xyz = _points(xyz)
        return cls(xyz.min(axis=0), xyz.max(axis=0))

    @property
    def centre(self) -> FloatArray:
        """Centre of the box, (3,) [m]."""
        return 0.5 * (self.low + self.high)

    @property
    def corners(self) -> FloatArray:
        """Corners, (8, 3) [m], the last axis changing fastest."""
        return np.where(_SIGNS < 0, self.low, self.high)

    def contains(self, xyz: FloatArray) -> BoolArray:
        """Return which points (n, 3) [m] are in the box or on its sides, (n,) bool."""
        return np.asarray(((xyz >= self.low) & (xyz <= self.high)).all(axis=1))


@dataclass(frozen=True, slots=True)
class OBB:
    """Oriented box: the smallest around points whose sides follow a reference line.

    Parameters
    ----------
    centre
        (3,) float64 [m].
    axes
        (3, 3) float64: unit vectors u (along the reference line), v (to its left), w (upwards), as rows.
    half_m
        (3,) float64 [m]: half extents along u, v and w; any may be 0.
    """

    centre: FloatArray
    axes: FloatArray
    half_m: FloatArray

    @classmethod
    def along(cls, xyz: FloatArray, line: FloatArray) -> OBB:
        """Return the smallest box around points (n, 3) along a reference line.

        Parameters
        ----------
        line
            (2,) or (3,): direction of the line; with 3 numbers the box climbs with it, its v-axis stays level.

        Raises
        ------
        ValueError
            There are no points, or the line has no direction in plan.

        >>> box = OBB.along(np.array([[0.0, 0.0, 0.0], [2.0, 2.0, 1.0]]), np.array([1.0, 1.0]))
        >>> box.half_m.round(3).tolist()
        [1.414, 0.0, 0.5]
        """
        xyz = _points(xyz)
        axes = _axes(line)
        # From the first point on: world coordinates would cost digits
        local = (xyz - xyz[0]) @ axes.T
        low, high = local.min(axis=0), local.max(axis=0)
        return cls(xyz[0] + 0.5 * (low + high) @ axes, axes, 0.5 * (high - low))

    @classmethod
    def smallest_in_plan(cls, xyz: FloatArray) -> OBB:
        """Return the upright box of least area in plan around points (n, 3), its longer side along u.

        One side of the smallest rectangle lies on an edge of the convex hull: every edge is tried.

        Raises
        ------
        ValueError
            There are no points, or they have another shape.
        """
        hull = _hull_in_plan(_points(xyz)[:, :2])
        edges = np.diff(np.concatenate([hull, hull[:1]]), axis=0)
        edges = edges[np.hypot(*edges.T) > 0.0]
        boxes = [cls.along(xyz, edge) for edge in edges] or [cls.along(xyz, np.array([1.0, 0.0]))]
        best = min(boxes, key=lambda box: float(box.half_m[0] * box.half_m[1]))
        if best.half_m[1] > best.half_m[0]:
            return cls.along(xyz, best.axes[1])
        return best

    @property
    def u(self) -> FloatArray:
        """Unit vector along the reference line, (3,)."""
        return np.asarray(self.axes[0])

    @property
    def v(self) -> FloatArray:
        """Unit vector across it, to the left, (3,)."""
        return np.asarray(self.axes[1])

    @property
    def height_m(self) -> float:
        """Extent along w. [m]"""  # noqa: D400
        return 2.0 * float(self.half_m[2])

    @property
    def corners(self) -> FloatArray:
        """Corners, (8, 3) [m], the w-axis changing fastest."""
        return np.asarray(self.centre + (_SIGNS * self.half_m) @ self.axes)

    def contains(self, xyz: FloatArray) -> BoolArray:
        """Return which points (n, 3) [m] are in the box or on its sides, (n,) bool."""
        local = (xyz - self.centre) @ self.axes.T
        return np.asarray((np.abs(local) <= self.half_m + ROUNDING_M).all(axis=1))

    def moved(self, along_m: float) -> OBB:
        """Return the box moved along its u-axis [m]: A' of the paper's figure 12."""
        return replace(self, centre=self.centre + along_m * self.u)

    def grown(self, by_m: float) -> OBB:
        """Return the box with every side moved outwards by `by_m` [m]."""
        return replace(self, half_m=self.half_m + by_m)


@dataclass(frozen=True, slots=True)
class KDOP:
    """Polytope of fixed directions: k = 2 m half spaces, two per direction [2].

    Parameters
    ----------
    directions
        (m, 3) float64, unit vectors.
    low, high
        (m,) float64 [m]: least and largest projection onto each direction.
    """

    directions: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, xyz: FloatArray, directions: FloatArray) -> KDOP:
        """Return the smallest polytope of these directions (m, 3) around points (n, 3) [m].

        Raises
        ------
        ValueError
            There are no points, or an array has another shape.
        """
        directions = checked("directions", directions, np.float64, (None, 3))
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        along = _points(xyz) @ directions.T
        return cls(directions, along.min(axis=0), along.max(axis=0))

    @property
    def corners(self) -> FloatArray:
        """Corners, (n, 3) [m]: places where three of its planes meet and that no other plane cuts off."""
        slabs = np.array(list(combinations(range(len(self.directions)), 3)))
        normals = self.directions[slabs]
        slabs = slabs[np.abs(np.linalg.det(normals)) > 1e-9]
        sides = np.array(list(product((False, True), repeat=3)))
        right = np.where(sides[None], self.high[slabs][:, None], self.low[slabs][:, None])
        places = np.linalg.solve(self.directions[slabs][:, None], right[..., None])[..., 0].reshape(-1, 3)
        places = places[self.contains(places)]
        # Planes of more than three directions may meet in one corner
        return np.asarray(np.unique(places.round(6), axis=0))

    def contains(self, xyz: FloatArray) -> BoolArray:
        """Return which points (n, 3) [m] are in the polytope or on its sides, (n,) bool."""
        along = xyz @ self.directions.T
        return np.asarray(((along >= self.low - ROUNDING_M) & (along <= self.high + ROUNDING_M)).all(axis=1))


def dop_directions(k: int) -> FloatArray:
    """Return the directions (k / 2, 3) of the usual k-DOPs: faces of a cube (6), its corners and edges cut off.

    Raises
    ------
    ValueError
        k is none of 6, 14, 18, 26.

    Examples
    --------
    >>> [len(dop_directions(k)) for k in (6, 14, 18, 26)]
    [3, 7, 9, 13]
    """
    faces = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    corners = [(1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1)]
    edges = [(1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 0, -1), (0, 1, -1)]
    known = {6: faces, 14: faces + corners, 18: faces + edges, 26: faces + corners + edges}
    if k not in known:
        raise ValueError(f"k is {k}, expected 6, 14, 18 or 26")
    return np.array(known[k], dtype=np.float64)


#: Signs of the corners of a box, (8, 3).
_SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))


def _points(xyz: FloatArray) -> FloatArray:
    xyz = checked("xyz", xyz, np.float64, (None, 3))
    if len(xyz) == 0:
        raise ValueError("no points: a bounding volume needs one at least")
    return xyz


def _axes(line: FloatArray) -> FloatArray:
    """Return u, v, w as rows for a line's direction; v is level."""
    u = np.zeros(3)
    u[: len(line)] = line
    level = float(np.hypot(u[0], u[1]))
    if level == 0.0:
        raise ValueError(f"line {np.asarray(line).tolist()} has no direction in plan")
    u /= np.linalg.norm(u)
    v = np.array([-u[1], u[0], 0.0]) / np.hypot(u[0], u[1])
    return np.stack([u, v, np.cross(u, v)])


def _hull_in_plan(xy: FloatArray) -> FloatArray:
    """Return the corners (k, 2) of the convex hull, counter-clockwise (Andrew's monotone chain)."""
    xy = np.unique(xy, axis=0)
    if len(xy) < 3:
        return xy
    halves: list[list[FloatArray]] = []
    for ordered in (xy, xy[::-1]):
        half: list[FloatArray] = []
        for p in ordered:
            while len(half) > 1 and _turn(half[-2], half[-1], p) <= 0.0:
                half.pop()
            half.append(p)
        halves.append(half[:-1])
    return np.array(halves[0] + halves[1])


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


#: Cross products of unit vectors shorter than this are rounding: the axes are parallel.
PARALLEL = 1e-12


def collide_in_plan(a: OBB, b: OBB) -> bool:
    """Return whether two boxes overlap in plan: four axes, the sides of both rectangles.

    >>> box = OBB.along(np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.0]]), np.array([1.0, 0.0]))
    >>> collide_in_plan(box, box.moved(0.9)), collide_in_plan(box, box.moved(1.1))
    (True, False)
    """
    # From the first box's centre: world coordinates would cost digits
    return bool(collides_in_plan(*_rectangle(a, a.centre), *_rectangle(b, a.centre)))


def collide_in_space(a: OBB, b: OBB) -> bool:
    """Return whether two boxes overlap in space: 15 axes, the faces of both and each edge with each.

    The cross product of parallel edges is only rounding and is skipped: the faces decide there. Nearly parallel edges
    need no tolerance, as any axis of unit length that separates the boxes proves them disjoint, even if it is not
    exactly the cross product.
    """
    edges = np.cross(a.axes[:, None], b.axes[None]).reshape(9, 3)
    length = np.linalg.norm(edges, axis=1)
    kept = length > PARALLEL
    axes = np.concatenate([a.axes, b.axes, edges[kept] / length[kept, None]])
    apart = np.abs(axes @ (b.centre - a.centre)) > _reach(a, axes) + _reach(b, axes)
    return not bool(apart.any())


def collide_by_slabs(a: KDOP, b: KDOP) -> bool:
    """Return whether two polytopes of the same directions overlap on each of these.

    False proves them disjoint. True does not prove that they overlap, as edges against edges are not tried: that is
    what makes the test fast.

    Raises
    ------
    ValueError
        The directions differ.
    """
    if not np.array_equal(a.directions, b.directions):
        raise ValueError("polytopes of different directions have no slabs in common")
    return bool(((a.low <= b.high) & (b.low <= a.high)).all())


def _reach(box: OBB, axes: FloatArray) -> FloatArray:
    """Return how far a box reaches from its centre along each of the axes (n, 3)."""
    return np.asarray(np.abs(axes @ box.axes.T) @ box.half_m)


def _rectangle(box: OBB, origin: FloatArray) -> tuple[float, ...]:
    """Return a box's outline in plan along its u-axis: centre, u-axis, half extents; exact if it is upright."""
    u = box.u[:2] / np.hypot(box.u[0], box.u[1])
    level = np.array([[u[0], u[1], 0.0], [-u[1], u[0], 0.0]])
    half = _reach(box, level)
    x, y, _ = box.centre - origin
    return float(x), float(y), float(u[0]), float(u[1]), float(half[0]), float(half[1])
