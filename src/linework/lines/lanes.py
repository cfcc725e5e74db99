"""Lanes between lines: what was measured of them, and which continue which."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray, FloatArray, distance_along
from linework.lines.lane_evidence import SINGLE_LANE_M, unsettled_at_m
from linework.lines.lane_sections import LaneRoad, LaneSection, lane_roads
from linework.lines.names import with_ids
from linework.model.lines import LineSet

#: Two lines that meet turn less than this. [cosine of 5 degrees]
_MEETING_COSINE = 0.9962
#: Standard deviations within which two ends are one place.
_MEETING_SIGMAS = 3.0
#: What an edge line that was not found lies inside the end of the carriageway: about 0.3 m, as edge strips of country roads
#: are 0.25 to 0.5 m wide (German RAL 2012). Whether there is one is even odds: as a deviation it is 0.3 m times the root of a
#: half, and as much less sure is where the lane ends. [m, factor]
_UNFOUND_EDGE_SIGMA_M, _UNFOUND_EDGE_CONFIDENCE = 0.21, 0.5
#: So of two lines beside each other, of which one is older paint: each of them may be the bound.
_UNSETTLED_SIGMA, _UNSETTLED_CONFIDENCE = 0.71, 0.5


@dataclass(frozen=True, slots=True)
class Lanes:
    """Lanes between two lines each.

    Parameters
    ----------
    centre
        Their centrelines, of the kind "lane", every metre; heights are the mean of both bounds. Their ids follow from
        the place, their confidences are those of both bounds and the share that was measured, half of it where a lane
        ends at the edge of a carriageway whose other side has an edge line, or at a line with older paint beside it.
    left_id, right_id
        (m,) str: ids of the lines to the left and right of the centreline's direction.
    width_m, width_min_m, width_max_m, sigma_width_m
        (m,) mean, least and largest width of the stations, and standard deviation of the mean; it
        includes an edge line that may be there and was not found, and older paint that may be newer. [m]
    measured_share
        (m,) share of the stations at which both bounds were measured.
    next_id
        (m,) str: the lane that continues this one in the direction of its centreline; "" where none was measured.
    right_xyz, left_xyz
        (n, 3) bounds at the vertices of the centrelines. [m, world]
    """

    centre: LineSet
    left_id: AnyArray
    right_id: AnyArray
    width_m: FloatArray
    width_min_m: FloatArray
    width_max_m: FloatArray
    sigma_width_m: FloatArray
    measured_share: FloatArray
    next_id: AnyArray
    right_xyz: FloatArray
    left_xyz: FloatArray

    def __len__(self) -> int:
        return len(self.centre)


class _Piece(NamedTuple):
    """A lane in consecutive sections of a road, between the same two lines: (section, space) each."""

    road: LaneRoad
    spaces: tuple[tuple[LaneSection, int], ...]

    @property
    def bounds(self) -> tuple[int, int]:
        section, j = self.spaces[0]
        return section.bounds[j], section.bounds[j + 1]

    @property
    def may_lack_edge_line(self) -> bool:
        return self.bounds in self.road.without_edge_line

    @property
    def unsettled_m(self) -> float:
        """Largest distance of the bounds from what may bound the lane in their place, both together [m]."""
        right, left = (
            max(unsettled_at_m(self.road.unsettled.get(line, ()), at) for at in self._along_m(side))
            for side, line in enumerate(self.bounds)
        )
        return float(np.hypot(right, left))

    def _along_m(self, side: int) -> list[float]:
        return [at for section, j in self.spaces for at in section.along_m[:, j + side].tolist()]


def find_lanes(lines: LineSet, *, widths_m: tuple[float, float] = SINGLE_LANE_M) -> Lanes:
    """Return the lanes that follow from lines alone.

    A lane is between two neighbouring lines at least one of which is paint, at stations every metre: nothing lies
    between, at least one of both was measured or keeps its distance from another line that was, and the width is within
    limits. Lanes end where one of both lines ends
    or another takes its place; there are none across the mouths of junctions, and none has a direction of travel.

    Parameters
    ----------
    widths_m
        Least and largest width. [m]

    Examples
    --------
    >>> x = np.linspace(0.0, 50.0, 51)
    >>> rows = [np.column_stack([x, np.full(51, y), np.zeros(51)]) for y in (0.0, 3.5, 7.0)]
    >>> lanes = find_lanes(LineSet.from_lines(rows, kind=["lane_marking"] * 3, id=["a", "b", "c"]))
    >>> lanes.width_m.round(3).tolist(), sorted(lanes.left_id.tolist()), lanes.centre.length_m.round(6).tolist()
    ([3.5, 3.5], ['b', 'c'], [50.0, 50.0])
    """
    named = with_ids(lines, ())
    # Of equal lines the first one counts: by name, whatever their order
    named = named.take(np.argsort(named.id.astype(str), kind="stable"))
    pieces = [piece for road in lane_roads(named, widths_m=widths_m) for piece in _pieces(road)]
    return _lanes(named, pieces)


def _pieces(road: LaneRoad) -> Iterator[_Piece]:
    """Yield the lanes of a road from its first section to its last."""
    growing: dict[tuple[int, int], list[tuple[LaneSection, int]]] = {}
    for section in road.sections:
        there: dict[tuple[int, int], list[tuple[LaneSection, int]]] = {}
        for j, pair in enumerate(pairwise(section.bounds)):
            if section.is_lane[j]:
                there[pair] = [*growing.pop(pair, []), (section, j)]
        yield from (_Piece(road, tuple(spaces)) for spaces in growing.values())
        growing = there
    yield from (_Piece(road, tuple(spaces)) for spaces in growing.values())


def _lanes(lines: LineSet, pieces: Sequence[_Piece]) -> Lanes:
    rights, lefts, shares, columns = [], [], [], []
    for piece in pieces:
        right, left, width, sigma, is_measured = _stations(piece)
        rights.append(right)
        lefts.append(left)
        shares.append(float(is_measured.mean()))
        columns.append((width.mean(), width.min(), width.max(), float(np.sqrt((sigma**2).mean()))))
    is_vague = np.array([piece.may_lack_edge_line for piece in pieces], dtype=bool)
    numbers = np.array([piece.bounds for piece in pieces], dtype=np.int64).reshape(-1, 2)
    table = np.array(columns, dtype=np.float64).reshape(-1, 4)
    share = np.array(shares, dtype=np.float64)
    right_xyz, left_xyz = (np.concatenate(x) if x else np.zeros((0, 3)) for x in (rights, lefts))
    sure = lines.confidence[numbers[:, 0]] * lines.confidence[numbers[:, 1]] * (0.5 + 0.5 * share)
    sure = np.where(is_vague, _UNFOUND_EDGE_CONFIDENCE * sure, sure)
    unsettled_m = np.array([piece.unsettled_m for piece in pieces], dtype=np.float64)
    sure = np.where(unsettled_m > 0.0, _UNSETTLED_CONFIDENCE * sure, sure)
    centre = LineSet.from_lines(
        [(a + b) / 2 for a, b in zip(rights, lefts, strict=True)], crs=lines.crs, kind=["lane"] * len(pieces),
        confidence=np.round(sure, 4), width_m=table[:, 0],
    )  # fmt: skip
    centre = with_ids(centre, ())
    mean, least, most, sigma_width = table.T
    sigma_width = np.where(is_vague, np.hypot(sigma_width, _UNFOUND_EDGE_SIGMA_M), sigma_width)
    sigma_width = np.hypot(sigma_width, _UNSETTLED_SIGMA * unsettled_m)
    return Lanes(
        centre, left_id=lines.id[numbers[:, 1]], right_id=lines.id[numbers[:, 0]], width_m=mean, width_min_m=least,
        width_max_m=most, sigma_width_m=sigma_width, measured_share=share,
        next_id=_next_ids(lines, pieces, centre.id), right_xyz=right_xyz, left_xyz=left_xyz,
    )  # fmt: skip


def _stations(piece: _Piece) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, AnyArray]:
    """Return bounds (n, 3) to the right and left, widths and their sigmas (n,), and where both bounds were measured."""
    rows: dict[int, tuple[LaneSection, int, int]] = {}
    for section, j in piece.spaces:
        rows |= {section.first + k: (section, j, k) for k in range(section.last - section.first + 1)}
    at = np.array(sorted(rows))
    values = {
        name: np.array([getattr(s, name)[k, j : j + 2] for s, j, k in (rows[i] for i in at.tolist())])
        for name in ("offset_m", "up_m", "sigma_m", "bridged")
    }
    station = piece.road.station_m[at]
    xy, ahead = piece.road.curve.places(station), piece.road.curve.ahead(station)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    sides = [np.column_stack([xy + values["offset_m"][:, [b]] * left, values["up_m"][:, b]]) for b in (0, 1)]
    width = values["offset_m"][:, 1] - values["offset_m"][:, 0]
    is_measured = np.asarray(~values["bridged"].any(axis=1))
    return sides[0], sides[1], width, np.hypot(*values["sigma_m"].T), is_measured


def _next_ids(lines: LineSet, pieces: Sequence[_Piece], ids: AnyArray) -> AnyArray:
    """Return the id of the lane that begins where each ends, "" where none does: both bounds continue or meet."""
    found = np.full(len(pieces), "", dtype=object)
    for i, a in enumerate(pieces):
        for j, b in enumerate(pieces):
            if i == j or a.road is not b.road or b.spaces[0][0].first - a.spaces[-1][0].last not in (0, 1):
                continue
            if all(x == y or _meet(lines, x, y) for x, y in zip(a.bounds, b.bounds, strict=True)):
                found[i] = str(ids[j])
    return np.array(found.tolist(), dtype=np.str_)


def _meet(lines: LineSet, a: int, b: int) -> bool:
    """Return whether an end of one line is an end of another, within their deviations, in the same direction."""
    for u, su in _ends(lines, a):
        for v, sv in _ends(lines, b):
            near = _MEETING_SIGMAS * float(np.hypot(su, sv))
            # An end and a start have opposite outward directions
            if np.hypot(*(u[0] - v[0])[:2]) <= near and float(-(u[1] @ v[1])) >= _MEETING_COSINE:
                return True
    return False


def _ends(lines: LineSet, i: int) -> list[tuple[tuple[FloatArray, FloatArray], float]]:
    """Return both ends of a line with their outward directions over a metre, and their standard deviations [m]."""
    xyz, sigma = lines[i].xyz, lines[i].sigma_xy_m
    found = []
    for order in (slice(None), slice(None, None, -1)):
        own = xyz[order]
        along = distance_along(own[:, :2], in_space=True)
        inside = np.array([np.interp(min(1.0, along[-1]), along, c) for c in own[:, :2].T])
        way = own[0, :2] - inside
        found.append(((own[0], way / max(float(np.hypot(*way)), 1e-9)), float(sigma[order][0])))
    return found
