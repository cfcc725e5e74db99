"""Poles and towers: what stands where wires end."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.cables.band import CableBand
from linework.methods.cables.supports import hanging
from linework.model.lines import POLE, LineSet

#: Height above the ground from which on a support is looked at: the lowest points that the search for cables has. [m]
FOOT_M = 2.0
#: Side of the cells in plan and height of the levels in which points are counted [m]: a pole is 0.2 to 0.4 m thick, and
#: a scanner that hits a wire once a metre hits a pole in every half metre.
POLE_CELL_M, POLE_LEVEL_M = 0.25, 0.5
#: A pole's points lie within the first distance of its axis; between the second and the third is air, up to below the
#: crossarms, at least on the side away from a wall; a crown has points there. [m]
POLE_HALF_M, AIR_M, CROSSARM_M = 0.4, (0.6, 1.3), 1.5
#: Distance from the ends of wires within which a pole is looked for: brackets and pins, and ends a little off. [m]
POLE_REACH_M = 1.5
#: Fewest levels that tell a pole, and the least share of them with points. Largest share of levels with points in the air
#: about it: a lamp, a sign, a climbing plant.
LEAST_LEVELS, LEAST_SEEN, MOST_AIR_SEEN = 6, 0.6, 0.4
#: Least length of the mean of the directions to points in that air that are on one side: a wall at 0.6 m is within 62
#: degrees up to 1.3 m, a mean of 0.81; the corner of a house has 0.7, a wall through the column 0.
ONE_SIDE = 0.8
#: A tower has at least three wires (a circuit) at this height [m], and its upper half, in levels of a metre, stands clear
#: from this to that distance beyond its wires [m]; what grows is lower.
TOWER_WIRES, TOWER_M, TOWER_LEVEL_M, TOWER_AIR_M = 3, 12.0, 1.0, (2.0, 6.0)
#: Highest tip of a tower above its wires, which may be without one against lightning. [m]
TOWER_PEAK_M = 10.0
#: Probability, by hand, that a pole stands where wires of two spans meet, seen or not.
MEETING = 0.5
#: Columns of a support that are tried, the nearest to its wires first: more than a wall beside has nearer ones.
_TRIED = 12
#: Radii of poles, and least share of the scatter that a circle explains. [m]
_RADII_M, _CIRCLE_SHARE = (0.04, 0.4), 0.5
#: Error of a pose, which all points of a pass share. [m]
_HIDDEN_M = 0.005


class Standing(NamedTuple):
    """What stands at a support: axis in plan [m], its sigma [m], top [m], its sigma [m], evidence 0 to 1, form."""

    xy: FloatArray
    sigma_xy_m: float
    top_m: float
    sigma_z_m: float
    evidence: float
    form: str


def find_poles(band: CableBand, wires: LineSet, of_wire: BoolArray) -> LineSet:
    """Return the poles and towers at which wires end, each a vertical line from its foot to its top.

    Parameters
    ----------
    wires
        Cables. [m, world]
    of_wire
        (n,) bool: points of the band on a wire.

    Returns
    -------
    LineSet
        Kind "pole", form "pole" or "tower", with `height_m` and sigmas.

    Notes
    -----
    A wire that ends at a wall, in a crown or at the edge of the survey has no pole. Where wires of two spans meet and
    nothing is seen, a pole stands at their meeting, as high as they are, with less confidence.
    """
    if len(wires) == 0:
        return LineSet.empty()
    ends = np.stack([wires.xyz[wires.offsets[:-1]], wires.xyz[wires.offsets[1:] - 1]], axis=1) - band.origin
    hung = hanging(ends)
    support, places = hung.support.reshape(-1), ends.reshape(-1, 3)
    lines, found = [], []
    for number in np.unique(support):
        own = np.flatnonzero(support == number)
        ground = _ground(band, places[own])
        n_spans = len(np.unique(hung.span[own // 2]))
        standing = _standing(band, of_wire, places[own], ground, n_spans)
        if standing is not None and standing.top_m - ground >= FOOT_M:
            height = round(float(standing.top_m - ground), 4)
            foot = np.array([*standing.xy, ground]) + band.origin
            lines.append(np.stack([foot, foot + np.array([0.0, 0.0, height])]))
            sure = standing.evidence * float(wires.confidence[own // 2].max())
            found.append((standing, height, sure))
    if not lines:
        return LineSet.empty()
    order = sorted(range(len(lines)), key=lambda i: tuple(lines[i][0]))
    lines, found = [lines[i] for i in order], [found[i] for i in order]
    return LineSet.from_lines(
        lines,
        kind=[POLE] * len(lines),
        method=["radon"] * len(lines),
        form=[s.form for s, _, _ in found],
        height_m=[height for _, height, _ in found],
        confidence=[sure for _, _, sure in found],
        sigma_xy_m=np.repeat([s.sigma_xy_m for s, _, _ in found], 2),
        sigma_z_m=np.repeat([s.sigma_z_m for s, _, _ in found], 2),
    )


def without_repeats(poles: LineSet) -> LineSet:
    """Return the poles of all tiles, each once: two tiles may both have one at the edge of their cores."""
    feet = poles.xyz[poles.offsets[:-1]]
    near: list[set[int]] = [set() for _ in feet]
    for i, j in cKDTree(feet[:, :2]).query_pairs(AIR_M[0]):
        near[i].add(j)
        near[j].add(i)
    kept: set[int] = set()
    for i in np.lexsort((*feet.T[::-1], -poles.confidence)).tolist():
        if kept.isdisjoint(near[i]):
            kept.add(i)
    return poles.take(sorted(kept))


def _ground(band: CableBand, places: FloatArray) -> float:
    """Return the height of the ground below the ends (k, 3) of wires [m]: the median of that below the points near them."""
    x, y = places[:, :2].mean(axis=0).tolist()
    for reach in (POLE_REACH_M, 4.0 * POLE_REACH_M, 16.0 * POLE_REACH_M):
        near = band.near(np.array([x, y, 1.0, 0.0, -reach, reach]), reach)
        if len(near):
            return float(np.median(band.xyz[near, 2] - band.height_m[near]))
    return math.nan


def _standing(
    band: CableBand, of_wire: BoolArray, places: FloatArray, ground_m: float, n_spans: int
) -> Standing | None:
    """Return what stands at the ends (k, 3) of wires of `n_spans` spans, or None."""
    if math.isnan(ground_m):
        return None
    middle, top = (places[:, :2].min(axis=0) + places[:, :2].max(axis=0)) / 2.0, float(places[:, 2].max())
    half = float(np.hypot(*(places[:, :2] - middle).T).max())
    reach = half + max(POLE_REACH_M, TOWER_AIR_M[1])
    near = band.near(np.array([*middle, 1.0, 0.0, -reach, reach]), reach)
    near = near[~of_wire[near]]
    xyz = band.xyz[near]
    xyz = xyz[(xyz[:, 2] >= ground_m + FOOT_M) & (xyz[:, 2] <= top + TOWER_PEAK_M)]
    xyz = xyz[np.lexsort(xyz.T)]
    away = np.hypot(*(xyz[:, :2] - middle).T)
    meeting = MEETING if n_spans > 1 else 0.0
    for_pole = (away <= half + POLE_REACH_M + AIR_M[1]) & (xyz[:, 2] <= top + CROSSARM_M)
    seen = _pole(xyz[for_pole], middle, half + POLE_REACH_M, ground_m + FOOT_M, top)
    if seen is None and len(places) >= TOWER_WIRES and top - ground_m >= TOWER_M:
        seen = _tower(xyz, away, half, (ground_m + top) / 2.0, top)
    if seen is not None:
        return seen._replace(evidence=1.0 - (1.0 - seen.evidence) * (1.0 - meeting))
    if n_spans < 2:
        return None
    # Nothing is seen: as much as is known from the wires
    return Standing(places[:, :2].mean(axis=0), half + POLE_HALF_M, top, math.nan, meeting, "pole")


def _pole(xyz: FloatArray, middle: FloatArray, reach_m: float, low_m: float, top_m: float) -> Standing | None:
    """Return the pole among points (n, 3) within `reach_m` of a place (2,), from `low_m` up to the wires; or None."""
    n_levels = int((top_m - low_m) // POLE_LEVEL_M)
    if n_levels < LEAST_LEVELS or len(xyz) < LEAST_LEVELS:
        return None
    level = np.floor((xyz[:, 2] - low_m) / POLE_LEVEL_M).astype(np.int64)
    best: tuple[float, FloatArray] | None = None
    for start in _columns(xyz, level, n_levels, middle):
        axis = start
        for _ in range(3):
            inside = np.hypot(*(xyz[:, :2] - axis).T) <= POLE_HALF_M
            if not inside.any():
                break
            axis = np.median(xyz[inside, :2], axis=0)
        away = np.hypot(*(xyz[:, :2] - axis).T)
        on = (away <= POLE_HALF_M) & (level < n_levels)
        seen = len(np.unique(level[on])) / n_levels
        below = xyz[:, 2] <= top_m - CROSSARM_M
        n_below = max(int((top_m - CROSSARM_M - low_m) // POLE_LEVEL_M), 1)
        about = (away > AIR_M[0]) & (away <= AIR_M[1]) & below
        ring = len(np.unique(level[about])) / n_below
        if ring > MOST_AIR_SEEN and _is_beside(xyz[about, :2] - axis):
            ring = MOST_AIR_SEEN
        if seen < LEAST_SEEN or ring > MOST_AIR_SEEN or np.hypot(*(axis - middle)) > reach_m:
            continue
        evidence = seen * (1.0 - ring)
        if best is None or evidence > best[0]:
            best = evidence, axis
    if best is None:
        return None
    evidence, axis = best
    own = xyz[np.hypot(*(xyz[:, :2] - axis).T) <= POLE_HALF_M]
    xy, sigma = _axis(own[own[:, 2] <= top_m - 2.0 * POLE_LEVEL_M, :2], axis)
    heights = np.sort(own[:, 2])
    step = float(heights[-1] - heights[-min(5, len(heights))])
    # Nothing above the highest point was hit: the end is up to a usual step above it
    return Standing(xy, sigma, max(float(heights[-1]), top_m), math.hypot(step, _HIDDEN_M), evidence, "pole")


def _is_beside(off: FloatArray) -> bool:
    """Return whether points at offsets (n, 2) from a pole are all on one side, as those of a wall behind it."""
    return float(np.hypot(*(off / np.hypot(*off.T)[:, None]).mean(axis=0))) >= ONE_SIDE


def _columns(xyz: FloatArray, level: IntArray, n_levels: int, middle: FloatArray) -> list[FloatArray]:
    """Return the middles (2,) of the cells in whose neighbourhood enough levels have points (n, 3), the nearest ones."""
    cell = np.floor(xyz[:, :2] / POLE_CELL_M).astype(np.int64)
    low = level < n_levels
    rows = [
        np.column_stack([cell[low] + np.array([dx, dy]), level[low]])
        for dx in (-1, 0, 1)
        for dy in (-1, 0, 1)
    ]
    cells, counts = np.unique(np.unique(np.concatenate(rows), axis=0)[:, :2], axis=0, return_counts=True)
    cells = cells[counts >= LEAST_SEEN * n_levels]
    order = np.lexsort((*cells.T, np.hypot(*((cells + 0.5) * POLE_CELL_M - middle).T).round(6)))
    chosen: list[FloatArray] = []
    for i in order.tolist():
        place = (cells[i] + 0.5) * POLE_CELL_M
        if len(chosen) < _TRIED and all(np.hypot(*(place - other)) > 2.0 * POLE_CELL_M for other in chosen):
            chosen.append(place)
    return chosen


def _axis(xy: FloatArray, start: FloatArray) -> tuple[FloatArray, float]:
    """Return the axis of a round pole by its points (n, 2) [m], and its sigma [m].

    A scanner sees one side: the axis is the centre of the circle through the points (Kasa 1976,
    doi:10.1109/TIM.1976.6312298), where a circle explains half of their scatter; otherwise their mean.
    """
    if len(xy) < 2:
        return start, POLE_HALF_M
    mean = xy.mean(axis=0)
    d = xy - mean
    scatter = math.sqrt(float((d**2).sum()) / len(xy))
    terms = np.column_stack([d, np.ones(len(xy))])
    found, _, rank, _ = np.linalg.lstsq(terms, (d**2).sum(axis=1), rcond=None)
    if rank == terms.shape[1]:
        centre = found[:2] / 2.0
        radius = math.sqrt(max(float(found[2] + centre @ centre), 0.0))
        left = np.hypot(*(d - centre).T) - radius
        rms = math.sqrt(float((left**2).mean()))
        if _RADII_M[0] <= radius <= _RADII_M[1] and rms <= _CIRCLE_SHARE * scatter:
            inverse = np.linalg.inv(terms.T @ terms)
            spread = 2.0 * radius * rms * math.sqrt(float(inverse[0, 0] + inverse[1, 1])) / 2.0
            return mean + centre, math.hypot(spread, _HIDDEN_M)
    return mean, math.hypot(scatter, _HIDDEN_M)


def _tower(xyz: FloatArray, away: FloatArray, half_m: float, low_m: float, top_m: float) -> Standing | None:
    """Return the tower whose upper half stands clear among points (n, 3) at distances (n,) from its middle; or None."""
    n_levels = int((top_m - low_m) // TOWER_LEVEL_M)
    level = np.floor((xyz[:, 2] - low_m) / TOWER_LEVEL_M).astype(np.int64)
    upper = (level >= 0) & (level < n_levels)
    on = upper & (away <= half_m + POLE_REACH_M)
    about = upper & (away > half_m + TOWER_AIR_M[0]) & (away <= half_m + TOWER_AIR_M[1])
    seen, ring = (len(np.unique(level[chosen])) / max(n_levels, 1) for chosen in (on, about))
    if seen < LEAST_SEEN or ring > MOST_AIR_SEEN:
        return None
    middles = np.array([xyz[on & (level == k), :2].mean(axis=0) for k in np.unique(level[on])])
    xy = np.median(middles, axis=0)
    sigma = math.sqrt(float(((middles - xy) ** 2).sum()) / len(middles) / max(len(middles) - 1, 1))
    own = xyz[away <= half_m + POLE_REACH_M, 2]
    heights = np.sort(own)
    step = float(heights[-1] - heights[-min(5, len(heights))])
    return Standing(
        xy, math.hypot(sigma, _HIDDEN_M), max(float(heights[-1]), top_m), math.hypot(step, _HIDDEN_M), seen * (1.0 - ring), "tower"
    )  # fmt: skip
