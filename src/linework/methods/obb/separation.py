"""Do two boxes collide: the separating axis theorem (step 2.5).

Two convex bodies are disjoint if and only if they are disjoint in their projections onto some axis L. For two
boxes a finite number of axes decides: |d . L| > rA + rB with d from centre to centre and r = sum of
e_i |axis_i . L| over a box's axes and half extents. Bodies that touch collide. (The paper's algorithm 2
updates a range by nodes of both boxes and never compares the two ranges; this is the theorem itself.)

S. Gottschalk, M. Lin, D. Manocha (1996), OBBTree, doi:10.1145/237170.237244.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.separation import collides_in_plan
from linework.methods.obb.boxes import KDOP, OBB

#: Cross products of unit vectors shorter than this are rounding: the axes are parallel.
PARALLEL = 1e-12


def collide_in_plan(a: OBB, b: OBB) -> bool:
    """Return whether two boxes share a place in plan: four axes, the sides of both rectangles.

    >>> box = OBB.along(np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.0]]), np.array([1.0, 0.0]))
    >>> collide_in_plan(box, box.moved(0.9)), collide_in_plan(box, box.moved(1.1))
    (True, False)
    """
    # From the first box's centre: world coordinates would cost digits
    return bool(collides_in_plan(*_rectangle(a, a.centre), *_rectangle(b, a.centre)))


def collide_in_space(a: OBB, b: OBB) -> bool:
    """Return whether two boxes share a place in space: 15 axes, the faces of both and each edge with each.

    Of parallel edges the cross product is nothing but rounding and is passed over: the faces decide there.
    Nearly parallel ones need no tolerance, as any axis of unit length that parts the boxes proves them
    disjoint, be it the cross product to all digits or not.
    """
    edges = np.cross(a.axes[:, None], b.axes[None]).reshape(9, 3)
    length = np.linalg.norm(edges, axis=1)
    kept = length > PARALLEL
    axes = np.concatenate([a.axes, b.axes, edges[kept] / length[kept, None]])
    apart = np.abs(axes @ (b.centre - a.centre)) > _reach(a, axes) + _reach(b, axes)
    return not bool(apart.any())


def collide_by_slabs(a: KDOP, b: KDOP) -> bool:
    """Return whether two polytopes of the same directions overlap on each of these.

    False proves them disjoint. True does not prove that they share a place, as edges against edges are not
    tried: that is what makes the test fast.

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
