"""The classes of points, and the numbers that they have in LAS files."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from linework.arrays import AnyArray


class PointClass(IntEnum):
    """What a point lies on."""

    OTHER = 0
    ROAD = 1
    FOOTWAY = 2
    VERGE = 3
    MARKING = 4
    KERB = 5
    RAIL = 6
    BARRIER = 7
    WIRE = 8
    POLE = 9
    VEGETATION = 10


#: Number of each class in point formats 6 to 10 and its name in a table of classes, which has room for 15 characters.
#: Up to 63 the numbers are those of the standard (ASPRS LAS 1.4 - R15, table 17), from 64 on they are the user's.
#: Vegetation is not split by its height (3 to 5): the standard gives no limits.
ASPRS_CLASSES: dict[PointClass, tuple[int, str]] = {
    PointClass.OTHER: (1, "Unclassified"),
    PointClass.ROAD: (11, "Road surface"),
    PointClass.FOOTWAY: (64, "Footway"),
    PointClass.VERGE: (2, "Ground"),
    PointClass.MARKING: (65, "Road marking"),
    PointClass.KERB: (66, "Kerb"),
    PointClass.RAIL: (67, "Guardrail"),
    PointClass.BARRIER: (68, "Barrier"),
    PointClass.WIRE: (14, "Wire conductor"),
    PointClass.POLE: (15, "Pole or tower"),
    PointClass.VEGETATION: (5, "Vegetation"),
}
#: Classes of the ground, which point formats 0 to 5 call ground: they have no number for a road (table 9).
GROUND_CLASSES = (
    PointClass.ROAD,
    PointClass.FOOTWAY,
    PointClass.VERGE,
    PointClass.MARKING,
    PointClass.KERB,
)
#: Numbers of ground and of unclassified points in every point format.
_GROUND, _UNCLASSIFIED = 2, 1
#: First point format with a byte for the class.
_WIDE_CLASSES = 6


def asprs_numbers(point_format: int) -> AnyArray:
    """Return the number in a LAS file of each class, (n,) uint8 by `PointClass`.

    Point formats 0 to 5 have five bits for the class, and numbers for ground and vegetation only; what stands on the
    ground is unclassified there.

    >>> asprs_numbers(6)[PointClass.ROAD], asprs_numbers(3)[[PointClass.ROAD, PointClass.WIRE]].tolist()
    (np.uint8(11), [2, 1])
    """
    numbers = np.full(len(PointClass), _UNCLASSIFIED, dtype=np.uint8)
    for kind, (number, _) in ASPRS_CLASSES.items():
        if point_format >= _WIDE_CLASSES or kind is PointClass.VEGETATION:
            numbers[kind] = number
        elif kind in GROUND_CLASSES:
            numbers[kind] = _GROUND
    return numbers
