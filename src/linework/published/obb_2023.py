"""Road boundaries and linear markings as published by Kang, Lee and Lee (2023), section by section.

S. Kang, J. Lee, J. Lee: Developing a method to automatically extract road boundary and linear road markings from a
mobile mapping system point cloud using oriented bounding box collision-detection techniques, Remote Sensing 15(19),
4656, doi:10.3390/rs15194656. `linework.methods.obb.method` goes beyond it: gaps and dashes, forks, worn paint, sigmas.

The printed algorithm 2 never compares the projections of both boxes; the test here is that of equations 3 to 5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.errors import ConfigError
from linework.model.settings import Settings, setting
from linework.published.bounding_volumes import OBB, collide_in_space
from linework.published.intensity_histogram import intensity_histogram


@dataclass(frozen=True, slots=True, kw_only=True)
class Obb2023Config(Settings):
    """Settings of the method as published: the search area, the two boxes, and the search intervals."""

    radius_m: float = setting(0.5, unit="m", reason="published; 1 m flattens curves", low=0.05, high=10)
    search_length_m: float = setting(
        1.0, unit="m", reason="not published; long on straights, short in curves", low=0.05, high=100
    )
    search_width_m: float = setting(
        0.5, unit="m", reason="not published; narrow on straights, wide in curves", low=0.01, high=10
    )
    normal_deg: float = setting(85.0, unit="deg", reason="published", low=0, high=90)
    tolerance_m: float = setting(0.02, unit="m", reason="published: precision of the points", low=0, high=1)
    neighbours: int = setting(
        16,
        unit="points",
        reason="not published; three points of a normal are taken from these",
        low=2,
        high=1000,
    )
    boundary_width_m: float = setting(0.5, unit="m", reason="published", low=0.01, high=10)
    marking_width_m: float = setting(0.2, unit="m", reason="published: width of the paint", low=0.01, high=10)
    min_intensity: float = setting(
        0.0,
        unit="",
        reason="published: chosen for each survey; 0 with max_intensity 0: proposed",
        low=0,
        high=1e9,
    )
    max_intensity: float = setting(0.0, unit="", reason="published: see min_intensity", low=0, high=1e9)

    def __post_init__(self) -> None:
        """Refuse a range that holds nothing; without arguments, as dataclasses with slots have no `super`."""
        Settings.__post_init__(self)
        if self.min_intensity >= self.max_intensity and (self.min_intensity, self.max_intensity) != (
            0.0,
            0.0,
        ):
            raise ConfigError(
                f"min_intensity is {self.min_intensity:g}, max_intensity {self.max_intensity:g}",
                where=type(self).__name__, advice="give two rising numbers, or neither",
            )  # fmt: skip


#: Fewest points of which a floor plane or a marking is made: a plane has three.
FEWEST = 3
#: Least share of the points with upright normals in a group that is a plane: others are noise. [1]
LARGE_SHARE = 0.05
#: Share of a group of points from which the plane of the floor starts, its lowest [1], and how often it is fitted.
LOWEST_SHARE, N_FITS = 0.25, 5
#: Widest sector of a search area without floor in which the floor still has no edge there: a boundary through the rim
#: itself leaves none, one through the middle leaves half a circle. [rad]
NO_EDGE_RAD = math.radians(60.0)
#: A boundary is steeper than anything on the road: the search area holds points this high above its floor. [m]
OVER_FLOOR_M = 0.02
#: Points of a disc about a place (2,) [m]: (n, 3) [m], and their intensities (n,) or None.
PointsAbout = Callable[[FloatArray], tuple[FloatArray, FloatArray | None]]


class NoBoxError(ValueError):
    """A search area gives no box; the message says which of the paper's failures it is."""


# 2.3 Boxes of road boundaries from normal vectors


def normal_vectors(xyz: FloatArray, neighbours: int) -> FloatArray:
    """Return (n, 3) the unit normals of points, from three points each (algorithm 1).

    Notes
    -----
    The point itself, the farthest of its nearest neighbours, and the one with which these two make the largest
    triangle: neighbours on one scan line would give no plane. The paper does not say which three it takes, and uses the
    distance of the plane from the origin, which algorithm 1 computes too, nowhere.
    """
    k = min(neighbours + 1, len(xyz))
    near = xyz[cKDTree(xyz).query(xyz, k)[1].reshape(len(xyz), k)]
    p0, around = xyz[:, None], near[:, 1:]
    # Vectors u = p0 - p1, v = p0 - p2 and their cross product
    u = p0 - around[:, -1:]
    v = p0 - around
    normal = np.cross(u, v)
    length = np.linalg.norm(normal, axis=2)
    best = np.argmax(length, axis=1)
    row = np.arange(len(xyz))
    with np.errstate(invalid="ignore", divide="ignore"):
        normal = normal[row, best] / length[row, best, None]
    return np.asarray(np.where(normal[:, 2:] < 0.0, -normal, normal))


def is_upright(xyz: FloatArray, config: Obb2023Config) -> BoolArray:
    """Return (n,) bool: points whose normals stand at more than `normal_deg`; not those without a normal."""
    up = normal_vectors(xyz, config.neighbours)[:, 2]
    return np.asarray(np.nan_to_num(up) > math.sin(math.radians(config.normal_deg)))


def floor_plane(xyz: FloatArray, config: Obb2023Config) -> BoolArray:
    """Return (n,) bool: the points of a search area on its floor plane (figure 6b).

    Points whose normals stand at more than `normal_deg` are joined to groups by k-NN; the lowest group that is not
    only noise gives the plane, and all points within `tolerance_m` of it are on the floor.

    Raises
    ------
    NoBoxError
        No points have such normals.
    """
    if len(xyz) <= FEWEST:
        raise NoBoxError("no points in the search area")
    upright = np.flatnonzero(is_upright(xyz, config))
    if len(upright) < FEWEST:
        raise NoBoxError(
            f"no points with normals of more than {config.normal_deg:g} degrees in the search area"
        )
    group = groups_of_neighbours(xyz[upright], config.neighbours, config.tolerance_m)
    # The lowest of the groups: the lowest points are the road
    sizes = np.bincount(group)
    heights = np.bincount(group, xyz[upright, 2]) / sizes
    large = sizes >= max(FEWEST, LARGE_SHARE * len(upright))
    if not large.any():
        raise NoBoxError("no plane in the search area")
    lowest = int(np.argmin(np.where(large, heights, np.inf)))
    own = xyz[upright[group == lowest]]
    # The plane of its lowest points, and then of all points that it comes near to
    is_floor = own[:, 2] <= np.quantile(own[:, 2], LOWEST_SHARE)
    for _ in range(N_FITS):
        middle = own[is_floor].mean(axis=0)
        slope, *_ = np.linalg.lstsq(own[is_floor, :2] - middle[:2], own[is_floor, 2] - middle[2])
        is_near = np.abs(own[:, 2] - middle[2] - (own[:, :2] - middle[:2]) @ slope) <= config.tolerance_m
        if np.count_nonzero(is_near) < FEWEST:
            break
        is_floor = is_near
    off = xyz[:, 2] - middle[2] - (xyz[:, :2] - middle[:2]) @ slope
    return np.asarray(np.abs(off) <= config.tolerance_m)


def groups_of_neighbours(xyz: FloatArray, neighbours: int, tolerance_m: float) -> IntArray:
    """Return (n,) the group of each point: nearest neighbours whose heights agree within `tolerance_m` are in one."""
    k = min(neighbours + 1, len(xyz))
    near = cKDTree(xyz).query(xyz, k)[1].reshape(len(xyz), k).ravel()
    first = np.repeat(np.arange(len(xyz)), k)
    is_level = np.abs(xyz[first, 2] - xyz[near, 2]) <= tolerance_m
    first, near = first[is_level], near[is_level]
    link = coo_array((np.ones(len(first), dtype=np.int8), (first, near)), shape=(len(xyz), len(xyz)))
    return np.asarray(connected_components(link, directed=False)[1], dtype=np.int64)


def edge_of_floor(xyz: FloatArray, is_floor: BoolArray, place: FloatArray, radius_m: float) -> FloatArray:
    """Return the end points (2, 3) [m] of the edge of a floor plane in a search area (figure 6c).

    Where the floor ends, a sector of the disc is without it: its two sides are the end points.

    Raises
    ------
    NoBoxError
        The floor covers the whole disc (figure 4b), does not reach its rim (4a), or ends where there are no data.
    """
    plan = xyz[:, :2] - place
    at_rim = np.hypot(*plan.T) >= 0.7 * radius_m  # half of the disc's area
    floor = is_floor & at_rim
    if np.count_nonzero(floor) < FEWEST:
        raise NoBoxError("no road at the edge of the search area, which must show road and boundary")
    angle = np.arctan2(plan[:, 1], plan[:, 0])
    order = np.flatnonzero(floor)[np.argsort(angle[floor], kind="stable")]
    gap = np.diff(np.append(angle[order], angle[order[0]] + 2.0 * np.pi))
    widest = int(np.argmax(gap))
    if gap[widest] < NO_EDGE_RAD:
        raise NoBoxError("all road, no boundary in the search area")
    beyond = (angle - angle[order[widest]]) % (2.0 * np.pi) < gap[widest]
    level = float(xyz[floor, 2].mean())
    if not np.any(beyond & ~is_floor & (np.abs(xyz[:, 2] - level) > OVER_FLOOR_M)):
        raise NoBoxError("no data beyond the road in the search area")
    return xyz[[order[widest], order[(widest + 1) % len(order)]]]


def boundary_box(xyz: FloatArray, place: FloatArray, config: Obb2023Config) -> OBB:
    """Return the box of a road boundary in a search area: along the edge of its floor plane, `boundary_width_m` wide.

    Parameters
    ----------
    xyz
        (n, 3) points of the search area. [m]
    place
        (2,) middle of the search area. [m]

    Raises
    ------
    NoBoxError
        As `floor_plane` and `edge_of_floor`.
    """
    ends = edge_of_floor(xyz, floor_plane(xyz, config), place, config.radius_m)
    return box_along(ends, config.boundary_width_m, config.search_width_m)


def box_along(ends: FloatArray, width_m: float, height_m: float) -> OBB:
    """Return the box about a reference line with ends (2, 3) [m], which is its u-axis."""
    line = ends[1] - ends[0]
    if float(np.hypot(*line[:2])) == 0.0:
        raise NoBoxError("the reference line has no length")
    box = OBB.along(ends, line)
    return replace(box, half_m=np.array([box.half_m[0], 0.5 * width_m, 0.5 * height_m]))


# 2.4 Boxes of markings from intensities


def intensity_range(intensity: FloatArray, config: Obb2023Config) -> tuple[float, float]:
    """Return the range of intensities of paint: the one that was set, or the one proposed by the search area.

    Raises
    ------
    NoBoxError
        None is set, and the search area has no two classes (figure 8d).
    """
    if config.max_intensity > 0.0:
        return config.min_intensity, config.max_intensity
    proposed = intensity_histogram(intensity).proposed
    if proposed is None:
        raise NoBoxError("no marking in the search area")
    return proposed


def marking_box(xyz: FloatArray, intensity: FloatArray | None, config: Obb2023Config) -> OBB:
    """Return the box of a linear marking in a search area: along its centre line, `marking_width_m` wide (figure 8a).

    Raises
    ------
    NoBoxError
        No marking in the search area (figure 8d), or none whose intensities are in the range (figure 8c).
    """
    if intensity is None:
        raise NoBoxError("the points have no intensity")
    if len(xyz) <= FEWEST:
        raise NoBoxError("no points in the search area")
    low, high = intensity_range(intensity, config)
    paint = on_fitted_plane(xyz[(intensity >= low) & (intensity <= high)], config.tolerance_m)
    if len(paint) < FEWEST:
        proposed = intensity_histogram(intensity).proposed if config.max_intensity > 0.0 else None
        if proposed is None:
            raise NoBoxError("no marking in the search area")
        raise NoBoxError(
            f"the marking's intensities are not in the range {low:g} to {high:g}; {proposed[0]:g} to {proposed[1]:g} "
            "would hold them"
        )
    return box_along(
        centre_line(paint, 0.5 * config.marking_width_m), config.marking_width_m, config.search_width_m
    )


def on_fitted_plane(xyz: FloatArray, tolerance_m: float) -> FloatArray:
    """Return those of the points (n, 3) [m] that are within a tolerance of the plane fitted to all of them (figure 7)."""
    if len(xyz) < FEWEST:
        return xyz
    middle = xyz.mean(axis=0)
    slope, *_ = np.linalg.lstsq(xyz[:, :2] - middle[:2], xyz[:, 2] - middle[2])
    return np.asarray(xyz[np.abs(xyz[:, 2] - middle[2] - (xyz[:, :2] - middle[:2]) @ slope) <= tolerance_m])


def centre_line(paint: FloatArray, end_m: float) -> FloatArray:
    """Return the end points (2, 3) of a group of points (n, 3) [m]: the middle of each end, `end_m` long."""
    middle = paint.mean(axis=0)
    _, _, axes = np.linalg.svd(paint[:, :2] - middle[:2], full_matrices=False)
    along = (paint[:, :2] - middle[:2]) @ axes[0]
    ends = []
    for tip, is_end in (
        (along.min(), along <= along.min() + end_m),
        (along.max(), along >= along.max() - end_m),
    ):
        inner = paint[is_end].mean(axis=0)
        # The middle of the end lies half its length inside: the line goes on to the tip
        ends.append(inner + np.append((tip - along[is_end].mean()) * axes[0], 0.0))
    return np.array(ends)


# 2.5 Extraction by collision detection


@dataclass(frozen=True, slots=True)
class Followed:
    """A line of centres of boxes (k, 3) [m], its boxes, and why it ends at its start and at its end."""

    xyz: FloatArray
    boxes: tuple[OBB, ...]
    stops: tuple[str, str]


def follow(
    points_about: PointsAbout, first: OBB, kind: str, config: Obb2023Config, *, max_boxes: int = 10_000
) -> Followed:
    """Return the line of a kind through a first box, followed backward and forward (figures 10 to 12).

    Parameters
    ----------
    points_about
        Returns the points within `radius_m` of a place.
    first
        Reference data: the box in the search area that was picked (`box_at`).
    kind
        "road_boundary" or "lane_marking".
    max_boxes
        Most boxes to either side.

    Notes
    -----
    B is built in the search area about the middle of A'. The paper gets there by the normal of A' and that of the road
    where the two meet; here the direction of the road is that of the line itself. The width of A' is the search width,
    as its height is. A line also ends where it would turn back or return to itself.
    """
    chains: list[list[OBB]] = []
    stops: list[str] = []
    for step_m in (-config.search_length_m, config.search_length_m):
        chain, stop = [first], "most boxes reached"
        while len(chain) <= max_boxes:
            a = chain[-1]
            # A' is A, moved by the search length along the road
            moved = replace(
                a.moved(step_m), half_m=np.array([a.half_m[0], *[0.5 * config.search_width_m] * 2])
            )
            # B is built there
            try:
                b = box_at(points_about, moved.centre[:2], kind, config)
            except NoBoxError as none:
                stop = str(none)
                break
            if b.u @ a.u < 0.0:
                b = replace(b, axes=b.axes * np.array([[-1.0], [-1.0], [1.0]]))
            if not collide_in_space(moved, b):
                stop = "the next box does not collide"
                break
            if (b.centre - a.centre) @ (moved.centre - a.centre) <= 0.0:
                stop = "the next box lies behind"
                break
            passed = np.array([box.centre[:2] for box in (*(chains[0] if chains else ()), *chain[:-1])])
            if len(passed) and np.hypot(*(passed - b.centre[:2]).T).min() < 0.5 * config.search_length_m:
                stop = "the line returns to itself"
                break
            # On collision the centres of A and B are joined
            chain.append(b)
        chains.append(chain)
        stops.append(stop)
    boxes = (*chains[0][:0:-1], *chains[1])
    return Followed(np.array([box.centre for box in boxes]), boxes, (stops[0], stops[1]))


def with_range(points_about: PointsAbout, place: FloatArray, config: Obb2023Config) -> Obb2023Config:
    """Return the settings with the range of intensities that the search area about a place (2,) [m] gives.

    It is chosen once for a line, in the area that was picked. Settings with a range are returned as they are.

    Raises
    ------
    NoBoxError
        None is set, and the search area has no two classes (figure 8d), or no points or intensities.
    """
    intensity = points_about(place)[1]
    if intensity is None:
        raise NoBoxError("the points have no intensity")
    if len(intensity) <= FEWEST:
        raise NoBoxError("no points in the search area")
    low, high = intensity_range(intensity, config)
    return replace(config, min_intensity=low, max_intensity=high)


def box_at(points_about: PointsAbout, place: FloatArray, kind: str, config: Obb2023Config) -> OBB:
    """Return the box of a kind in the search area about a place (2,) [m].

    Raises
    ------
    NoBoxError
        See `boundary_box` and `marking_box`.
    """
    xyz, intensity = points_about(place)
    # From the place on: world coordinates would cost digits
    origin = np.append(place, xyz[:, 2].min() if len(xyz) else 0.0)
    local, middle = xyz - origin, np.zeros(2)
    box = (
        boundary_box(local, middle, config)
        if kind == "road_boundary"
        else marking_box(local, intensity, config)
    )
    return replace(box, centre=box.centre + origin)
