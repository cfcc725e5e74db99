"""Changes between two surveys of one road: new, gone, moved and changed lines, and what was hidden.

The two surveys are registered first, from their own lines: navigation errs by centimetres that change slowly along the
road, and what all lines do is not a change of the road.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import groupby
from operator import itemgetter

import numpy as np

from linework.crs import describe_crs, same_crs
from linework.errors import CrsError
from linework.evaluation.chainage.paint_changes import paint_changes
from linework.evaluation.chainage.paint_points import PaintPieces
from linework.evaluation.changes.dash_changes import dash_runs
from linework.evaluation.changes.epoch_change import (
    EpochChange,
    existence_of,
    joined,
    levels_of,
    stretches_of,
)
from linework.evaluation.changes.epoch_stations import EpochStations, epoch_stations
from linework.evaluation.changes.ground_compared import GroundCompared, ground_compared
from linework.evaluation.changes.ground_seen import LookAtPlaces, ground_along, without_unseen
from linework.evaluation.changes.misses import LIKELY_CHANGE, Alone, change_probabilities
from linework.evaluation.changes.registration import Registration, placed, registered
from linework.evaluation.changes.same_lines import changes_of_same
from linework.lines.along import line_stretch
from linework.lines.crosscuts import STATION_M
from linework.model.lines import CANDIDATE, POLE, LineSet

#: Kinds that are not compared: dashes change with their markings; candidates were not taken; edges beside boundaries are
#: kept only where a boundary lies beside them, and come and go with it; poles have no length along the road.
_NOT_COMPARED = ("lane_marking_dash", CANDIDATE, "edge_other", POLE)


def check_same_crs(old: LineSet, new: LineSet) -> None:
    """Raise a `CrsError` if the lines of two surveys are in different CRSs."""
    if not same_crs(old.crs, new.crs):
        raise CrsError(f"two different CRSs: {describe_crs(old.crs)} and {describe_crs(new.crs)}",
                       where="the new lines", advice="convert one of them")  # fmt: skip


def compare_epochs(
    old: LineSet, new: LineSet, paint: tuple[PaintPieces, PaintPieces] | None = None,
    looks: tuple[LookAtPlaces, LookAtPlaces] | None = None,
) -> tuple[list[EpochChange], Registration]:  # fmt: skip
    """Return the changes from an old to a new survey of the same road, and their registration.

    Parameters
    ----------
    old, new
        Lines of both surveys.
    paint
        What the points of each show on its markings (`paint_pieces`): wear and renewed paint are changes too.
    looks
        At the points of each (`look_at_ground`): a line is no change where the other survey did not see the ground, nor where
        the ground looks as it did.

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
    shown: list[GroundCompared | None] = [None, None]
    if looks is not None:
        xyz = back.xyz - (placed(back.xyz, registration) - back.xyz)
        ground = ground_along(there, old, new, placed(there.xyz, registration), looks)
        ground_back = ground_along(back, new, old, xyz, looks[::-1])
        there, back = without_unseen(there, old, ground), without_unseen(back, new, ground_back)
        shown = [
            ground_compared(ground, old.kind[there.line], there.line),
            ground_compared(ground_back, new.kind[back.line], back.line),
        ]
    if paint is not None:
        for worn in paint_changes(*whole, *paint, placed(paint[0].xy, registration)):
            what = f"remaining paint {worn.before:.0f} to {worn.after:.0f} %"
            of_paint.append(_of_paint(whole[0], worn.line, worn.from_m, worn.to_m, what))
    gone, new_there = _found_alone(
        (old, new, there, "gone", n_old, shown[0]), (new, old, back, "new", n_new, shown[1])
    )
    differing = changes_of_same(old, new, there, n_old, registration, shown[0])
    changes = []
    for i in range(n_old):
        changes += [*gone[i], *_hidden(old, there, i, gone[i]), *differing[i]]
    for i in range(n_new):
        lost = (back.line == i) & (back.partner < 0) & ~back.bridged
        for change in new_there[i]:
            if change.status != "unsure":
                lost[change.stations_of(back, i)] = False
        changes += new_there[i]
        changes += stretches_of(new, back, i, lost & ~back.visible, "not visible", what="in the old survey")
    return changes + of_paint, registration


def _compared_first(lines: LineSet) -> LineSet:
    """Return lines with a length along the road but for dashes, those that are compared first."""
    lines = lines.take((lines.length_m > 0) & ~np.isin(lines.kind, ("lane_marking_dash", POLE)))
    return lines.take(np.argsort(np.isin(lines.kind, _NOT_COMPARED), kind="stable"))


def _found_alone(
    *surveys: tuple[LineSet, LineSet, EpochStations, str, int, GroundCompared | None],
) -> list[list[list[EpochChange]]]:
    """Return for both surveys, line by line, what only it found where the other could see: changes, and what is unsure.

    A line that is another kind in the other survey is one change, of the old line. What is hidden, or was bridged, between
    two stretches does not part them: they were missed once, or have changed together, and so has what is between them where
    it is no longer than both together.
    """
    cases: list[tuple[int, int, list[EpochChange]]] = []
    alone: list[Alone] = []
    found_m = []
    for side, (lines, others, stations, status, n, shown) in enumerate(surveys):
        lost = (stations.partner < 0) & ~stations.bridged & stations.visible
        both = (stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged
        both_m = STATION_M * np.bincount(stations.line[both], minlength=n)
        kinds = np.append(others.kind, "")[stations.instead]
        first = np.searchsorted(stations.line, np.arange(n))
        for i in range(n):
            levels = levels_of(lines, i, status)
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
                parts = stretches_of(lines, stations, i, here & (kinds == kind), named, what=what)
                n_parted = np.cumsum(both | (lost & (kinds != kind)))
                number = [n_parted[first[i] + round(one.from_m / STATION_M)] for one in parts]
                for _, own in groupby(zip(number, parts, strict=True), itemgetter(0)):
                    one_case = [one for _, one in own]
                    cases.append((side, i, joined(lines, i, one_case)))
                    says = 0.0
                    if shown is not None:
                        where = np.concatenate([one.stations_of(stations, i) for one in one_case])
                        says = shown.log_odds(str(lines.kind[i]), where)
                    length_m = sum(one.length_m for one in one_case)
                    alone.append(Alone(levels, length_m, existence_of(lines, i), says))
    found: list[list[list[EpochChange]]] = [[[] for _ in range(n)] for *_, n, _ in surveys]
    for (side, i, rows), chance in zip(cases, change_probabilities(alone, found_m), strict=True):
        for change in rows:
            is_sure = chance >= LIKELY_CHANGE
            status, what = (
                (change.status, change.what) if is_sure else ("unsure", change.what or change.status)
            )
            found[side][i].append(replace(change, status=status, what=what, probability=chance))
    return found


def _of_paint(lines: LineSet, line: int, from_m: float, to_m: float, what: str) -> EpochChange:
    piece = line_stretch(lines.take([line]), from_m, to_m)
    return EpochChange("changed", piece, from_m, to_m, math.nan, math.nan, math.nan, math.nan, what)


def _hidden(lines: LineSet, stations: EpochStations, i: int, known: list[EpochChange]) -> list[EpochChange]:
    """Return what of a line of the old survey was hidden in the new one, but for what is known to have changed."""
    lost = (stations.partner < 0) & ~stations.visible
    hidden = (
        (stations.line == i) & ~stations.bridged & ((stations.partner >= 0) & stations.partner_bridged | lost)
    )
    for change in known:
        if change.status != "unsure":
            hidden[change.stations_of(stations, i)] = False
    return stretches_of(lines, stations, i, hidden, "not visible")
