"""What differs of lines that both surveys have: where they have moved, and where pattern, form or height are others.

Separate from `epochs`, which registers the two surveys and finds what only one of them has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.evaluation.changes.epoch_change import EpochChange, existence_of, levels_of, stretches_of
from linework.evaluation.changes.epoch_stations import EpochStations, height_differs
from linework.evaluation.changes.ground_compared import GroundCompared
from linework.evaluation.changes.joined_moves import moved_together
from linework.evaluation.changes.misses import LIKELY_CHANGE, Alone, change_probabilities
from linework.evaluation.changes.registration import Registration, differences_of
from linework.evaluation.shifts import (
    FALSE_PER_KM,
    chance_of,
    filters_of,
    least_deviations,
    related_of,
    scale_of,
    shifted_runs,
)
from linework.lines.crosscuts import STATION_M
from linework.model.lines import LineSet

#: Length of a piece over which differences are averaged before they are judged. [m]
_PIECE_M = 5.0
#: From so many lines of a kind side by side on, one that has moved is less than half of them, as medians need.
_LEAST_ABREAST = 1.5
#: Length of the running median that is what one line differs by for long: several times as long as errors of lines are
#: related, some tens of metres. [pieces]
_FOR_LONG = 41


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

    What chance does is taken from all lines of one kind, of the only one about its running median over 200 m: how large their differences are against the stated deviations, and
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
        # The only line of its kind would else be taken for as uncertain as it has moved
        by_chance = {
            kind: listed
            if sum(map(len, listed)) * _PIECE_M >= _LEAST_ABREAST * 1000.0 * road_km
            else _about_their_median(listed)
            for kind, listed in own.items()
        }
        related = related_of([one / scale_of(listed) for listed in by_chance.values() for one in listed])
        filters = filters_of(related, len(pieces))
        chances = {kind: chance_of(listed, filters) for kind, listed in by_chance.items()}
        least = least_deviations(len(pieces), filters, 0.5 * FALSE_PER_KM * road_km)
        for rows in rows_of:
            for a, b in shifted_runs(size[rows, axis], chances[str(kinds[rows[0]])], least):
                is_moved[rows[a : b + 1]] = True
    order = np.argsort(index, kind="stable")
    return _Pieces(pieces[:, 0], np.split(both[order], np.cumsum(count)[:-1]), is_moved)


def _about_their_median(listed: list[FloatArray]) -> list[FloatArray]:
    """Return differences of the pieces of lines, one array each, about their running median over all the lines.

    >>> moved = np.repeat([1.0, 9.0], 60) + np.tile([0.0, 1.0, 0.0], 40)
    >>> float(np.abs(_about_their_median([moved])[0]).max())
    1.0
    """
    every = np.concatenate(listed)
    own = every - median_filter(every, _FOR_LONG, mode="nearest")
    return np.split(own, np.cumsum([len(one) for one in listed])[:-1])


def changes_of_same(
    old: LineSet, new: LineSet, stations: EpochStations, n: int, registration: Registration,
    shown: GroundCompared | None = None,
) -> list[list[EpochChange]]:  # fmt: skip
    """Return line by line what differs of the first n old lines where the new survey has them too, and what of it is unsure.

    Notes
    -----
    Of a line that both surveys have, one may have measured another edge, or seen another pattern, over some metres. How often
    and how far that happens is taken from all such differences of the two surveys, as for what only one has.
    """
    pieces = _moved_pieces(old, stations, registration)
    both = np.flatnonzero((stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged)
    both_m = STATION_M * np.bincount(stations.line[both], minlength=n)
    found: list[list[EpochChange]] = []
    for i in range(n):
        own = both[stations.line[both] == i]
        found.append([])
        if len(own):
            found[i] = [
                *_moved(old, stations, i, registration, pieces),
                *_changed(old, new, stations, i, own),
            ]
    levels = [levels_of(old, i) for i in range(n)]
    confidence = [_confidence(old, new, stations, i) for i in range(n)]
    measured = np.zeros(len(stations.line), dtype=bool)
    measured[both] = True
    # Moves and each sort of change have their own chances
    for sort in sorted({_sort_of(change) for changes in found for change in changes}):
        cases = [(i, k) for i in range(n) for k, one in enumerate(found[i]) if _sort_of(one) == sort]
        differs = [found[i][k].stations_of(stations, i) for i, k in cases]
        lengths_m = [STATION_M * float(measured[here].sum()) for here in differs]
        left_m = both_m.astype(np.float64)
        for (i, _), length_m in zip(cases, lengths_m, strict=True):
            left_m[i] = max(left_m[i] - length_m, 0.0)
        group = np.arange(len(cases))
        if not sort:
            still = measured.copy()
            for here in differs:
                still[here] = False
            group = moved_together(
                [found[i][k] for i, k in cases], stations.xyz[still, :2], old.kind[stations.line[still]]
            )
        alone = []
        for own in (np.flatnonzero(group == g) for g in range(int(group.max()) + 1)):
            i = cases[max(own.tolist(), key=lambda c: lengths_m[c])][0]
            # Two surveys may call one edge kerb and edge, or say that it is up and down: where the ground looks the same, it is
            says = 0.0
            if shown is not None and sort in ("form", "height", ""):
                longest = differs[max(own.tolist(), key=lambda c: lengths_m[c])]
                higher = _height_ratio(old, new, stations, longest) if sort == "height" else None
                says = shown.log_odds(str(old.kind[i]), longest, moved=not sort, height_ratio=higher)
            alone.append(Alone(levels[i], sum(lengths_m[c] for c in own.tolist()), confidence[i], says))
        chances = change_probabilities(alone, [(levels[i], float(left_m[i])) for i in range(n)])
        for (i, k), g in zip(cases, group.tolist(), strict=True):
            change, chance = found[i][k], chances[g]
            if chance < LIKELY_CHANGE:
                change = replace(change, status="unsure", what=change.what or change.status)
            found[i][k] = replace(change, probability=chance)
    return found


def _height_ratio(old: LineSet, new: LineSet, stations: EpochStations, rows: IntArray) -> float:
    """Return how many times as high the new lines are as the old one, at stations by number; NaN where that is flat."""
    rows = rows[stations.partner[rows] >= 0]
    before_m = float(old.height_m[stations.line[rows[0]]])
    return float(np.nanmedian(new.height_m[stations.partner[rows]])) / before_m if before_m else math.nan


def _sort_of(change: EpochChange) -> str:
    """Return what sort of difference a change is: "", "pattern", "form" or "height"."""
    return change.what.split(" ")[0]


def _confidence(old: LineSet, new: LineSet, stations: EpochStations, i: int) -> float:
    """Return the probability that there is a line at all that both surveys found: that not both are wrong."""
    partners = np.unique(stations.partner[(stations.line == i) & (stations.partner >= 0)])
    in_new = max((existence_of(new, k) for k in partners.tolist()), default=0.0)
    return 1.0 - (1.0 - existence_of(old, i)) * (1.0 - in_new)


def _moved(
    old: LineSet, stations: EpochStations, i: int, registration: Registration, pieces: _Pieces
) -> list[EpochChange]:
    """Return where a line of the old survey has moved."""
    mask = np.zeros(len(stations.line), dtype=bool)
    moved = np.flatnonzero((pieces.line == i) & pieces.is_moved)
    for run in np.split(moved, np.flatnonzero(np.diff(moved) != 1) + 1) if len(moved) else ():
        rows = np.concatenate([pieces.stations[k] for k in run])
        mask[rows] = True
        # What has moved on both sides of a place that was hidden, as one line, has moved there too
        for before, after in pairwise(rows.tolist()):
            if np.all(stations.partner[before : after + 1] == stations.partner[before]):
                mask[before:after] = True
    return stretches_of(old, stations, i, mask, "moved", registration)


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
            found += stretches_of(old, stations, i, mask, "changed", what=f"{name} {before} to {value}")
    before_m, after_m = float(old.height_m[i]), new.height_m[stations.partner[both]]
    beyond = height_differs(old, new, stations, both)
    for value_m in sorted(set(after_m[beyond].tolist())):
        rows = both[beyond & (after_m == value_m)]
        mask = np.zeros(len(stations.line), dtype=bool)
        # A line has one height, also where it is bridged
        mask[rows[0] : rows[-1] + 1] = True
        mask[both[~(beyond & (after_m == value_m))]] = False
        what = f"height {before_m:.2f} to {value_m:.2f} m"
        found += stretches_of(old, stations, i, mask, "changed", what=what)
    return found
