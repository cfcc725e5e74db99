"""New lines: parallel to another line, a wire through three places, or a bridge across a gap."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.editing.edits.attributes import check_line_kind
from linework.editing.edits.vertices import line_of_vertices
from linework.errors import UsageError
from linework.model.lines import LineSet

#: Largest offset between lines of one road. [m]
FARTHEST_BESIDE_M = 30.0


def line_beside(line: LineSet, kind: str, at: FloatArray) -> LineSet:
    """Return a new line of a kind, parallel to a line.

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
        A vertex every `NEW_LINE_STATION_M` at most, in the direction of the line; as high as the line, until heights are known.

    Raises
    ------
    UsageError
        A place is farther than `FARTHEST_BESIDE_M` from the line, or both are beside one place of it.
    """
    check_line_kind(kind)
    xyz = line.xyz
    along = distance_along(xyz)
    feet = np.sort(np.array([foot_along(xyz, along, place) for place in at]))
    places = at[np.argsort([foot_along(xyz, along, place) for place in at], kind="stable")]
    first, last = (0.0, float(along[-1])) if len(at) == 1 else (float(feet[0]), float(feet[1]))
    if last - first < NEW_LINE_STATION_M:
        raise UsageError(
            f"the parallel line would be {last - first:.1f} m long", where="beside",
            advice="choose two places farther apart",
        )  # fmt: skip
    foot, left = places_on(xyz, along, np.append(feet, last))
    off = np.sum((places - foot[:-1, :2]) * left[:-1], axis=1)
    if float(np.abs(off).max()) > FARTHEST_BESIDE_M:
        raise UsageError(
            f"the place is {np.abs(off).max():.0f} m from the line; at most {FARTHEST_BESIDE_M:.0f} m", where="beside",
            advice="choose a line on the same road",
        )  # fmt: skip
    stations = np.linspace(first, last, int(np.ceil((last - first) / NEW_LINE_STATION_M)) + 1)
    copy, left = places_on(xyz, along, stations)
    copy[:, :2] += np.interp(stations, feet, off)[:, None] * left
    return LineSet.from_lines([copy], crs=line.crs, kind=[kind], method=["drawn"])


def places_beside(line: LineSet, kind: str, at: FloatArray) -> FloatArray:
    """Return the places (k, 3) where the height of a line beside another is measured [m, world].

    Parameters
    ----------
    line, kind, at
        As of `line_beside`.

    Returns
    -------
    FloatArray
        With the height of the line where it tells which of several wires is meant; NaN otherwise. A rail stands 0.7 m
        above the boundary that it is put beside, and roads tilt: near the height of the other line was no rail, and of one
        of 57 m that the points show from end to end 43 m were left, of another of 67 m 2 m.
    """
    places = line_beside(line, kind, at).xyz.copy()
    if not (kind == "cable" and str(line.kind[0]) == kind):
        places[:, 2] = np.nan
    return places


def with_heights(line: LineSet, heights: FloatArray) -> LineSet:
    """Return a line with measured heights.

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
    return line_of_vertices(placed, inside)


# A wire through three places

#: Distance between vertices: chords of the slackest wire (a = 50 m) stay within 1 cm of it. [m]
NEW_LINE_STATION_M = 2.0
#: Longest span along a street. [m]
LONGEST_SPAN_M = 300.0
#: Tolerance of the middle place from the plane of the wire, wind and clicks included. [m]
WIRE_ASIDE_M = 1.0


def wire_through(xyz: FloatArray, crs: str) -> LineSet:
    """Return the cable through three places, a catenary.

    Parameters
    ----------
    xyz
        (3, 3): both ends, and a place between; in any order. [m, world]

    Returns
    -------
    LineSet
        From the first end to the other, in the vertical plane of both: a catenary, or straight where the place between
        lies above the chord.

    Raises
    ------
    UsageError
        The places are not those of one span.
    """
    from linework.lines.catenary import fit_catenary  # 70 MB of numba, and few edits hang a wire

    order = np.argsort((xyz[:, :2] - xyz[0, :2]) @ _widest(xyz), kind="stable")
    start, middle, end = xyz[order]
    way = end[:2] - start[:2]
    span_m = float(np.hypot(*way))
    if not 1.0 <= span_m <= LONGEST_SPAN_M:
        raise UsageError(
            f"a span of {span_m:.0f} m",
            where="wire",
            advice=f"1 to {LONGEST_SPAN_M:.0f} m; click from pole to pole",
        )
    way = way / span_m
    step = middle[:2] - start[:2]
    aside_m, at_m = float(abs(way[0] * step[1] - way[1] * step[0])), float(step @ way)
    if aside_m > WIRE_ASIDE_M or not 0.05 * span_m < at_m < 0.95 * span_m:
        raise UsageError(
            "the three places are not on one span", where="wire",
            advice="click both ends and a place well between them",
        )  # fmt: skip
    known, heights = np.array([0.0, at_m, span_m]), np.array([start[2], middle[2], end[2]])
    hangs = middle[2] < start[2] + at_m / span_m * (end[2] - start[2])
    curve = fit_catenary(known, heights, straight=not hangs).curve
    at = np.linspace(0.0, span_m, int(np.ceil(span_m / NEW_LINE_STATION_M)) + 1)
    places = np.column_stack([start[:2] + at[:, None] * way, curve.height_at(at)])
    return LineSet.from_lines([places], crs=crs, kind=["cable"], method=["drawn"])


def _widest(xyz: FloatArray) -> FloatArray:
    """Return the direction (2,) of the two places that are farthest apart."""
    pairs = [(0, 1), (0, 2), (1, 2)]
    i, k = max(pairs, key=lambda pair: float(np.hypot(*(xyz[pair[1], :2] - xyz[pair[0], :2]))))
    return np.asarray(xyz[k, :2] - xyz[i, :2])


# Bridging a gap: parallel to a neighbouring line that continues there, else by the directions of both ends

#: Largest offset of a neighbouring line of the same road. [m]
LINES_BESIDE_M = 15.0
#: A neighbour is parallel if the offset changes by at most this [m] plus this share of the gap [1].
BRIDGE_DRIFT_M, BRIDGE_DRIFT_SHARE = 0.20, 0.01
#: Length over which a line's direction is taken. [m]
_OVER_M = 5.0
#: Kinds that run along the road.
_ALONG = ("lane_marking", "road_boundary", "guardrail", "barrier")


def bridge_gap(head: FloatArray, tail: FloatArray, others: LineSet) -> FloatArray:
    """Return the places (k, 3) that bridge the gap from the last vertex of a line to the first of the next.

    Parameters
    ----------
    head, tail
        (n, 3) of the two lines, in one direction.
    others
        Lines of the same road: the one whose distance changes least from end to end is followed, since the lines of
        a road run beside one another. Without one, a curve of evenly changing direction leads from end to end.
    """
    gap_m = float(np.hypot(*(tail[0, :2] - head[-1, :2])))
    if gap_m < 1.5 * NEW_LINE_STATION_M:
        return np.zeros((0, 3))
    beside = [
        found
        for i in np.flatnonzero(np.isin(others.kind, _ALONG)).tolist()
        if (found := _beside(others[i].xyz, head[-1], tail[0], gap_m)) is not None
    ]
    if beside:
        return min(beside, key=lambda one: one[0])[1]
    return _curve(head, tail, gap_m)


def _beside(
    line: FloatArray, start: FloatArray, end: FloatArray, gap_m: float
) -> tuple[float, FloatArray] | None:
    """Return the change of offset to a neighbour over the gap, and the places parallel to it; None if it is absent."""
    low, high = line[:, :2].min(axis=0) - LINES_BESIDE_M, line[:, :2].max(axis=0) + LINES_BESIDE_M
    if any(np.any(place[:2] < low) or np.any(place[:2] > high) for place in (start, end)):
        return None
    along = distance_along(line)
    a, b = (foot_along(line, along, place) for place in (start, end))
    if not (min(a, b) > 0.0 and max(a, b) < along[-1] and 0.7 * gap_m <= abs(b - a) <= 1.5 * gap_m):
        return None
    at = np.linspace(a, b, max(int(abs(b - a) / NEW_LINE_STATION_M), 2) + 1)
    foot, left = places_on(line, along, at)
    off = [float((place[:2] - foot[k, :2]) @ left[k]) for k, place in ((0, start), (-1, end))]
    drift = abs(off[1] - off[0])
    if max(abs(v) for v in off) > LINES_BESIDE_M or drift > BRIDGE_DRIFT_M + BRIDGE_DRIFT_SHARE * gap_m:
        return None
    share = np.linspace(0.0, 1.0, len(at))
    # The remaining offsets at both ends (across, along, up) are interpolated linearly
    places = foot.copy()
    places[:, :2] += (off[0] + share * (off[1] - off[0]))[:, None] * left
    rest = np.stack([start - places[0], end - places[-1]])
    places += (1.0 - share)[:, None] * rest[0] + share[:, None] * rest[1]
    return drift, places[1:-1]


def foot_along(line: FloatArray, along: FloatArray, place: FloatArray) -> float:
    """Return the distance along a line of its point nearest to a place. [m]"""  # noqa: D400
    a, way = line[:-1, :2], np.diff(line[:, :2], axis=0)
    size2 = np.maximum(np.sum(way * way, axis=1), 1e-12)
    share = np.clip(np.sum((place[:2] - a) * way, axis=1) / size2, 0.0, 1.0)
    i = int(np.argmin(np.hypot(*(a + share[:, None] * way - place[:2]).T)))
    return float(along[i] + share[i] * (along[i + 1] - along[i]))


def places_on(line: FloatArray, along: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places (k, 3) on a line, and unit vectors (k, 2) to the left of the direction of `at`."""
    place = np.stack([np.interp(at, along, column) for column in line.T], axis=1)
    sign = 1.0 if at[-1] >= at[0] else -1.0
    half = 0.5 * _OVER_M
    ends = [np.stack([np.interp(at + d, along, c) for c in line[:, :2].T], axis=1) for d in (-half, half)]
    way = sign * (ends[1] - ends[0])
    way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    return place, np.stack([-way[:, 1], way[:, 0]], axis=1)


def _curve(head: FloatArray, tail: FloatArray, gap_m: float) -> FloatArray:
    """Return places on the cubic Hermite curve from one line to the other, tangent to both."""
    n = int(np.ceil(gap_m / NEW_LINE_STATION_M))
    t = (np.arange(1, n) / n)[:, None]
    start, end = head[-1], tail[0]
    out = gap_m * _way(head[::-1]) * -1.0
    into = gap_m * _way(tail)
    place = (2 * t**3 - 3 * t**2 + 1) * start + (3 * t**2 - 2 * t**3) * end
    place[:, :2] += (t**3 - 2 * t**2 + t) * out + (t**3 - t**2) * into
    return np.asarray(place)


def _way(xyz: FloatArray) -> FloatArray:
    """Return the direction (2,) of a line's first metres."""
    away = np.hypot(*(xyz[:, :2] - xyz[0, :2]).T)
    inner = int(np.argmax(away >= min(_OVER_M, float(away.max()))))
    return np.asarray((xyz[inner, :2] - xyz[0, :2]) / max(float(away[inner]), 1e-9))
