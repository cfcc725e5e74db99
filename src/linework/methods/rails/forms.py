"""Stretches of followed sheets by what their cross-sections show: rails of every form, railings and fences.

A guardrail that was found is told its form, and keeps its line if it is a W-beam. Every other form has a line of its own:
its upper edge is fitted again, since a deep beam is followed below its edge and the pipes of a bridge rail one by one.

Separate from `sections`, which explains one section: this goes along a line.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.kernels.radon.sections import EdgeShape
from linework.methods.rails import fitted
from linework.methods.rails.chains import long_runs
from linework.methods.rails.circles import Bins, CircleConfig
from linework.methods.rails.outlines import OutlineFit
from linework.methods.rails.placed import PlacedRail, above_beside_m, road_noise_m
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.rails import FittedRail, fit_rails
from linework.methods.rails.sections import (
    NOTHING,
    SectionForm,
    form_of_bars,
    form_of_section,
    sections_at,
)
from linework.methods.rails.stretches import near_chosen
from linework.surface.road import Ground

#: Stations between two windows: a third of a window's length. [stations]
_EVERY = 4
#: Windows to either side that tell the outline of bars together, or that a rail goes on: two that share no points with this
#: one. [windows]
_BESIDE = 6
#: Height above a tried edge that is to be clear: that of the kernel. [m]
_CLEAR_M = 0.10
#: Height above the followed edge at which what has a lid ends at the latest: twigs of a hedge behind a rail go on. [m]
_LID_ENDS_M = 0.10
#: Most of a beam that its edge is found by: a crest and a half of a folded one. [m]
_MOST_BEAM_M = 0.30
#: What is followed changes to another beam where it rises or falls by more within a window: pipes are 0.2 m and more
#: apart, ends dip by 0.35 m, and show their form all the same. [m]
_OTHER_BEAM_M = 0.10
#: Fits of an upper edge, each about the one before.
_ROUNDS = 2
#: Weight of points above an edge, per equal area: twice, as for a W-beam.
_ABOVE_WEIGHT = 2.0


@dataclass(frozen=True, slots=True)
class FormedStretch:
    """A run of nodes of a rail whose windows show one form.

    Parameters
    ----------
    run
        Its nodes.
    section
        What the window that stands for it shows.
    agreeing
        Share of its windows that show the same.
    rise_m
        (n,) height of the upper edge above the followed one at the nodes of the run: what is followed may change from
        one edge to another. [m]
    across_m
        (n,) place of the highest beam to the left of the followed line. [m]
    """

    run: slice
    section: SectionForm
    agreeing: float
    rise_m: FloatArray
    across_m: FloatArray


def forms_along(
    placed: PlacedRail, bins: Bins, surface: Ground, circles: CircleConfig
) -> tuple[IntArray, list[SectionForm]]:
    """Return the stations (k,) int64 of windows along a rail, and what each of them shows.

    A window shows the same in whichever direction the rail is followed, which differs from tile to tile.
    """
    rail = placed.rail
    # Windows at places of the world, the same wherever a tile begins
    nodes, half = _nodes(rail), rail.profile.window // 2
    n = len(nodes)
    along = np.abs(np.column_stack([np.cos(nodes[:, 2]), np.sin(nodes[:, 2])]))
    axis = np.argmax(along, axis=1)
    place = (rail.xy + bins.origin[:2])[np.arange(n), axis]
    step = _EVERY * circles.spacing_m
    at = np.flatnonzero(np.abs(place % step - 0.5 * step) < 0.5 * circles.spacing_m)
    asked = rail.measured[at]
    windows = np.column_stack([np.maximum(at - half, 0), np.minimum(at + half + 1, n)])[asked]
    at_asked = at[asked]
    is_turned = _are_turned(nodes[at_asked, 2])
    held = _turned(sections_at(nodes, windows, bins, circles), is_turned)
    above = placed.above_ground_m[at_asked]
    in_world = nodes[at_asked] + np.array([*bins.origin[:2], 0.0, bins.origin[2]])
    beside = above_beside_m(surface, in_world)
    beside[is_turned] = beside[is_turned, ::-1]
    noise = road_noise_m(surface, placed.xyz[at_asked, :2])
    forms = [
        form_of_section(*seen)
        for seen in zip(held, above.tolist(), noise.tolist(), map(tuple, beside.tolist()), strict=True)
    ]
    height_m = placed.height_m
    is_between = _are_between_rails(at_asked, forms)
    for i, (first, end) in enumerate(windows.tolist()):
        is_open = not forms[i].form or forms[i].kind == "fence"
        if is_open and np.ptp(height_m[first:end]) > _OTHER_BEAM_M and is_between[i]:
            # What is followed changes from one beam to another, which smears them: they are level over the road
            level = nodes.copy()
            level[:, 3] += height_m[at_asked[i]] - height_m
            (counts,) = _turned(sections_at(level, windows[i : i + 1], bins, circles), is_turned[i : i + 1])
            seen = form_of_section(counts, float(above[i]), float(noise[i]))
            if seen.kind == "guardrail" and len(seen.bands) > 1:
                forms[i] = replace(seen, is_level=True)
    found, turned = iter(forms), np.zeros(len(at), dtype=bool)
    turned[asked] = is_turned
    shown = _with_neighbours([next(found) if is_asked else NOTHING for is_asked in asked.tolist()])
    return at, [s.mirrored() if t else s for s, t in zip(shown, turned.tolist(), strict=True)]


def _are_turned(heading_rad: FloatArray) -> BoolArray:
    """Return which of the headings (k,) lead west, or due south: lines are followed in either direction.

    >>> _are_turned(np.radians([0.0, 90.0, 91.0, 180.0, -90.0])).tolist()
    [False, False, True, True, True]
    """
    # Rounded: due north and due south are no more west for what rounding made of them
    east, north = (np.round(f(heading_rad), 9) for f in (np.cos, np.sin))
    return np.asarray((east < 0.0) | ((east == 0.0) & (north < 0.0)))


def _turned(counts: FloatArray, is_turned: BoolArray) -> FloatArray:
    """Return the sections (k, heights, widths), those that are turned as from the other end."""
    return np.where(is_turned[:, None, None], counts[:, :, ::-1], counts)


def _are_between_rails(at: IntArray, forms: list[SectionForm]) -> BoolArray:
    """Return which windows (k,) bool have one before and one after that show a rail of several beams, both near.

    Ends that dip have none beyond them. `at` (k,) are the stations of the windows, ascending.
    """
    shows = at[[s.kind == "guardrail" and len(s.bands) > 1 for s in forms]]
    before = np.searchsorted(shows, at) - np.searchsorted(shows, at - _BESIDE * _EVERY)
    after = np.searchsorted(shows, at + _BESIDE * _EVERY, "right") - np.searchsorted(shows, at, "right")
    return np.asarray((before > 0) & (after > 0))


def _with_neighbours(forms: list[SectionForm]) -> list[SectionForm]:
    """Return the sections of windows, those of bars judged by the outlines of the windows beside them as well.

    A few dozen points on a bar do not tell a board from a pipe; the next windows of the same rail show the same bars.
    """
    out = []
    for i, own in enumerate(forms):
        near = forms[max(i - _BESIDE, 0) : i + _BESIDE + 1]
        same = [other for other in near if other.is_bars and len(other.bands) == len(own.bands)]
        seen = [band.fits for other in same for band in other.bands]
        out.append(_judged(own, seen) if own.is_bars else own)
    return out


def _judged(own: SectionForm, seen: list[tuple[OutlineFit, ...]]) -> SectionForm:
    return replace(form_of_bars(own.bands, seen, hangs=own.hangs), is_level=own.is_level)


def form_of_run(at: IntArray, forms: list[SectionForm], run: slice, over_road_m: FloatArray) -> FormedStretch:
    """Return what most of the windows of a run show; the window with the best explained beams stands for it.

    Windows agree on a fence whatever form of fence they show: few points close the gaps between boards. `over_road_m`
    (n,) is the height of the followed edge over the road. [m]
    """
    inside = [form for i, form in zip(at.tolist(), forms, strict=True) if run.start <= i < run.stop]
    named = Counter((s.kind, s.form, len(s.bands)) for s in inside if s.form)
    if not named:
        return FormedStretch(run, NOTHING, 0.0, *np.zeros((2, run.stop - run.start)))
    family, number = _most(Counter(map(_family, filter(_has_form, inside))))
    (kind, form), _ = _most(Counter((s.kind, s.form) for s in inside if s.form and _family(s) == family))
    n_bands = max((k for k in named if k[:2] == (kind, form)), key=lambda k: (named[k], k[2]))[2]
    places = at[(at >= run.start) & (at < run.stop)]
    is_same = [(s.kind, s.form, len(s.bands)) == (kind, form, n_bands) for s in inside]
    same = [s for s, chosen in zip(inside, is_same, strict=True) if chosen]
    nodes, places = np.arange(run.start, run.stop), places[is_same]
    high = np.array([s.bands[0].high_m for s in same])
    rise = np.interp(nodes, places, high)
    if any(s.is_level for s in same):
        # From and to a window that was looked at along the road, beams are level over it, whatever is followed
        level = np.array([s.is_level for s in same])
        after = np.searchsorted(places, nodes)
        between = (after > 0) & (after < len(places))
        between[between] = (level[1:] | level[:-1])[after[between] - 1]
        over = np.interp(nodes, places, high + over_road_m[places]) - over_road_m[nodes]
        rise = np.where(between, over, rise)
    across = np.interp(nodes, places, [s.bands[0].axis_m for s in same])
    return FormedStretch(run, _middle(same), number / len(inside), rise, across)


def lid_of_run(at: IntArray, forms: list[SectionForm], run: slice) -> float:
    """Return how many more of the points are behind the face in its upper 3 cm than below, the median of windows [ratio].

    A lid is at the top alone, and ends what is there; a second beam, posts and twigs are behind a face at all heights, and a
    hedge goes on above it.
    """
    inside = [
        s.bands[0] for i, s in zip(at.tolist(), forms, strict=True) if run.start <= i < run.stop and s.bands
    ]
    lids = [b.top_share - b.below_share if b.high_m <= _LID_ENDS_M else 0.0 for b in inside]
    return float(np.median(lids)) if lids else 0.0


def _most(counted: Counter[Any]) -> tuple[Any, int]:
    """Return what was counted most, and how often; of several the last in order."""
    return max(counted.items(), key=lambda item: (item[1], item[0]))


def _has_form(section: SectionForm) -> bool:
    return bool(section.form)


def _family(section: SectionForm) -> str:
    """Return what windows of one thing agree on: the kind of a fence, kind and form of all else; "" without a form."""
    return section.kind if section.kind == "fence" else f"{section.kind} {section.form}".strip()


def _middle(same: list[SectionForm]) -> SectionForm:
    """Return a section with the median of the beams of several that show the same."""
    bands = tuple(
        replace(
            of_one[0],
            **{
                name: float(np.median([getattr(band, name) for band in of_one]))
                for name in ("low_m", "high_m", "axis_m", "explained", "top_share", "below_share")
            },
        )
        for of_one in zip(*(s.bands for s in same), strict=True)
    )
    return replace(same[0], bands=bands)


def formed_stretches(
    at: IntArray,
    forms: list[SectionForm],
    steady: BoolArray,
    over_road_m: FloatArray,
    circles: CircleConfig,
    config: ProfileConfig,
) -> list[FormedStretch]:
    """Return the runs of steady nodes whose windows show one form.

    The form that most windows show comes first. Fences end where their windows end, and go on where a window's length
    shows nothing: they do not dip into the ground, and stand in rows with walls and hedges. Runs of other forms go on for `max_run_on_m` where windows show nothing or, for
    less than that, something else: at ends that dip into the ground, under bushes, where the followed edge changes from
    one rope to the next.

    Parameters
    ----------
    at, forms
        As `forms_along` returns them.
    steady
        (n,) bool: nodes that lie on one line, as far as their points can show.
    over_road_m
        (n,) height of the followed edge over the road. [m]
    """
    if not len(at):
        return []
    n, chainage = len(steady), np.arange(len(steady), dtype=np.float64) * circles.spacing_m
    names = _nearest_names(np.array([_family(s) for s in forms]), at, n)
    least = round(config.min_length_m / circles.spacing_m) + 1
    most_on = round(config.max_run_on_m / circles.spacing_m)
    free, found = steady.copy(), []
    for name, _ in sorted(Counter(names.tolist()).items(), key=lambda item: (-item[1], item[0])):
        if not name:
            continue
        sure = np.zeros(n, dtype=bool)
        for run in long_runs((names == name) & free, _EVERY):
            sure[run] = True
        if name == "fence":
            near = _closed(sure, round(config.window_m / circles.spacing_m)) & np.isin(names, ("", name))
        else:
            near = near_chosen(sure, chainage, config.max_run_on_m)
            for run in long_runs((names != name) & (names != ""), most_on):
                near[run] = False
        for run in long_runs(free & near, least):
            stretch = form_of_run(at, forms, run, over_road_m)
            if _family(stretch.section) == name and is_agreed(stretch):
                found.append(stretch)
                free[run] = False
    return found


def _nearest_names(names: AnyArray, at: IntArray, n: int) -> AnyArray:
    """Return what the windows `at` (k,) nearest to nodes 0 to n - 1 show, (n,); of two as near, the one that shows something.

    >>> _nearest_names(np.array(["", "fence", ""]), np.array([1, 5, 9]), 10).tolist()
    ['', '', '', 'fence', 'fence', 'fence', 'fence', 'fence', '', '']
    """
    away = np.abs(np.arange(n)[:, None] - at[None])
    before = names[np.argmin(away, axis=1)]
    after = names[len(at) - 1 - np.argmin(away[:, ::-1], axis=1)]
    return np.asarray(np.where(before >= after, before, after))


def _closed(chosen: BoolArray, most: int) -> BoolArray:
    """Return which nodes (n,) bool are true, or lie between true ones with at most `most` false ones."""
    out = chosen.copy()
    at = np.flatnonzero(chosen)
    for a, b in pairwise(at.tolist()):
        if b - a - 1 <= most:
            out[a:b] = True
    return out


def is_agreed(stretch: FormedStretch) -> bool:
    """Return whether enough of the windows show the form of a stretch."""
    return stretch.agreeing >= fitted.LEAST_AGREEING


def fitted_again(
    rail: FittedRail, stretch: FormedStretch, bins: Bins, circles: CircleConfig, config: ProfileConfig
) -> list[FittedRail]:
    """Return a stretch of a rail fitted to each of its lines, from the highest down (see `SectionForm.lines`)."""
    fits, run = [], stretch.run
    heading = _nodes(rail)[run, 2]
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    xy = rail.xy[run]
    if stretch.section.kind == "barrier":
        # The upper edge is behind what is followed on a slope
        xy = xy + stretch.across_m[:, None] * left
    for band in stretch.section.lines:
        top = rail.top_m[run] + stretch.rise_m + band.high_m - stretch.section.bands[0].high_m
        number = np.maximum(rail.profile.number[run], 1.0)
        chain = np.column_stack([xy, top, number, rail.measured[run]])
        beam = min(band.height_m, _MOST_BEAM_M)
        edge = EdgeShape(beam=beam, above=_ABOVE_WEIGHT * beam / _CLEAR_M, under=0.0)
        for _ in range(_ROUNDS):
            # Where the edge dips it is found 0.3 m off at most: what is followed may be farther off, above all at ends
            (fit,) = fit_rails([chain], bins, circles, config, edge)
            chain = np.column_stack([xy, fit.top_m, np.maximum(fit.profile.number, 1.0), fit.measured])
        if stretch.section.form in ("box_beam", "tube"):
            # The line is the axis, which the points of the visible faces are not on
            fit = replace(fit, xy=xy + band.axis_m * left)
        fits.append(fit)
    return fits


def _nodes(rail: FittedRail) -> FloatArray:
    """Return x, y, heading and top (n, 4) of a rail."""
    step = np.gradient(rail.xy, axis=0)
    return np.column_stack([rail.xy, np.arctan2(step[:, 1], step[:, 0]), rail.top_m])
