"""A work of the desk of pictures: how bright the points along a line are."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray
from linework.lines.paint_rhythm import dashes_in_paint
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.workbench.pictures import patch_reader
from linework.workbench.table import Table
from linework.workbench.tiles_points import PatchReader

#: Stations along a line. [m]
STEP_M = 0.1
#: Points this near to a line are on it: a stripe's half width, or the least where it is not known. [m]
LEAST_HALF_M = 0.06
#: Points this near to the road lie on it. [m]
_ON_ROAD_M = 0.10
#: Brighter than this many times asphalt is no paint, but a reflector.
_BRIGHTEST = 6.0
_PIECE = 320
#: Measuring so much takes half a second. [m]
MOST_NEW_M = 2000.0


def paint_along(table: Table, xyz: FloatArray, width_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the mean brightness (asphalt: 1) of the points at stations along a line, and how many they are.

    Parameters
    ----------
    xyz
        (n, 3) the line. [m, world]
    width_m
        Of its stripe; NaN: not known.

    Returns
    -------
    brightness, weight
        (k,) every `STEP_M`; brightness 0 where weight is.
    """
    half_m = float(np.fmax(0.5 * width_m, LEAST_HALF_M))
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    at = (np.arange(max(int(along[-1] / STEP_M), 1)) + 0.5) * STEP_M
    places = np.stack([np.interp(at, along, column) for column in xyz[:, :2].T], axis=1)
    total, count = np.zeros(len(at)), np.zeros(len(at))
    reader = patch_reader(table)
    if reader is not None:
        for piece in (slice(k, k + _PIECE) for k in range(0, len(at), _PIECE)):
            total[piece], count[piece] = _along_piece(reader, places[piece], half_m)
    return np.where(count > 0.0, total / np.maximum(count, 1.0), 0.0), count


def _along_piece(reader: PatchReader, places: FloatArray, half_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the sum of brightness and the number of points at places."""
    bounds = Bounds(*places.min(axis=0), *places.max(axis=0)).grown(half_m)
    tree = cKDTree(places - places[0])
    total, count = np.zeros(len(places)), np.zeros(len(places))
    for patch in reader.patches(bounds):
        east, north = patch.x + (patch.corner[0] - places[0, 0]), patch.y + (patch.corner[1] - places[0, 1])
        low, high = np.array(bounds[:2]) - places[0], np.array(bounds[2:]) - places[0]
        near = (east >= low[0]) & (east <= high[0]) & (north >= low[1]) & (north <= high[1])
        near &= ~(np.abs(patch.above) > _ON_ROAD_M)
        chosen = np.flatnonzero(near)
        distance, k = tree.query(
            np.stack([east[chosen], north[chosen]], axis=1),
            distance_upper_bound=float(np.hypot(half_m, 0.5 * STEP_M)),
        )
        on = np.isfinite(distance)
        bright = np.minimum(patch.intensity[chosen[on]] / 1000.0, _BRIGHTEST)
        total += np.bincount(k[on], weights=bright, minlength=len(places))
        count += np.bincount(k[on], minlength=len(places))
    return total, count


def dash_spans(table: Table, xyz: FloatArray, width_m: float) -> FloatArray:
    """Return where along a line (n, 3) the paint shows dashes, as `dashes_in_paint` does."""
    return dashes_in_paint(STEP_M, *paint_along(table, xyz, width_m))


class PaintOfLines:
    """Where the paint along the markings of a drawing shows dashes, measured once for each shape of a line."""

    def __init__(self) -> None:
        self._spans: dict[int, FloatArray] = {}

    def of(self, table: Table, lines: LineSet) -> dict[str, FloatArray]:
        """Return it by id, of markings that nobody rejected, as far as is known now.

        Each time some more is measured, `MOST_NEW_M` at most: pictures wait meanwhile.
        """
        found, new_m, length_m = {}, 0.0, lines.length_m
        for i in np.flatnonzero((lines.kind == "lane_marking") & (lines.review != "rejected")).tolist():
            xyz = lines.line(i)
            shape = hash(xyz.tobytes())
            if shape not in self._spans and new_m < MOST_NEW_M:
                new_m += float(length_m[i])
                self._spans[shape] = dash_spans(table, xyz, float(lines.width_m[i]))
            if shape in self._spans:
                found[str(lines.id[i])] = self._spans[shape]
        return found
