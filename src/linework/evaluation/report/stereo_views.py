"""Figures of lines drawn into the stereo pairs that show them.

Separate from page.py, as it projects lines into images, which surveys without cameras do not need.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, IntArray, distance_along
from linework.errors import extra_needed
from linework.evaluation.report.plan import COLOURS
from linework.evaluation.report.scores_figure import WIDTH_IN
from linework.model.camera import RectifiedRig
from linework.model.images import Poses, RectifiedPair
from linework.model.lines import LineSet

with extra_needed("reports"):
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

#: Least and greatest distance ahead of the cameras at which lines are drawn [m]: nearer they are below the image,
#: farther they are thinner than a pixel.
_VIEW_DEPTH_M = (1.0, 60.0)
#: Pairs shown in a report: beginning, middle and end of the drive.
_N_VIEWS = 3
#: Spacing of the points of a line that are projected [m]: a bend stays smooth in the image.
_STEP_M = 0.25


@dataclass(frozen=True, slots=True)
class StereoViews:
    """Stereo pairs to draw lines into.

    Parameters
    ----------
    poses
        Pose i belongs to pair ``numbers[i]``.
    read
        Returns a pair by its number; may raise InputError.
    """

    poses: Poses
    numbers: IntArray
    read: Callable[[int], RectifiedPair]


def in_image(
    xyz_world: FloatArray, poses: Poses, i: int, rig: RectifiedRig
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return left columns, right columns and rows, each (k,) [pixels], of points along a line; NaN out of view.

    Parameters
    ----------
    xyz_world
        (n, 3) vertices of the line. [m, world]
    i
        Index of the pose of the pair.
    """
    along = distance_along(xyz_world, in_space=True)
    at = np.linspace(0.0, along[-1], max(int(along[-1] / _STEP_M), 1) + 1)
    dense = np.stack([np.interp(at, along, column) for column in xyz_world.T], axis=1)
    near = np.linalg.norm(dense - poses.xyz[i], axis=1) < 2.0 * _VIEW_DEPTH_M[1]
    col, row, disparity = rig.project(np.where(near[:, None], poses.to_vehicle(i, dense), np.nan))
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = rig.focal_px * rig.base_m / disparity
        visible = (depth > _VIEW_DEPTH_M[0]) & (depth < _VIEW_DEPTH_M[1]) & (row > -1.0) & (row < rig.height)
    return (
        np.where(visible & (col > -1.0) & (col < rig.width), col, np.nan),
        np.where(visible & (col - disparity > -1.0) & (col - disparity < rig.width), col - disparity, np.nan),
        np.where(visible, row, np.nan),
    )


def views_figure(views: StereoViews, lines: LineSet, numbers: Sequence[int]) -> Figure:
    """Return a figure of the lines in both images of the pairs `numbers`, a row per pair.

    Raises
    ------
    InputError
        A pair cannot be read.
    """
    pairs = [views.read(number) for number in numbers]
    height = sum(0.5 * WIDTH_IN * pair.rig.height / pair.rig.width + 0.25 for pair in pairs) + 0.3
    figure = Figure(figsize=(WIDTH_IN, height), layout="constrained", dpi=140)
    panels = figure.subplots(len(pairs), 2, squeeze=False)
    drawn = set()
    for row, (pair, number) in enumerate(zip(pairs, numbers, strict=True)):
        i = int(np.flatnonzero(views.numbers == number)[0])
        for ax, image in zip(panels[row], (pair.left, pair.right), strict=True):
            ax.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="nearest")
            ax.set(xticks=[], yticks=[])
        panels[row, 0].set_title(f"pair {number}, {pair.time_s:.2f} s", loc="left", fontsize=8)
        for k in range(len(lines)):
            left, right, rows = in_image(lines[k].xyz, views.poses, i, pair.rig)
            kind = str(lines.kind[k]).removesuffix("_stereo")
            if np.isfinite(left).any():
                drawn.add(kind)
            for ax, cols in zip(panels[row], (left, right), strict=True):
                _draw(ax, cols, rows, kind)
    handles = [
        Line2D([], [], color=COLOURS.get(kind, "red"), label=kind.replace("_", " ")) for kind in sorted(drawn)
    ]
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False, fontsize=8)
    return figure


def chosen_numbers(lines: LineSet, views: StereoViews) -> list[int]:
    """Return the numbers of the pairs to show, spread evenly over those with a line ahead, or over all."""
    good = [i for i in range(len(views.numbers)) if _has_line_ahead(lines, views.poses, i)]
    candidates = good or list(range(len(views.numbers)))
    picked = np.linspace(0, len(candidates) - 1, min(_N_VIEWS, len(candidates))).round().astype(int)
    return [int(views.numbers[candidates[k]]) for k in picked]


def _has_line_ahead(lines: LineSet, poses: Poses, i: int) -> bool:
    """Return whether a vertex lies ahead of the vehicle, within the distance drawn."""
    near = np.linalg.norm(lines.xyz - poses.xyz[i], axis=1) < _VIEW_DEPTH_M[1]
    ahead = poses.to_vehicle(i, lines.xyz[near])
    return bool(np.any((ahead[:, 0] > 5.0) & (np.abs(ahead[:, 1]) < 10.0)))


def _draw(ax: Axes, cols: FloatArray, rows: FloatArray, kind: str) -> None:
    ax.plot(cols, rows, "-", lw=0.9, color=COLOURS.get(kind, "red"), scalex=False, scaley=False)
