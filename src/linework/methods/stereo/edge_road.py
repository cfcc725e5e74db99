"""Where the ray of a picked pixel meets the road; how high the cameras are above it is not known beforehand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.methods.stereo.road_plane import HEIGHT_M, RoadShape, find_road
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair

#: Nothing farther away can be picked: a pixel there covers metres of the road. [m]
FARTHEST_M = 60.0


@dataclass(frozen=True, slots=True)
class PairRoad:
    """The road of one pair: as its images show it, or the plane of the vehicle frame where they show none.

    Parameters
    ----------
    up_vehicle
        (3,) its normal.
    """

    rig: RectifiedRig
    shape: RoadShape | None
    up_vehicle: FloatArray

    def under(self, side: int, col: float, row: float) -> FloatArray | None:
        """Return (3,) the place [m, vehicle] where a pixel of the left (0) or right (1) image shows the road.

        None above the horizon, and too far away to be picked.
        """
        rig = self.rig
        left = float(col)
        # A pixel of the right image is a disparity to the left of the left one's: found in a few rounds
        for _ in range(1 + 8 * side):
            d = self._disparity(left, row)
            if d < rig.focal_px * rig.base_m / FARTHEST_M:
                return None
            left = col + d * side
        return np.asarray(rig.intersect(np.array([left]), np.array([row]), np.array([d]))[0])

    def _disparity(self, col: float, row: float) -> float:
        rig = self.rig
        if self.shape is not None:
            return float(self.shape.disparity(rig, np.array([col]), np.array([row]))[0])
        ray = rig.R_vehicle_camera @ np.array(
            [(col - rig.cx) / rig.focal_px, (row - rig.cy) / rig.focal_px, 1.0]
        )
        return float(-ray[2] / rig.position_m[2] * rig.focal_px * rig.base_m)


def road_in(pair: RectifiedPair) -> PairRoad:
    """Return the road of a pair.

    Raises
    ------
    InputError
        Its images show none, and the calibration does not say how high the cameras are.
    """
    rig, shape = pair.rig, find_road(pair)
    if shape is not None:
        return PairRoad(rig, shape, rig.R_vehicle_camera @ shape.plane.up(rig))
    if not HEIGHT_M[0] <= rig.position_m[2] <= HEIGHT_M[1]:
        raise InputError(
            "the pair does not show a road", where=f"pair {pair.number}", advice="pick in another"
        )
    return PairRoad(rig, None, np.array([0.0, 0.0, 1.0]))
