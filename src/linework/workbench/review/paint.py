"""Requests to a worker for the paint along lines: its brightness, and the dashes that it shows.

Separate from `suspects`, because edits ask the worker for the dashes of single lines, too.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, distance_along
from linework.editing.edits.dashes import dashes_in_paint
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

#: Distance between stations along a line. [m]
BRIGHTNESS_STATION_M = 0.1
#: Smallest half width of a stripe, and the half width of one whose width is not known. [m]
LEAST_HALF_M = 0.06
#: Points within this height of the road lie on it: noise and texture of asphalt. [m]
_ON_ROAD_M = 0.10
#: Brightest paint, relative to asphalt; brighter points are reflectors and count as this.
_BRIGHTEST = 6.0
#: Stations that are measured together: 32 m, so that few patches of points are held at once.
_PIECE = 320
#: Intensity of asphalt in patches, see `linework.workbench.views.patches`.
_ASPHALT = 1000.0
#: Length of lines measured in one request, which takes half a second. [m]
MOST_NEW_M = 2000.0


def brightness_along(
    session: SurveySession, xyz: FloatArray, width_m: float
) -> tuple[FloatArray, FloatArray]:
    """Return the mean brightness of the points at stations along a line, and their number.

    Parameters
    ----------
    xyz
        (n, 3) vertices of the line. [m, world]
    width_m
        Of its stripe; NaN: not known. [m]

    Returns
    -------
    brightness, weight
        (k,) every `BRIGHTNESS_STATION_M`: relative to asphalt, 0 without points; number of points.
    """
    half_m = float(np.fmax(0.5 * width_m, LEAST_HALF_M))
    along = distance_along(xyz)
    at = (np.arange(max(int(along[-1] / BRIGHTNESS_STATION_M), 1)) + 0.5) * BRIGHTNESS_STATION_M
    places = np.stack([np.interp(at, along, column) for column in xyz[:, :2].T], axis=1)
    total, count = np.zeros(len(at)), np.zeros(len(at))
    reader = patch_reader(session)
    if reader is not None:
        for piece in (slice(k, k + _PIECE) for k in range(0, len(at), _PIECE)):
            total[piece], count[piece] = _along_piece(reader, places[piece], half_m)
    return np.where(count > 0.0, total / np.maximum(count, 1.0), 0.0), count


def _along_piece(reader: PatchReader, places: FloatArray, half_m: float) -> tuple[FloatArray, FloatArray]:
    """Return (k,) sums of brightness and numbers of points at (k, 2) places."""
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
            distance_upper_bound=float(np.hypot(half_m, 0.5 * BRIGHTNESS_STATION_M)),
        )
        on = np.isfinite(distance)
        bright = np.minimum(patch.intensity[chosen[on]] / _ASPHALT, _BRIGHTEST)
        total += np.bincount(k[on], weights=bright, minlength=len(places))
        count += np.bincount(k[on], minlength=len(places))
    return total, count


def dash_spans(session: SurveySession, xyz: FloatArray, width_m: float) -> FloatArray:
    """Return where along a line (n, 3) [m, world] the paint shows dashes: (k, 2) [m], see `dashes_in_paint`."""
    return dashes_in_paint(BRIGHTNESS_STATION_M, *brightness_along(session, xyz, width_m))


class PaintOfLines:
    """Dashes that the paint along markings shows, measured once for each shape of a line."""

    def __init__(self) -> None:
        self._spans: dict[int, FloatArray] = {}

    def of(self, session: SurveySession, lines: LineSet) -> dict[str, FloatArray]:
        """Return (k, 2) spans of dashes along lines [m] by id, of those markings not rejected that are measured.

        Each call measures `MOST_NEW_M` more at most, because pictures wait meanwhile.
        """
        found, new_m, length_m = {}, 0.0, lines.length_m
        for i in np.flatnonzero((lines.kind == "lane_marking") & (lines.review != "rejected")).tolist():
            xyz = lines[i].xyz
            shape = hash(xyz.tobytes())
            if shape not in self._spans and new_m < MOST_NEW_M:
                new_m += float(length_m[i])
                self._spans[shape] = dash_spans(session, xyz, float(lines.width_m[i]))
            if shape in self._spans:
                found[str(lines.id[i])] = self._spans[shape]
        return found
