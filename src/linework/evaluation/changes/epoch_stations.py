"""Stations along the lines of one survey, with the same line in the other.

Separate from `epochs`, which judges what differs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray, distance_along
from linework.lines.crosscuts import Axis, LinesToCut, axis_along, cross_cuts
from linework.model.lines import STACKED_FORM, LineSet

#: Lines of one kind nearer than this are the same line; a kerb that moves further is another one. [m]
SAME_M = 1.5
#: A line of another kind or form is in its place this near, across and in height: dashes are as near to their marking. [m]
_IN_PLACE_M = 0.5
#: A line that turns more than 25 degrees from another is not the same.
_ALONG_COSINE = 0.9
#: A measured line of any kind this near says that the place was visible. [m]
_VISIBLE_M = 10.0
#: A height has changed beyond this many deviations: by chance one line in 370.
_HEIGHT_DEVIATIONS = 3.0
#: Least deviation of a position, where lines state none: the repeatability of good mobile mapping. [m]
_LEAST_SIGMA_M = 0.01


@dataclass(frozen=True, slots=True)
class EpochStations:
    """Stations of all lines of one survey, with the same line in the other.

    Parameters
    ----------
    line, along_m, xyz, left, bridged
        (n,) line and distance along it [m], (n, 3) place [m, world], (n, 2) unit vector to the left, (n,) no measurement.
    partner
        (n,) the line of the same kind in the other survey, -1 where there is none.
    across_m, up_m, sigma_m, partner_bridged
        Its (n,) distance to the left and up [m], (n, 2) their standard deviations by the two lines [m], and whether it was
        measured.
    visible
        (n,) bool: the other survey measured a line near here.
    instead, instead_m
        (n,) where there is no partner: the line of another kind in its place, else -1, and the distance along that. [m]
    """

    line: IntArray
    along_m: FloatArray
    xyz: FloatArray
    left: FloatArray
    bridged: BoolArray
    partner: IntArray
    across_m: FloatArray
    up_m: FloatArray
    sigma_m: FloatArray
    partner_bridged: BoolArray
    visible: BoolArray
    instead: IntArray
    instead_m: FloatArray

    def of_first(self, n: int) -> EpochStations:
        """Return the stations of the first n lines."""
        own = self.line < n
        return EpochStations(*(getattr(self, field.name)[own] for field in fields(self)))

    def recoded_with(self, others: EpochStations) -> EpochStations:
        """Return these stations; a line of another kind is in the place of one only where it has no partner itself."""
        instead = self.instead.copy()
        first = np.searchsorted(others.line, np.arange(int(others.line.max(initial=-1)) + 2))
        for k in np.flatnonzero(instead >= 0).tolist():
            start, end = first[instead[k]], first[instead[k] + 1]
            near = start + int(np.argmin(np.abs(others.along_m[start:end] - self.instead_m[k])))
            if others.partner[near] >= 0:
                instead[k] = -1
        return replace(self, instead=instead)


def height_differs(lines: LineSet, others: LineSet, stations: EpochStations, rows: IntArray) -> BoolArray:
    """Return at which stations (k,), by number, of lines that both surveys have their heights differ by more than chance."""
    before_m, after_m = lines.height_m[stations.line[rows]], others.height_m[stations.partner[rows]]
    # A height is that of an upper edge above a lower one: each has the deviation of a height
    sigma_m = math.sqrt(2.0) * stations.sigma_m[rows, 1]
    return np.asarray(np.abs(after_m - before_m) > _HEIGHT_DEVIATIONS * sigma_m)


def epoch_stations(lines: LineSet, others: LineSet, not_compared: Sequence[str]) -> EpochStations:
    """Return the stations of lines, and what the others have there; kinds that are not compared do not make places visible."""
    tells = ~np.isin(others.kind, not_compared)
    cut = LinesToCut(others)
    columns: list[tuple[AnyArray, ...]] = []
    for i in range(len(lines)):
        axis = axis_along("", lines[i].xyz)
        along = axis.station_m
        n = len(along)
        first, last = int(lines.offsets[i]), int(lines.offsets[i + 1])
        vertex_m = distance_along(lines[i].xyz)
        nearest = np.clip(np.searchsorted(vertex_m, along), 0, last - first - 1)
        sigma = np.column_stack(
            [np.interp(along, vertex_m, s[first:last]) for s in (lines.sigma_xy_m, lines.sigma_z_m)]
        )
        found = _partners(axis, str(lines.kind[i]), str(lines.form[i]), cut, tells)
        columns.append(
            (np.full(n, i), along, axis.xyz, axis.left, lines.bridged[first:last][nearest], *found, sigma)
        )
    if not columns:
        empty = np.zeros(0)
        return EpochStations(
            empty.astype(np.int64), empty, np.zeros((0, 3)), np.zeros((0, 2)), empty.astype(bool), empty.astype(np.int64),
            empty, empty, np.zeros((0, 2)), empty.astype(bool), empty.astype(bool), empty.astype(np.int64),
            empty,
        )  # fmt: skip
    line, along, xyz, left, bridged, partner, across, up, other, hidden, visible, instead, instead_m, own = (
        np.concatenate(column) for column in zip(*columns, strict=True)
    )
    sigma_m = np.hypot(np.nan_to_num(own, nan=0.0), np.nan_to_num(other, nan=0.0)).clip(min=_LEAST_SIGMA_M)
    return EpochStations(
        line, along, xyz, left, bridged, partner, across, up, sigma_m, hidden, visible, instead, instead_m
    )


def _partners(axis: Axis, kind: str, form: str, cut: LinesToCut, tells: BoolArray) -> tuple[AnyArray, ...]:
    """Return the nearest line of the same kind at each station, its differences, whether the place was visible, and others."""
    n = len(axis.station_m)
    partner, across, up = np.full(n, -1), np.full(n, np.nan), np.full(n, np.nan)
    sigma, hidden, visible = np.zeros((n, 2)), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    instead, instead_m = np.full(n, -1), np.zeros(n)
    others, cuts = cut.lines, cross_cuts(cut, axis, reach_m=_VISIBLE_M)
    if len(cuts):
        visible[cuts.station[~cuts.bridged & tells[cuts.line]]] = True
        # Wires hang above each other, as do the pipes of a rail: they are told apart in space
        in_space = (others.form[cuts.line] == STACKED_FORM) & (form == STACKED_FORM) | (kind == "cable")
        away = np.hypot(cuts.offset_m, np.where(in_space, cuts.up_m - axis.xyz[cuts.station, 2], 0.0))
        is_same = (others.kind[cuts.line] == kind) & (np.abs(cuts.cosine) >= _ALONG_COSINE)
        # A kerb before a wall that is a boundary too is another line: one is the other only in its place
        is_alike = (others.form[cuts.line] == form) | (others.form[cuts.line] == "") | (form == "")
        same = np.flatnonzero(is_same & (away <= np.where(is_alike, SAME_M, _IN_PLACE_M)))
        # From the farthest to the nearest: the last one written stays
        for row in same[np.argsort(-away[same], kind="stable")].tolist():
            k = int(cuts.station[row])
            partner[k], across[k] = cuts.line[row], cuts.offset_m[row]
            up[k] = cuts.up_m[row] - axis.xyz[k, 2]
            sigma[k] = cuts.sigma_xy_m[row], cuts.sigma_z_m[row]
            hidden[k] = cuts.bridged[row]
        away = np.hypot(cuts.offset_m, cuts.up_m - axis.xyz[cuts.station, 2])
        is_other = (others.kind[cuts.line] != kind) & (np.abs(cuts.cosine) >= _ALONG_COSINE) & ~cuts.bridged
        other = np.flatnonzero(is_other & (away <= _IN_PLACE_M) & (partner[cuts.station] < 0))
        for row in other[np.argsort(-away[other], kind="stable")].tolist():
            k = int(cuts.station[row])
            instead[k], instead_m[k] = cuts.line[row], cuts.along_m[row]
    return partner, across, up, sigma, hidden, visible, instead, instead_m
