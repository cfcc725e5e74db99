"""Search areas about a picked place: what is in them, and why tracking cannot begin there (step 2.1).

A search area is a disc of 0.50 m, so that a bend is straight in it; its lowest points are the road. The paper
asks the operator for a place that holds both road and boundary, or road and marking, without lost data, and
shows what goes wrong elsewhere [1]. Here the program says which failure it is, and where the nearest place is
that works.

References
----------
.. [1] W.-S. Kang, K.-H. Lee, J.-H. Lee (2023), figures 2 to 4 and 8, doi:10.3390/rs15194656.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from linework.arrays import FloatArray

#: The paper's radius: in a disc of 1 m a curve is flattened. [m]
RADIUS_M = 0.50
#: The paper's floor: mobile mapping points are good to 2 cm. [m]
FLOOR_THICKNESS_M = 0.02
#: Steeper than any road, crossfall and grade together: the surface's own bound. [m/m]
MAX_GRADE = 0.25
#: In a disc of 0.50 m no road and no kerb reaches higher above its lowest point: 0.25 m each. [m]
HIGHEST_IN_DISC_M = 0.50
#: Data all around, as far as this, makes an empty place a hole: cars and the shadows behind them are shorter. [m]
HOLE_AROUND_M = 8.0
#: An angle without any point that makes a place the edge of the data: less than that of a straight edge, and
#: more than that of a shadow. [rad]
EDGE_RAD = np.radians(140.0)
#: The same in the search area itself: a line that is hidden so far cannot be seen to run through. [rad]
HOLE_RAD = np.radians(120.0)
#: Fewer points within 2 m show no line: of these 60, three lie on one 0.12 m wide. The detectors ask for more.
LEAST_AREA_POINTS, SPARSE_M = 60, 2.0
_N_ROUNDS = 12


class NoLineReason(StrEnum):
    """Why no line begins in a search area."""

    OFF_THE_EDGE = "off the edge of the data"
    HOLES = "a hole in the data"
    TOO_FEW_POINTS = "too few points to show a line"
    NO_ROAD = "no road in the search area"
    ALL_ROAD = "all road, no boundary in the search area"
    NO_MARKING = "no marking in the search area"


@dataclass(frozen=True, slots=True)
class SearchArea:
    """The points within a disc about a place, the floor under them, and what surrounds them.

    Parameters
    ----------
    place
        (2,) float64 [m, from the survey's local origin].
    xyz
        (n, 3) float64 [m, from the same origin]: points in it.
    floor
        (3,) float64: height of the plane through the lowest points at the place [m], its slopes to the east
        and to the north; NaN with fewer than three points.
    widest_hole_rad
        Widest angle of the disc without a point.
    widest_gap_rad
        Widest angle without a point as far as `HOLE_AROUND_M`.
    n_near
        Points within `SPARSE_M`.
    """

    place: FloatArray
    xyz: FloatArray
    floor: FloatArray
    widest_hole_rad: float
    widest_gap_rad: float
    n_near: int

    @classmethod
    def of(cls, xyz: FloatArray, place: FloatArray) -> SearchArea:
        """Look about a place among points (n, 3); those beyond `HOLE_AROUND_M` do not matter."""
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
        """Return (n,) the heights of the points above the floor. [m]"""  # noqa: D400
        east, north = (self.xyz[:, :2] - self.place).T
        return np.asarray(self.xyz[:, 2] - (self.floor[0] + self.floor[1] * east + self.floor[2] * north))

    def lost_data(self) -> NoLineReason | None:
        """Return what is wrong with the data here, or None."""
        if self.widest_hole_rad < HOLE_RAD:
            return None
        if self.widest_gap_rad >= EDGE_RAD:
            return NoLineReason.OFF_THE_EDGE
        return NoLineReason.TOO_FEW_POINTS if 0 < self.n_near < LEAST_AREA_POINTS else NoLineReason.HOLES

    def is_level(self) -> bool:
        """Return whether the floor can be a road: no wall, no bank, no car's side."""
        return bool(np.hypot(self.floor[1], self.floor[2]) <= MAX_GRADE)


def lowest_plane(xyz: FloatArray, place: FloatArray) -> FloatArray:
    """Return the plane through the lowest points: height at the place and slopes, (3,); NaN where too few.

    Points above the plane pull on it a hundred times less than points below it, so that it comes to lie
    on the road and not on the kerb beside it (asymmetric least squares); strays far below hardly pull. What
    stands higher than kerbs and slopes make it in a disc is left out from the start: cars and walls.
    """
    if len(xyz) < 3:
        return np.full(3, np.nan)
    low = float(np.sort(xyz[:, 2])[len(xyz) // 50])
    xyz = xyz[np.abs(xyz[:, 2] - low) <= HIGHEST_IN_DISC_M]
    design = np.column_stack([np.ones(len(xyz)), xyz[:, :2] - place])
    z = xyz[:, 2] - low
    weight, plane = np.ones(len(xyz)), np.zeros(3)
    for _ in range(_N_ROUNDS):
        plane = np.linalg.lstsq(design * np.sqrt(weight)[:, None], z * np.sqrt(weight), rcond=None)[0]
        above = z - design @ plane
        weight = np.where(
            above > FLOOR_THICKNESS_M,
            0.01,
            np.minimum(1.0, (FLOOR_THICKNESS_M / np.maximum(-above, FLOOR_THICKNESS_M)) ** 2),
        )
    plane[0] += low
    return np.asarray(plane)


def _widest(angle: FloatArray) -> float:
    """Return the widest angle between neighbours of directions (n,) all around. [rad]"""  # noqa: D400
    if len(angle) == 0:
        return 2.0 * np.pi
    turned = np.sort(angle)
    return float(np.diff(np.append(turned, turned[0] + 2.0 * np.pi)).max())
