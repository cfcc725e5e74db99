"""A new line beside one that is there: the lines of a road run side by side."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.errors import UsageError
from linework.lines.edited import part_of
from linework.lines.edited_bridge import STATION_M, foot_along, places_on
from linework.lines.edited_words import check_kind
from linework.model.lines import LineSet

#: Lines farther apart are not of one road. [m]
FARTHEST_M = 30.0


def beside(line: LineSet, kind: str, at: FloatArray) -> LineSet:
    """Return a new line of a kind beside a line.

    Parameters
    ----------
    line
        A single line.
    at
        (1, 2): a place it runs through, at the same distance all along the line. (2, 2): it runs from the first place to
        the second, and its distance goes over evenly from that of the one to that of the other. [m, world]

    Returns
    -------
    LineSet
        A vertex every `STATION_M` at most, in the direction of the line; as high as the line, until heights are known.

    Raises
    ------
    UsageError
        A place is farther than `FARTHEST_M` from the line, or both are beside one place of it.
    """
    check_kind(kind)
    xyz = line.xyz
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    feet = np.sort(np.array([foot_along(xyz, along, place) for place in at]))
    places = at[np.argsort([foot_along(xyz, along, place) for place in at], kind="stable")]
    first, last = (0.0, float(along[-1])) if len(at) == 1 else (float(feet[0]), float(feet[1]))
    if last - first < STATION_M:
        raise UsageError(
            f"the line beside it would be {last - first:.1f} m long", where="beside",
            advice="choose two places farther apart",
        )  # fmt: skip
    foot, left = places_on(xyz, along, np.append(feet, last))
    off = np.sum((places - foot[:-1, :2]) * left[:-1], axis=1)
    if float(np.abs(off).max()) > FARTHEST_M:
        raise UsageError(
            f"the place is {np.abs(off).max():.0f} m beside the line, {FARTHEST_M:.0f} m at most", where="beside",
            advice="choose a line of the same road",
        )  # fmt: skip
    stations = np.linspace(first, last, int(np.ceil((last - first) / STATION_M)) + 1)
    copy, left = places_on(xyz, along, stations)
    copy[:, :2] += np.interp(stations, feet, off)[:, None] * left
    return LineSet.from_lines([copy], crs=line.crs, kind=[kind], method=["drawn"])


def with_heights(line: LineSet, heights: FloatArray) -> LineSet:
    """Return a line at measured heights.

    Parameters
    ----------
    line
        A single line; as high as it is where nothing was measured at all.
    heights
        (n, 2) height and its sigma [m] at each vertex, NaN where nothing was measured; or of no places.

    Returns
    -------
    LineSet
        As far as something was measured; what lies between is bridged.
    """
    known = np.flatnonzero(np.isfinite(heights[:, 0])) if len(heights) else np.zeros(0, dtype=np.int64)
    if len(known) < 2:
        return line
    inside = np.arange(known[0], known[-1] + 1)
    xyz = line.xyz.copy()
    xyz[:, 2] = np.interp(np.arange(len(xyz)), known, heights[known, 0])
    placed = line.with_columns(xyz=xyz, sigma_z_m=heights[:, 1], bridged=~np.isfinite(heights[:, 0]))
    return part_of(placed, inside)
