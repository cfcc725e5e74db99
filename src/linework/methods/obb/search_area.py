"""Search areas about a picked place: their contents, and why no line can be tracked from there (step 2.1).

A search area is a disc of 0.50 m, in which a bend is straight; its lowest points are the road. The paper asks the
operator for a place with both road and boundary, or road and marking, without lost data, and shows the failures
elsewhere [1]. Here the program names the failure, and proposes the nearest place from which a line can be tracked.

References
----------
.. [1] S. Kang, J. Lee, J. Lee (2023), figures 2 to 4 and 8, doi:10.3390/rs15194656.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from linework.arrays import FloatArray

#: Radius of a search area, the paper's: in a disc of 1 m a curve is flattened. [m]
RADIUS_M = 0.50
#: Thickness of a floor, the paper's: mobile mapping points are accurate to 2 cm. [m]
FLOOR_THICKNESS_M = 0.02
#: Largest slope of a road, crossfall and grade together, as for the surface. [m/m]
MAX_GRADE = 0.25
#: Largest height of road and kerb over the lowest point of a disc of 0.50 m: 0.25 m each. [m]
HIGHEST_IN_DISC_M = 0.50
#: An empty place with data all around within this distance is a hole: cars and their shadows are shorter. [m]
HOLE_AROUND_M = 8.0
#: Smallest angle without any point at the edge of the data: less than that of a straight edge, more than that of a
#: shadow. [rad]
EDGE_RAD = np.radians(140.0)
#: Smallest angle without any point that hides a line in the search area itself. [rad]
HOLE_RAD = np.radians(120.0)
#: Fewest points within this radius [m] that can show a line: of 60, three lie on a line 0.12 m wide. The detectors need
#: more.
LEAST_AREA_POINTS, SPARSE_M = 60, 2.0
#: Rounds of fitting the lowest plane, after which it stands still; weight of a point above it over one below.
_N_ROUNDS, _ABOVE_WEIGHT = 12, 0.01
#: One in this many points may be a stray far below the road.
_POINTS_PER_STRAY = 50


class NoLineReason(StrEnum):
    """Why no line can be tracked from a place."""

    OFF_THE_EDGE = "off the edge of the data"
    HOLES = "a hole in the data"
    TOO_FEW_POINTS = "too few points to show a line"
    NO_ROAD = "no road in the search area"
    ALL_ROAD = "all road, no boundary in the search area"
    NO_MARKING = "no marking in the search area"


@dataclass(frozen=True, slots=True)
class SearchArea:
    """The points within a disc about a place, their floor, and the data around them.

    Parameters
    ----------
    place
        (2,) float64 [m, from the survey's local origin].
    xyz
        (n, 3) float64 [m, from the same origin]: points in the disc.
    floor
        (3,) float64: height at the place [m] of the plane through the lowest points, and its slopes to the east and
        to the north; NaN with fewer than three points.
    widest_hole_rad
        Widest angle of the disc without a point. [rad]
    widest_gap_rad
        Widest angle without a point within `HOLE_AROUND_M`. [rad]
    n_near
        Number of points within `SPARSE_M`.
    """

    place: FloatArray
    xyz: FloatArray
    floor: FloatArray
    widest_hole_rad: float
    widest_gap_rad: float
    n_near: int

    @classmethod
    def of(cls, xyz: FloatArray, place: FloatArray) -> SearchArea:
        """Return the search area about a place (2,) among points (n, 3) [m, local], to `HOLE_AROUND_M` and more."""
        place = np.asarray(place, dtype=np.float64)
        east, north = xyz[:, 0] - place[0], xyz[:, 1] - place[1]
        distance, angle = np.hypot(east, north), np.arctan2(north, east)
        inside = distance <= RADIUS_M
        return cls(
            place=place,
            xyz=xyz[inside],
            floor=lowest_plane(xyz[inside], place),
            widest_hole_rad=_widest(angle[inside]),
            widest_gap_rad=_widest(angle[distance <= HOLE_AROUND_M]),
            n_near=int((distance <= SPARSE_M).sum()),
        )

    def above_m(self) -> FloatArray:
        """Return the heights of the points above the floor, (n,) [m]."""
        east, north = (self.xyz[:, :2] - self.place).T
        return np.asarray(self.xyz[:, 2] - (self.floor[0] + self.floor[1] * east + self.floor[2] * north))

    def lost_data(self) -> NoLineReason | None:
        """Return the failure if data are missing here, or None."""
        if self.widest_hole_rad < HOLE_RAD:
            return None
        if self.widest_gap_rad >= EDGE_RAD:
            return NoLineReason.OFF_THE_EDGE
        return NoLineReason.TOO_FEW_POINTS if 0 < self.n_near < LEAST_AREA_POINTS else NoLineReason.HOLES

    def is_level(self) -> bool:
        """Return whether the floor is as level as a road; walls, banks and the sides of cars are not."""
        return bool(np.hypot(self.floor[1], self.floor[2]) <= MAX_GRADE)


def lowest_plane(xyz: FloatArray, place: FloatArray) -> FloatArray:
    """Return the plane through the lowest of points (n, 3): height at a place (2,) and slopes, (3,); NaN if n < 3.

    By asymmetric least squares: points above the plane weigh a hundred times less than points below it, so that it
    lies on the road and not on the kerb beside it; strays far below weigh little. Points higher than kerbs and slopes
    reach in a disc are left out from the start: cars and walls.
    """
    if len(xyz) < 3:
        return np.full(3, np.nan)
    low = float(np.sort(xyz[:, 2])[len(xyz) // _POINTS_PER_STRAY])
    xyz = xyz[np.abs(xyz[:, 2] - low) <= HIGHEST_IN_DISC_M]
    design = np.column_stack([np.ones(len(xyz)), xyz[:, :2] - place])
    z = xyz[:, 2] - low
    weight, plane = np.ones(len(xyz)), np.zeros(3)
    for _ in range(_N_ROUNDS):
        plane = np.linalg.lstsq(design * np.sqrt(weight)[:, None], z * np.sqrt(weight), rcond=None)[0]
        above = z - design @ plane
        weight = np.where(
            above > FLOOR_THICKNESS_M,
            _ABOVE_WEIGHT,
            np.minimum(1.0, (FLOOR_THICKNESS_M / np.maximum(-above, FLOOR_THICKNESS_M)) ** 2),
        )
    plane[0] += low
    return np.asarray(plane)


def _widest(angle: FloatArray) -> float:
    """Return the widest angle [rad] between neighbouring directions (n,) [rad], all around."""
    if len(angle) == 0:
        return 2.0 * np.pi
    turned = np.sort(angle)
    return float(np.diff(np.append(turned, turned[0] + 2.0 * np.pi)).max())
