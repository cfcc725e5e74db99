"""Figures of lines in plan, over the intensity of the ground or the point density."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.errors import extra_needed
from linework.evaluation.report.scores_figure import WIDTH_IN, main_direction, panel_height, turned_in_plan
from linework.imaging.brightness import brightness_picture, near_ground
from linework.imaging.picture import draw_north_arrow, draw_scale_bar
from linework.model.grid import Bounds
from linework.model.lines import KINDS, POLE, LineSet
from linework.model.points import Points

with extra_needed("reports"):
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

#: A colour per kind; they differ for most eyes, on white as on grey.
COLOURS = dict(
    zip(
        (*KINDS, POLE),
        (
            "#e8b100",
            "#f0d060",
            "#ff7f0e",
            "#e0218a",
            "#f7a8d0",
            "#8a9a2b",
            "#d62728",
            "#7f3fbf",
            "#2a9d8f",
            "#1667c4",
            "#784614",
        ),
        strict=True,
    )
)
#: The colour of kinds that are not ours.
_OTHER_COLOUR = "#444444"
#: Diameter of the disc of a pole, which has no length in plan. [points]
_POLE_POINTS = 5.0
#: Cells along the longer side of a plan: a screen shows no more.
_PLAN_CELLS = 1400
#: Most points drawn in a plan; it does not gain from more.
_PLAN_POINTS = 4_000_000
#: Width and height of a close-up [m]: paint 12 cm wide is 4 pixels there.
_CLOSE_UP_M = (36.0, 15.0)
#: Close-ups in a figure: beginning, middle and end of the road.
_N_CLOSE_UPS = 3

Box = tuple[tuple[float, float], tuple[float, float]]
#: Reads all points within bounds.
PointsIn = Callable[[Bounds], Points]


@dataclass(frozen=True, slots=True)
class PlanView:
    """The axes of a plan, rotated so that the road runs along it, about an origin near the lines.

    Parameters
    ----------
    origin
        (2,) [m, world].
    turn
        Angle of the first axis, anticlockwise from east. [rad]
    """

    origin: FloatArray
    turn: float

    @classmethod
    def of(cls, positions: FloatArray) -> PlanView:
        """Return the view along the main direction of positions (k, 2) [m, world]."""
        if len(positions) == 0:
            return cls(np.zeros(2), 0.0)
        origin = np.floor(positions.mean(axis=0))
        return cls(origin, main_direction([positions[:: max(1, len(positions) // 10_000)] - origin]))

    def in_plan(self, positions: FloatArray) -> FloatArray:
        """Return positions (k, 2) [m, world] in the axes of the plan, (k, 2) [m]."""
        return turned_in_plan(positions - self.origin, self.turn)

    def bounds(self, box: Box) -> Bounds:
        """Return the bounds [m, world] that hold a box of the plan."""
        corners = np.array([(x, y) for x in box[0] for y in box[1]])
        world = turned_in_plan(corners, -self.turn) + self.origin
        (west, south), (east, north) = world.min(axis=0), world.max(axis=0)
        return Bounds(float(west), float(south), float(east), float(north))


def plan_figure(lines: LineSet, points: Points | None) -> Figure:
    """Return a plan of all lines over the points, rotated so that the road runs from left to right."""
    view, box = _view_of(lines, points)
    figure = Figure(figsize=(WIDTH_IN, panel_height(box) + 0.5), layout="constrained", dpi=110)
    ax = figure.subplots()
    if points is not None and len(points):
        # An even sample of a large cloud shows the same pattern
        _draw_ground(ax, points.take(slice(None, None, max(1, len(points) // _PLAN_POINTS))), view, box)
    _draw_lines(ax, lines, view, box, 1.4)
    draw_scale_bar(ax)
    draw_north_arrow(ax, math.degrees(view.turn))
    _draw_legend(figure, lines)
    return figure


def close_up_figure(lines: LineSet, points: Points, points_in: PointsIn) -> Figure | None:
    """Return close-ups large enough to show the width of paint; None where the plan itself is.

    Parameters
    ----------
    points
        An even sample of all points: close-ups are where points are, whether lines were found or not.
    points_in
        Returns all points within bounds.
    """
    view, whole = _view_of(lines, points)
    if len(points) == 0 or whole[0][1] - whole[0][0] < 1.5 * _CLOSE_UP_M[0]:
        return None
    boxes = _close_up_boxes(view.in_plan(lines.xyz[:, :2]), view.in_plan(_few(points)))
    height = WIDTH_IN * _CLOSE_UP_M[1] / _CLOSE_UP_M[0]
    figure = Figure(figsize=(WIDTH_IN, height * len(boxes) + 0.5), layout="constrained", dpi=110)
    for ax, box in zip(figure.subplots(len(boxes), 1, squeeze=False)[:, 0], boxes, strict=True):
        near = points_in(view.bounds(box))
        if len(near):
            _draw_ground(ax, near, view, box)
        _draw_lines(ax, lines, view, box, 0.9)
        draw_scale_bar(ax)
        draw_north_arrow(ax, math.degrees(view.turn))
    _draw_legend(figure, lines)
    return figure


def _few(points: Points) -> FloatArray:
    """Return (k, 2) positions [m, world] of an even sample of the points, enough for their extent."""
    return points.xyz[:: max(1, len(points) // 100_000), :2]


def _view_of(lines: LineSet, points: Points | None) -> tuple[PlanView, Box]:
    """Return the view along the lines, or along the points where there are none, and the extent of both.

    A tenth of the points is omitted at each side: a scanner reaches far beyond the road.
    """
    positions, cloud = lines.xyz[:, :2], np.zeros((0, 2)) if points is None else _few(points)
    view = PlanView.of(positions if len(positions) else cloud)
    corners = [view.in_plan(positions)]
    if len(cloud):
        corners.append(np.quantile(view.in_plan(cloud), [0.1, 0.9], axis=0))
    inside = np.concatenate(corners)
    if len(inside) == 0:
        return view, ((-10.0, 10.0), (-5.0, 5.0))
    (x0, y0), (x1, y1) = inside.min(axis=0), inside.max(axis=0)
    margin = max(0.04 * (x1 - x0), 6.0)
    return view, ((float(x0 - margin), float(x1 + margin)), (float(y0 - margin), float(y1 + margin)))


def _close_up_boxes(lines: FloatArray, cloud: FloatArray) -> tuple[Box, ...]:
    """Return boxes spread evenly over the points along the plan, each centred on the lines there, if any."""
    half_m, boxes = np.array(_CLOSE_UP_M) / 2, []
    for along in np.quantile(cloud[:, 0], (np.arange(_N_CLOSE_UPS) + 0.5) / _N_CLOSE_UPS, method="nearest"):
        beside = lines[np.abs(lines[:, 0] - along) < half_m[0], 1]
        if len(beside) == 0:
            beside = cloud[np.abs(cloud[:, 0] - along) < half_m[0], 1]
        middle = np.array([along, np.median(beside)])
        (x0, y0), (x1, y1) = (middle - half_m).tolist(), (middle + half_m).tolist()
        boxes.append(((x0, x1), (y0, y1)))
    return tuple(dict.fromkeys(boxes))


def _draw_ground(ax: Axes, points: Points, view: PlanView, box: Box) -> None:
    cell_m = max(box[0][1] - box[0][0], box[1][1] - box[1][0]) / _PLAN_CELLS
    extent = (*box[0], *box[1])
    if points.intensity is None:
        _draw_density(ax, view.in_plan(points.xyz[:, :2]), box, cell_m)
        return
    low = points.take(near_ground(points.xyz))
    assert low.intensity is not None
    # No pixel smaller than the spacing of points
    picture = brightness_picture(view.in_plan(low.xyz[:, :2]), low.intensity, box, max(cell_m, 0.04))
    ax.set_facecolor("#e9e9e4")
    ax.imshow(
        picture, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=1.0, interpolation="antialiased"
    )


def _draw_density(ax: Axes, cloud: FloatArray, box: Box, cell_m: float) -> None:
    (x0, x1), (y0, y1) = box
    n_cols, n_rows = max(1, round((x1 - x0) / cell_m)), max(1, round((y1 - y0) / cell_m))
    counts, _, _ = np.histogram2d(cloud[:, 1], cloud[:, 0], bins=(n_rows, n_cols), range=((y0, y1), (x0, x1)))
    # Logarithmic, since densities fall with the square of the distance
    ax.imshow(
        np.log1p(counts), origin="lower", extent=(x0, x1, y0, y1), cmap="Greys", interpolation="antialiased",
        vmax=float(np.log1p(np.percentile(counts[counts > 0], 99))) * 1.6 if (counts > 0).any() else 1.0,
    )  # fmt: skip


def _draw_lines(ax: Axes, lines: LineSet, view: PlanView, box: Box, width: float) -> None:
    """Draw lines in the colours of their kinds, bridged stretches dotted, kerb tops beneath kerb feet."""
    order = np.argsort(lines.kind != "kerb_top", kind="stable").tolist()
    for is_bridged, style in ((False, "solid"), (True, (0, (1.0, 1.6)))):
        runs, colours = [], []
        for i in order:
            positions = view.in_plan(lines[i].xyz[:, :2])
            bridged = lines.bridged[lines.offsets[i] : lines.offsets[i + 1]]
            own = _runs(positions, (bridged[:-1] | bridged[1:]) == is_bridged)
            runs += own
            colours += [COLOURS.get(str(lines.kind[i]), _OTHER_COLOUR)] * len(own)
        ax.add_collection(LineCollection(runs, colors=colours, linewidths=width, linestyles=[style]))
    feet = view.in_plan(lines.xyz[lines.offsets[:-1][lines.kind == POLE], :2])
    ax.plot(*feet.T, "o", color=COLOURS[POLE], ms=_POLE_POINTS, mec="white", mew=0.5)
    ax.set(xlim=box[0], ylim=box[1], aspect="equal", xticks=[], yticks=[])


def _runs(positions: FloatArray, chosen: Sequence[bool] | np.ndarray) -> list[FloatArray]:
    """Return the stretches of a line (n, 2) formed by the chosen segments (n - 1,) bool."""
    index = np.flatnonzero(chosen)
    groups = np.split(index, np.flatnonzero(np.diff(index) > 1) + 1) if len(index) else []
    return [positions[run[0] : run[-1] + 2] for run in groups]


def _draw_legend(figure: Figure, lines: LineSet) -> None:
    there = set(lines.kind.tolist())
    handles = [
        Line2D([], [], color=COLOURS.get(kind, _OTHER_COLOUR), lw=3, label=kind.replace("_", " "))
        for kind in (*KINDS, *sorted(there - set(KINDS)))
        if kind in there
    ]
    if lines.bridged.any():
        handles.append(Line2D([], [], color=_OTHER_COLOUR, lw=1.5, ls=(0, (1.0, 1.6)), label="bridged"))
    if handles:
        figure.legend(
            handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False, fontsize=9
        )
