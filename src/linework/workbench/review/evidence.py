"""The evidence of an item of the queue: what the points across and along its line show."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray, distance_along
from linework.workbench.review.fits import AcrossFit, middle_of_points, step_across, stripe_across
from linework.workbench.views.points import MOST_SECTION_POINTS
from linework.workbench.views.straightened import StraightAxis, points_along
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

#: Stretch about the place of an item that counts, to each side: farther off, another thing may be wrong. [m]
EVIDENCE_REACH_M = 15.0
#: Distance to each side of the line that is shown, by what the line is. [m]
_PAINT_M, _STEP_M, _STANDS_M = 0.6, 0.75, 0.6
#: Points within this height of the road lie on it, as in `paint`; within this, they belong to the ground about a kerb. [m]
_ON_ROAD_M, _NEAR_ROAD_M = 0.10, 0.5
#: Points within this distance of what stands or hangs belong to it: half a guardrail's beam, and noise. [m]
_BELONGS_M = 0.20
#: Intensity of asphalt in patches, and brightest paint relative to it, as in `paint`.
_ASPHALT, _BRIGHTEST = 1000.0, 6.0
#: Distance of the stations along a line. [m]
_STATION_M = 1.0
#: Points that are drawn, at most: more than a picture of its size can tell apart.
_MOST_DRAWN = 600
_PAINTED = ("lane_marking", "lane_marking_dash", "road_marking_other")
_STEPS = ("road_boundary", "kerb_top")


def evidence_at(
    session: SurveySession,
    kind: str,
    xyz: FloatArray,
    place: tuple[float, float],
    is_missing: bool = False,
    beyond: bool = False,
) -> dict[str, Any]:
    """Return the evidence as a document: `across` with points, fit and residuals; `along` by chainage; `facts` in words.

    Parameters
    ----------
    xyz
        (n, 3) vertices of the line; of the van's path for a line that is missing beside it. [m, world]
    place
        East and north. [m, world]
    beyond
        Look beyond the end of the line that is nearer to the place, straight on, and not along the line.
    """
    reader = patch_reader(session)
    plain = kind.removesuffix("_stereo")
    reach_m = _PAINT_M if plain in _PAINTED else _STEP_M if plain in _STEPS else _STANDS_M
    axis = StraightAxis.of(xyz)
    at_m, beside_m = _nearest(axis, place)
    off_m = beside_m if is_missing else 0.0
    length_m = float(distance_along(xyz[:, :2])[-1])
    stretch = max(at_m - EVIDENCE_REACH_M, 0.0), min(at_m + EVIDENCE_REACH_M, length_m)
    if beyond:
        stretch = (
            (-EVIDENCE_REACH_M, 0.0) if at_m < 0.5 * length_m else (length_m, length_m + EVIDENCE_REACH_M)
        )
    if reader is None or stretch[1] - stretch[0] < _STATION_M:
        return {"across": None, "along": None, "facts": []}
    parts = points_along(reader, axis, stretch, abs(off_m) + reach_m, MOST_SECTION_POINTS)
    points = np.concatenate([np.zeros((0, 3)), *(part.xyz.astype(np.float64) for part in parts)])
    above = np.concatenate([np.zeros(0), *(part.above.astype(np.float64) for part in parts)])
    bright = np.concatenate([np.zeros(0), *(part.intensity.astype(np.float64) for part in parts)])
    s, offset = points[:, 0] + stretch[0], points[:, 1] - off_m
    near = np.abs(offset) <= reach_m
    along_m = distance_along(xyz[:, :2])
    # Heights are counted from the line; of a missing one, from the road
    rise = above if is_missing else points[:, 2] + reader.z0_m - np.interp(s, along_m, xyz[:, 2])
    if plain in _PAINTED:
        near &= ~(np.abs(above) > _ON_ROAD_M)
        value = np.minimum(bright / _ASPHALT, _BRIGHTEST)
        return _painted(s[near], offset[near], value[near], stretch)
    if plain in _STEPS:
        near &= ~(np.abs(above) > _NEAR_ROAD_M) & np.isfinite(rise)
        return _stepped(s[near], offset[near], rise[near], stretch)
    near &= np.isfinite(rise) & (np.abs(rise) <= reach_m)
    return _standing(s[near], offset[near], rise[near], stretch)


def _painted(
    s: FloatArray, offset: FloatArray, value: FloatArray, stretch: tuple[float, float]
) -> dict[str, Any]:
    fit = stripe_across(offset, value)
    half_m = 0.06 if fit is None else 0.5 * fit.width_m
    facts = [["Paint", "no stripe stands out"]]
    if fit is not None:
        facts = [
            ["Stripe", f"{100 * fit.width_m:.0f} cm wide, {_side(fit.at_m)}"],
            # Not their ratio: beside paint there is next to nothing where a survey leaves dark intensities out
            ["Contrast", f"{fit.fitted.max():.2f} on it, {fit.fitted.min():.2f} beside it (asphalt: 1)"],
            ["The stripe explains", f"{100 * fit.explained:.0f} % of the differences across"],
            ["Residual", f"{fit.residual:.2f} x asphalt"],
        ]
    on = np.abs(offset - (0.0 if fit is None else fit.at_m)) <= half_m
    return {
        "across": _across("Brightness (asphalt = 1)", offset, value, fit),
        "along": _along("Brightness on the line", s[on], value[on], stretch),
        "facts": facts,
    }


def _stepped(
    s: FloatArray, offset: FloatArray, rise: FloatArray, stretch: tuple[float, float]
) -> dict[str, Any]:
    fit = step_across(offset, rise)
    facts = [["Ground", "too few points across"]]
    where = 0.0
    if fit is not None:
        where = fit.at_m
        facts = [
            ["Step", f"{100 * abs(fit.size):.1f} cm, higher to the {'right' if fit.size > 0 else 'left'}, {_side(fit.at_m)}"],
            ["The step explains", f"{100 * fit.explained:.0f} % of what even ground leaves"],
            ["Residual", f"{1000 * fit.residual:.0f} mm"],
        ]  # fmt: skip
    steps = []
    for station in _stations(stretch):
        here = np.abs(s - station) <= 0.5 * _STATION_M
        left, right = here & (offset < where - 0.1), here & (offset > where + 0.1)
        if min(left.sum(), right.sum()) >= 3:
            steps.append([round(station, 2), round(float(np.median(rise[right]) - np.median(rise[left])), 4)])
    return {
        "across": _across("Height from the line [m]", offset, rise, fit),
        "along": {"label": "Step [m]", "values": steps, "stretch": [round(v, 2) for v in stretch]},
        "facts": facts,
    }


def _standing(
    s: FloatArray, offset: FloatArray, rise: FloatArray, stretch: tuple[float, float]
) -> dict[str, Any]:
    own, off_m, up_m = middle_of_points(offset, rise, _BELONGS_M)
    stations = _stations(stretch)
    hit = {round(float(v)) for v in np.floor(s[own] / _STATION_M)}
    n_hit = len({round(float(v)) for v in np.floor(stations / _STATION_M)} & hit)
    facts = [["Points", "none within 20 cm of the line"]]
    if own.any():
        rms_m = float(np.sqrt(np.mean((offset[own] - off_m) ** 2 + (rise[own] - up_m) ** 2)))
        facts = [
            ["Points within 20 cm", f"{int(own.sum()):,}, in {n_hit} of {len(stations)} metres"],
            [
                "Their middle",
                f"{_side(off_m)}, {100 * abs(up_m):.0f} cm {'above' if up_m > 0 else 'below'} it",
            ],
            ["Their spread", f"{100 * rms_m:.0f} cm"],
        ]
    across = _across("Height from the line [m]", offset, rise, None)
    across["middle"] = [round(off_m, 3), round(up_m, 3)] if own.any() else None
    return {
        "across": across,
        "along": _along("Height from the line [m]", s[own], rise[own], stretch),
        "facts": facts,
    }


def _nearest(axis: StraightAxis, place: tuple[float, float]) -> tuple[float, float]:
    """Return the chainage of a place, and its offset to the right; the middle of the axis for one far away. [m]"""  # noqa: D400
    (at_m,), (offset_m,) = axis.on_axis(np.array([place]), 50.0)
    if np.isnan(at_m):
        return 0.5 * float(axis.along_m[0] + axis.along_m[-1]), 0.0
    return float(at_m), float(offset_m)


def _across(label: str, offset: FloatArray, value: FloatArray, fit: AcrossFit | None) -> dict[str, Any]:
    chosen = _drawn(len(offset))
    empty = np.zeros(0)
    bins, fitted, measured = (empty, empty, empty) if fit is None else (fit.offset_m, fit.fitted, fit.value)
    return {
        "label": label,
        "points": np.column_stack([offset[chosen], value[chosen]]).round(3).tolist(),
        "bins": np.column_stack([bins, measured]).round(4).tolist(),
        "fit": np.column_stack([bins, fitted]).round(4).tolist(),
        "residuals": np.column_stack([bins, measured - fitted]).round(4).tolist(),
        "middle": None,
    }


def _along(label: str, s: FloatArray, value: FloatArray, stretch: tuple[float, float]) -> dict[str, Any]:
    values = []
    for station in _stations(stretch):
        here: BoolArray = np.abs(s - station) <= 0.5 * _STATION_M
        if here.any():
            values.append([round(float(station), 2), round(float(value[here].mean()), 4)])
    return {"label": label, "values": values, "stretch": [round(v, 2) for v in stretch]}


def _stations(stretch: tuple[float, float]) -> FloatArray:
    return np.arange(stretch[0] + 0.5 * _STATION_M, stretch[1], _STATION_M)


def _drawn(n: int) -> FloatArray:
    """Return which of n points are drawn: evenly spread over their order."""
    return np.unique(np.linspace(0, max(n - 1, 0), min(n, _MOST_DRAWN)).astype(np.int64))


def _side(offset_m: float) -> str:
    """Return an offset in words."""
    if abs(offset_m) < 0.005:
        return "on the line"
    return f"{100 * abs(offset_m):.0f} cm {'right' if offset_m > 0 else 'left'} of the line"
