"""Changes between two surveys of one road: new, gone, moved and changed lines, and what was hidden.

The two surveys are registered first, from their own lines: navigation errs by centimetres that change slowly along the
road, and what all lines do is not a change of the road.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from linework.arrays import BoolArray, IntArray
from linework.crs import describe_crs, same_crs
from linework.errors import CrsError
from linework.evaluation.chainage.paint_changes import paint_changes
from linework.evaluation.chainage.paint_points import PaintPieces
from linework.evaluation.changes.dash_changes import dash_runs
from linework.evaluation.changes.epoch_stations import EpochStations, epoch_stations
from linework.evaluation.changes.misses import LEAST_STRETCH_M, Alone, change_probabilities
from linework.evaluation.changes.registration import Registration, differences_of, placed, registered
from linework.evaluation.shifts import (
    FALSE_PER_KM,
    chance_of,
    filters_of,
    least_deviations,
    related_of,
    scale_of,
    shifted_runs,
)
from linework.lines.along import line_stretch, runs_of
from linework.lines.crosscuts import STATION_M
from linework.model.lines import CANDIDATE, POLE, LineSet

#: Length of a piece over which differences are averaged before they are judged. [m]
_PIECE_M = 5.0
#: Kinds that are not compared: dashes change with their markings; candidates were not taken; edges beside boundaries are
#: kept only where a boundary lies beside them, and come and go with it; poles have no length along the road.
_NOT_COMPARED = ("lane_marking_dash", CANDIDATE, "edge_other", POLE)
#: A height has changed beyond this many deviations: by chance one line in 370.
_HEIGHT_DEVIATIONS = 3.0
#: What only one survey found has changed where that is twice as likely as that it was missed, or never there.
_LIKELY = 2.0 / 3.0
#: Borders of the classes of confidence: even odds, and two to three times as good from class to class.
_CONFIDENCES = (0.5, 0.7, 0.85, 0.95)


@dataclass(frozen=True, slots=True)
class EpochChange:
    """A change, or a stretch that was hidden.

    Parameters
    ----------
    status
        "new", "gone", "moved", "changed", "unsure" or "not visible".
    line
        The stretch: of the new survey's line for "new" and what is unsure of it, else of the old one's.
    from_m, to_m
        Distance of its ends from the start of that line. [m]
    across_m, up_m
        Mean difference new minus old after registration, positive to the left and up; NaN where there is none. [m]
    sigma_across_m, sigma_up_m
        Standard deviations of the differences, with that of the registration. [m]
    what
        What is different of a "changed" line; of dashes that are new, it is a stretch of the new survey's line. What an
        "unsure" one would be.
    probability
        That the road has changed, of what only one survey found, see `change_probabilities`; else NaN.
    """

    status: str
    line: LineSet
    from_m: float
    to_m: float
    across_m: float
    up_m: float
    sigma_across_m: float
    sigma_up_m: float
    what: str
    probability: float = math.nan

    @property
    def length_m(self) -> float:
        """Return its length [m]."""
        return self.to_m - self.from_m


def check_same_crs(old: LineSet, new: LineSet) -> None:
    """Raise a `CrsError` if the lines of two surveys are in different CRSs."""
    if not same_crs(old.crs, new.crs):
        raise CrsError(f"two different CRSs: {describe_crs(old.crs)} and {describe_crs(new.crs)}",
                       where="the new lines", advice="convert one of them")  # fmt: skip


def compare_epochs(
    old: LineSet, new: LineSet, paint: tuple[PaintPieces, PaintPieces] | None = None
) -> tuple[list[EpochChange], Registration]:
    """Return the changes from an old to a new survey of the same road, and their registration.

    Parameters
    ----------
    old, new
        Lines of both surveys.
    paint
        What the points of each show on its markings (`paint_pieces`): wear and renewed paint are changes too.

    Raises
    ------
    CrsError
        The two are in different CRSs.

    Notes
    -----
    Lines of one kind are compared at every metre across, in means over 5 m, after registration. Their deviation is
    sqrt(s_old^2 + s_new^2 + s_registration^2), times what differences of lines of that kind are found to be in the two
    surveys. A line has moved over stretches whose mean chance gives, with as many comparisons and as far as neighbouring
    differences are related, once in 2 km of road. A line that only one survey found is new or gone where that is twice as
    likely as that the other missed it, as often and as far as the two surveys miss such lines; else it is unsure.
    """
    check_same_crs(old, new)
    of_paint = [
        _of_paint(lines, line, from_m, to_m, f"{n} dashes {what}")
        for lines, other, what in ((old, new, "gone"), (new, old, "new"))
        for line, from_m, to_m, n in dash_runs(lines, other)
    ]
    whole = old, new
    old, new = (_compared_first(s) for s in whole)
    n_old, n_new = (int((~np.isin(s.kind, _NOT_COMPARED)).sum()) for s in (old, new))
    there, back = epoch_stations(old, new, _NOT_COMPARED), epoch_stations(new, old, _NOT_COMPARED)
    there, back = there.recoded_with(back).of_first(n_old), back.recoded_with(there).of_first(n_new)
    registration = registered(there)
    if paint is not None:
        for worn in paint_changes(*whole, *paint, placed(paint[0].xy, registration)):
            what = f"remaining paint {worn.before:.0f} to {worn.after:.0f} %"
            of_paint.append(_of_paint(whole[0], worn.line, worn.from_m, worn.to_m, what))
    gone, new_there = _found_alone((old, new, there, "gone", n_old), (new, old, back, "new", n_new))
    pieces = _moved_pieces(old, there, registration)
    changes = []
    for i in range(n_old):
        changes += [*gone[i], *_of_line(old, new, there, i, registration, pieces)]
    for i in range(n_new):
        lost = (back.line == i) & (back.partner < 0) & ~back.bridged
        changes += new_there[i]
        changes += _stretches(new, back, i, lost & ~back.visible, "not visible", what="in the old survey")
    return changes + of_paint, registration


def _compared_first(lines: LineSet) -> LineSet:
    """Return lines with a length along the road but for dashes, those that are compared first."""
    lines = lines.take((lines.length_m > 0) & ~np.isin(lines.kind, ("lane_marking_dash", POLE)))
    return lines.take(np.argsort(np.isin(lines.kind, _NOT_COMPARED), kind="stable"))


def _found_alone(
    *surveys: tuple[LineSet, LineSet, EpochStations, str, int],
) -> list[list[list[EpochChange]]]:
    """Return for both surveys, line by line, what only it found where the other could see: changes, and what is unsure.

    A line that is another kind in the other survey is one change, of the old line.
    """
    stretches: list[tuple[tuple[int, int, int], EpochChange]] = []
    alone: dict[tuple[int, int, int], Alone] = {}
    found_m = []
    for side, (lines, others, stations, status, n) in enumerate(surveys):
        lost = (stations.partner < 0) & ~stations.bridged & stations.visible
        both = (stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged
        both_m = STATION_M * np.bincount(stations.line[both], minlength=n)
        kinds = np.append(others.kind, "")[stations.instead]
        # What is hidden between two stretches parts them, but they were missed once, or have changed together
        n_both, first = np.cumsum(both), np.searchsorted(stations.line, np.arange(n))
        for i in range(n):
            levels = _levels(lines, i, status)
            found_m.append((levels, float(both_m[i])))
            here = lost & (stations.line == i)
            for kind in sorted(set(kinds[here].tolist())):
                what, named = "", status
                if kind:
                    of_both = (str(lines.kind[i]), kind)
                    what, named = (
                        "kind {} to {}".format(*(of_both if side == 0 else of_both[::-1])),
                        "changed",
                    )
                    if side == 1 and kind not in _NOT_COMPARED:
                        continue
                for change in _stretches(lines, stations, i, here & (kinds == kind), named, what=what):
                    key = side, i, int(n_both[first[i] + round(change.from_m / STATION_M)])
                    stretches.append((key, change))
                    length_m = change.length_m + (alone[key].length_m if key in alone else 0.0)
                    alone[key] = Alone(levels, length_m, float(lines.confidence[i]))
    found: list[list[list[EpochChange]]] = [[[] for _ in range(n)] for *_, n in surveys]
    chance = dict(zip(alone, change_probabilities(list(alone.values()), found_m), strict=True))
    for key, change in stretches:
        side, i, _ = key
        is_sure = chance[key] >= _LIKELY
        status, what = (change.status, change.what) if is_sure else ("unsure", change.what or change.status)
        found[side][i].append(replace(change, status=status, what=what, probability=chance[key]))
    return found


def _levels(lines: LineSet, i: int, survey: str) -> tuple[str, ...]:
    """Return the classes of a line by which lines are missed, from the widest to the narrowest."""
    sure = str(int(np.searchsorted(_CONFIDENCES, lines.confidence[i])))
    return str(lines.kind[i]), f"{lines.form[i]} {lines.pattern[i]}", survey, sure


def _of_paint(lines: LineSet, line: int, from_m: float, to_m: float, what: str) -> EpochChange:
    piece = line_stretch(lines.take([line]), from_m, to_m)
    return EpochChange("changed", piece, from_m, to_m, math.nan, math.nan, math.nan, math.nan, what)


@dataclass(frozen=True, slots=True)
class _Pieces:
    """Pieces of the lines of the old survey that both surveys measured.

    Parameters
    ----------
    line
        (k,) line of each.
    stations
        Stations of each piece.
    is_moved
        (k,) bool: more than chance.
    """

    line: IntArray
    stations: list[IntArray]
    is_moved: BoolArray


def _moved_pieces(old: LineSet, stations: EpochStations, registration: Registration) -> _Pieces:
    """Return all pieces and which of them have moved.

    What chance does is taken from all lines of one kind: how large their differences are against the stated deviations, and
    over which distance they are related. Significance adds up over stretches of any length.
    """
    both = np.flatnonzero((stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    if not len(both):
        return _Pieces(np.zeros(0, dtype=np.int64), [], np.zeros(0, dtype=bool))
    across, up, s_reg = differences_of(stations, both, registration)
    sigma = np.sqrt(stations.sigma_m[both] ** 2 + s_reg**2)
    number = np.floor(stations.along_m[both] / _PIECE_M).astype(np.int64)
    pieces, index = np.unique(np.stack([stations.line[both], number], axis=1), axis=0, return_inverse=True)
    index = index.ravel()
    count = np.bincount(index)
    size = np.stack(
        [np.bincount(index, weights=v) / count for v in (across / sigma[:, 0], up / sigma[:, 1])], axis=1
    )
    kinds = old.kind[pieces[:, 0]]
    n_lines = float(registration.n_lines.mean())
    road_km = len(both) / max(n_lines, 1.0) / 1000.0
    is_moved = np.zeros(len(pieces), dtype=bool)
    rows_of = np.split(np.arange(len(pieces)), np.flatnonzero(np.diff(pieces[:, 0])) + 1)
    for axis in (0, 1):
        own = {
            kind: [size[rows, axis] for rows in rows_of if kinds[rows[0]] == kind]
            for kind in sorted(set(kinds.tolist()))
        }
        related = related_of([one / scale_of(listed) for listed in own.values() for one in listed])
        filters = filters_of(related, len(pieces))
        chances = {kind: chance_of(listed, filters) for kind, listed in own.items()}
        least = least_deviations(len(pieces), filters, 0.5 * FALSE_PER_KM * road_km)
        for rows in rows_of:
            for a, b in shifted_runs(size[rows, axis], chances[str(kinds[rows[0]])], least):
                is_moved[rows[a : b + 1]] = True
    order = np.argsort(index, kind="stable")
    return _Pieces(pieces[:, 0], np.split(both[order], np.cumsum(count)[:-1]), is_moved)


def _of_line(
    old: LineSet, new: LineSet, stations: EpochStations, i: int, registration: Registration, pieces: _Pieces
) -> list[EpochChange]:
    """Return the changes of a line of the old survey that the new one has too, and what of it was hidden."""
    own = stations.line == i
    lost = own & (stations.partner < 0) & ~stations.bridged
    hidden = own & (
        (stations.partner >= 0) & stations.partner_bridged & ~stations.bridged | lost & ~stations.visible
    )
    changes = _stretches(old, stations, i, hidden, "not visible")
    both = np.flatnonzero(own & (stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    if not len(both):
        return changes
    mask = np.zeros(len(stations.line), dtype=bool)
    moved = np.flatnonzero((pieces.line == i) & pieces.is_moved)
    for run in np.split(moved, np.flatnonzero(np.diff(moved) != 1) + 1) if len(moved) else ():
        rows = np.concatenate([pieces.stations[k] for k in run])
        mask[rows] = True
        # What has moved on both sides of a place that was hidden, as one line, has moved there too
        for before, after in pairwise(rows.tolist()):
            if np.all(stations.partner[before : after + 1] == stations.partner[before]):
                mask[before:after] = True
    changes += _stretches(old, stations, i, mask, "moved", registration)
    return changes + _changed(old, new, stations, i, both)


def _changed(
    old: LineSet, new: LineSet, stations: EpochStations, i: int, both: IntArray
) -> list[EpochChange]:
    """Return where the pattern, the form or the height of a line is another one."""
    found = []
    for name in ("pattern", "form"):
        before, after = str(getattr(old, name)[i]), getattr(new, name)[stations.partner[both]]
        other = (after != before) & (after != "") if before else np.zeros(len(both), dtype=bool)
        for value in sorted(set(after[other].tolist())):
            mask = np.zeros(len(stations.line), dtype=bool)
            mask[both[other & (after == value)]] = True
            found += _stretches(old, stations, i, mask, "changed", what=f"{name} {before} to {value}")
    before_m, after_m = float(old.height_m[i]), new.height_m[stations.partner[both]]
    # A height is that of an upper edge above a lower one: each has the deviation of a height
    beyond = np.abs(after_m - before_m) > _HEIGHT_DEVIATIONS * math.sqrt(2.0) * stations.sigma_m[both, 1]
    for value_m in sorted(set(after_m[beyond].tolist())):
        rows = both[beyond & (after_m == value_m)]
        mask = np.zeros(len(stations.line), dtype=bool)
        # A line has one height, also where it is bridged
        mask[rows[0] : rows[-1] + 1] = True
        mask[both[~(beyond & (after_m == value_m))]] = False
        what = f"height {before_m:.2f} to {value_m:.2f} m"
        found += _stretches(old, stations, i, mask, "changed", what=what)
    return found


def _stretches(
    lines: LineSet, stations: EpochStations, i: int, mask: BoolArray, status: str, registration: Registration | None = None,
    what: str = "",
) -> list[EpochChange]:  # fmt: skip
    """Return the stretches of a line whose stations are in the mask, those of 2 m and more."""
    own = np.flatnonzero(stations.line == i)
    found = []
    for a, b in runs_of(mask[own]):
        rows = own[a : b + 1]
        start, end = float(stations.along_m[rows[0]]), float(stations.along_m[rows[-1]])
        if end - start < LEAST_STRETCH_M:
            continue
        numbers = (math.nan, math.nan, math.nan, math.nan)
        if registration is not None:
            rows = rows[~stations.bridged[rows] & ~stations.partner_bridged[rows]]
            across, up, s_reg = differences_of(stations, rows, registration)
            sigma = np.sqrt(np.mean(stations.sigma_m[rows] ** 2 + s_reg**2, axis=0))
            numbers = (float(across.mean()), float(up.mean()), float(sigma[0]), float(sigma[1]))
        piece = line_stretch(lines.take([i]), start, end)
        found.append(EpochChange(status, piece, start, end, *numbers, what))
    return found
