"""Requests to the pictures worker: the edge under the cursor that a line of some kind, drawn by hand, runs along.

Separate from `heights`, which measures how high a place is, not where the edge beside it lies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import UsageError
from linework.methods.templates.across import SOUGHT_M, SOUGHT_OFFSETS_M, USED_M, edge_evidence
from linework.model.grid import Bounds
from linework.model.lines import KINDS
from linework.workbench.views.height_at import MOST_STANDS_M, ground_height, hanging_height, standing_height
from linework.workbench.views.patches import PatchReader
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

#: What a line of a kind runs along, as in `linework.methods.templates.template.NODE_EDGES`. Arrows and bars have their middle
#: for a line, where there is no edge: with that of their paint 21 % of the vertices were right instead of 29 (decision 126).
SNAP_EDGES: dict[str, tuple[str, ...]] = {
    "lane_marking": ("stripe",), "lane_marking_dash": ("stripe",), "road_marking_other": (),
    "road_boundary": ("foot", "break", "shade"), "kerb_top": ("top",), "edge_other": ("foot", "top", "break", "shade"),
    "guardrail": ("rail",), "barrier": ("rail",), "fence": ("rail",), "cable": ("wire",),
}  # fmt: skip
#: Length of the edge that is looked at, on either side of the place: a kerb round a corner of 4 m is straight over it
#: within 1 cm; paint is laid in wider bends, and rails and wires are straight over more and have fewer points. [m]
_HALF_M = {"stripe": 0.6, "rail": 1.0, "wire": 1.0}
_HALF_OF_GROUND_M, _FARTHEST_M = 0.3, 1.0
#: Directions that are tried first, and how often the best one is bettered between its neighbours.
_N_DIRECTIONS, _N_BETTERED = 8, 3
#: Standard deviation of the edge's direction from that of the line drawn so far: a corner is turned in steps. [deg]
_DIRECTION_DEG = 20.0
#: Offsets this close to the likeliest one are one edge [m]; probability that it is there and lies there.
_SAME_EDGE_M, _SURE = 0.05, 0.9
#: Evidence that makes an edge stand out [log]: more of it says nothing of which edge is meant, as the wall behind a kerb,
#: or the better painted of two stripes, shows ten times as much. 400 to 1, before the cursor's place counts.
_STANDS_OUT = 6.0


@dataclass(frozen=True, slots=True)
class _Edge:
    """An edge across a direction: its offset from the place, its height from what was expected, and its evidence [log].

    Parameters
    ----------
    raw, score
        Evidence of the points alone; with that of the cursor, and limited, see `_STANDS_OUT`.
    others
        Sum of the scores of all edges in this direction, this one among them, and of there being none.
    """

    edge: str
    heading_deg: float
    across_m: float
    sigma_m: float
    up_m: float
    raw: float
    score: float
    others: float


def snapped_place(
    session: SurveySession, kind: str, place: tuple[float, float], reach_m: float, heading_deg: float | None
) -> dict[str, Any] | None:
    """Return the place on the edge near a place, or None where no edge is visible within reach.

    Parameters
    ----------
    kind
        Of the line that is drawn.
    place
        East, north [m, world].
    reach_m
        How far off the cursor may be: three standard deviations. [m]
    heading_deg
        Direction of the line drawn so far, clockwise from north; None: unknown. [deg]

    Returns
    -------
    found
        `at` (east, north) and `up` [m, world], `sigma_m` across, `edge` (of `NODE_EDGES`), `heading_deg`.

    Notes
    -----
    Evidence adds up: that of the points for an edge at each offset across each direction, that of the cursor's place and,
    if known, of the line's direction. A place is moved only where the edge is there with 90 %.
    """
    plain = kind.removesuffix("_stereo")
    if plain not in KINDS:
        raise UsageError(f"no kind {kind[:40]!r}")
    reader = patch_reader(session)
    if reader is None:
        return None
    points = _points_about(reader, place)
    level = _level(points, plain)
    if level is None:
        return None
    found = _best(points - np.array([0.0, 0.0, level, 0.0]), plain, min(reach_m, SOUGHT_M), heading_deg)
    if found is None or np.exp(found.score - found.others) < _SURE:
        return None
    heading = np.radians(found.heading_deg)
    at = place[0] + found.across_m * np.cos(heading), place[1] - found.across_m * np.sin(heading)
    return {
        "at": [round(float(at[0]), 4), round(float(at[1]), 4)],
        "up": round(reader.z0_m + level + found.up_m, 4), "sigma_m": round(found.sigma_m, 4), "edge": found.edge,
        "heading_deg": round(found.heading_deg % 180.0, 1),
    }  # fmt: skip


def _points_about(reader: PatchReader, place: tuple[float, float]) -> FloatArray:
    """Return (n, 4) of the points about a place: east and north of it, up from the height origin [m], intensity."""
    bounds = Bounds(*place, *place).grown(USED_M + _FARTHEST_M)
    parts = [np.zeros((0, 4))]
    for patch in reader.patches(bounds):
        x = patch.x.astype(np.float64) + (patch.corner[0] - place[0])
        y = patch.y.astype(np.float64) + (patch.corner[1] - place[1])
        near = np.hypot(x, y) <= USED_M + _FARTHEST_M
        columns = x[near], y[near], patch.z[near].astype(np.float64), patch.intensity[near].astype(np.float64)
        parts.append(np.stack(columns, axis=1))
    points = np.concatenate(parts)
    # The same answer whatever the order of the points
    return np.asarray(points[np.lexsort(points.T)])


def _level(points: FloatArray, kind: str) -> float | None:
    """Return the height of the ground, or of what stands or hangs at a place, from the height origin [m]; None: unknown."""
    local = np.column_stack([points[:, :3], np.full(len(points), np.nan)])
    local = local[np.hypot(local[:, 0], local[:, 1]) <= USED_M]
    if kind == "cable":
        found = hanging_height(local, np.nan)
    elif kind in MOST_STANDS_M:
        found = standing_height(local, MOST_STANDS_M[kind], np.nan)
    else:
        found = ground_height(local)
    return None if found is None else found[0]


def _best(points: FloatArray, kind: str, reach_m: float, heading_deg: float | None) -> _Edge | None:
    """Return the likeliest edge of a kind in any direction; None where the points show nothing.

    First which edge: any that stands out, the nearer the likelier. Then how it runs: as the points show it best.
    """
    step = 180.0 / _N_DIRECTIONS
    first = 0.0 if heading_deg is None else heading_deg

    def edges(edge: str, heading: float) -> list[_Edge]:
        return _across(points, edge, heading, reach_m, heading_deg)

    found = [
        one
        for i in range(_N_DIRECTIONS)
        for edge in SNAP_EDGES[kind]
        for one in edges(edge, first + i * step)
    ]
    if not found:
        return None
    best = max(found, key=lambda one: one.score)
    for _ in range(_N_BETTERED):
        x, y = _at(best)
        beside = [one for turn in (-step, step) for one in edges(best.edge, best.heading_deg + turn)]
        # The same edge, looked at in a direction nearer to its own
        same = [one for one in beside if np.hypot(_at(one)[0] - x, _at(one)[1] - y) <= 2.0 * _SAME_EDGE_M]
        best = max([best, *same], key=lambda one: one.raw - _turned(one.heading_deg, heading_deg))
        step /= 2.0
    return best


def _at(edge: _Edge) -> tuple[float, float]:
    heading = np.radians(edge.heading_deg)
    return float(edge.across_m * np.cos(heading)), float(-edge.across_m * np.sin(heading))


def _turned(heading_deg: float, expected_deg: float | None) -> float:
    """Return what speaks against an edge of a direction [log], by the direction of the line so far."""
    if expected_deg is None:
        return 0.0
    return float(0.5 * (((heading_deg - expected_deg + 90.0) % 180.0 - 90.0) / _DIRECTION_DEG) ** 2)


def _across(
    points: FloatArray, edge: str, heading_deg: float, reach_m: float, expected_deg: float | None
) -> list[_Edge]:
    """Return the edges that points (n, 4) relative to a place show across a direction."""
    sin, cos = np.sin(np.radians(heading_deg)), np.cos(np.radians(heading_deg))
    half_m = _HALF_M.get(edge, _HALF_OF_GROUND_M)
    kept = points[np.abs(points[:, 0] * sin + points[:, 1] * cos) <= half_m]
    evidence = edge_evidence(edge, kept[:, 0] * cos - kept[:, 1] * sin, kept[:, 2], kept[:, 3])
    log, height_m = evidence.log_ratio, np.nan_to_num(evidence.height_m)
    offsets, sigma_m = SOUGHT_OFFSETS_M, reach_m / 3.0
    # Of the places that the cursor may stand for, as many as there are edges that can be told apart
    n_places = max(1.0, np.sqrt(2.0 * np.pi) * sigma_m / (2.0 * _SAME_EDGE_M))
    peaks = []
    for k, stands_out in _peaks(log):
        near = np.abs(offsets - offsets[k]) <= _SAME_EDGE_M
        total = np.logaddexp.reduce(log[near])
        weight = np.exp(log[near] - total)
        at = float(weight @ offsets[near])
        spread = float(np.sqrt(weight @ (offsets[near] - at) ** 2))
        up = float(weight @ height_m[near])
        raw = min(float(total - np.log(near.sum())), stands_out)
        if raw > 0.0:
            score = (
                _STANDS_OUT * (1.0 - np.exp(-raw / _STANDS_OUT))
                - 0.5 * (at / sigma_m) ** 2
                - np.log(n_places)
            )
            peaks.append((at, spread, up, raw, float(score - _turned(heading_deg, expected_deg))))
    others = float(np.logaddexp.reduce([0.0, *(score for *_, score in peaks)]))
    return [
        _Edge(edge, heading_deg, at, spread, up, raw, score, others) for at, spread, up, raw, score in peaks
    ]


def _peaks(log: FloatArray) -> list[tuple[int, float]]:
    """Return the local maxima of evidence (k,), the highest first, and how far each rises above its surroundings.

    The flank of an edge that stands out has much evidence, too, but does not rise.
    """
    is_peak = (log >= np.concatenate([[-np.inf], log[:-1]])) & (log > np.concatenate([log[1:], [-np.inf]]))
    found: list[tuple[int, float]] = []
    for k in sorted(np.flatnonzero(is_peak & (log > 0.0)).tolist(), key=lambda k: -log[k]):
        saddles = [float(log[min(k, other) : max(k, other) + 1].min()) for other, _ in found]
        found.append((k, float(log[k]) - max([0.0, *saddles])))
    return found
