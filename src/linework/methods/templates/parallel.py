"""The lines of a template along a followed line, each at its own edge, station by station."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.lines.along import runs_of
from linework.methods.templates.across import (
    SOUGHT_OFFSETS_M,
    USED_M,
    EdgeEvidence,
    edge_evidence,
    nothing_said,
)
from linework.methods.templates.template import CrossTemplate, TemplateNode
from linework.model.grid import Bounds
from linework.model.lines import LineSet

#: Interval of stations; the points of one are those nearest to it. [m]
TEMPLATE_STATION_M = 0.5
#: Stations that show on which side of the line a template lies.
_FEW_STATIONS = 40
#: Length of line whose points are read together [m]; stations after which `template_steps` lets others speak: half a
#: second of work with twenty nodes.
_PIECE_M, _STEP_STATIONS = 16.0, 4
#: Change of an edge's offset from one station to the next: what is built parallel wanders by 1 cm, and on one of ten
#: thousand stations, 5 km, it begins anew where the template has it (another kerbstone). [m]
_WANDERS_M, _BEGINS_ANEW = 0.01, 1e-4
#: Standard deviation of the offset before the points are seen: a template is clicked on another line of the same make. [m]
_EXPECTED_M = 0.10
#: A station's edge is worth this at most [log]: a wall or another kerb beside it may stand out more, and that an edge stands
#: out says that it is one, not that it is the one sought. Edges nearer to one another than this are one. [m]
_MOST_WORTH, _ONE_EDGE_M = 1.5, 0.05
#: Standard deviation of an edge's height from the template's, and the share of edges that are of another height, as at
#: dropped kerbs: kerbs of one make differ by some centimetres.
_EXPECTED_UP_M, _OTHER_HEIGHT = 0.05, 0.05
#: The same for wires, which sag each in their own way.
_WIRE_UP_M = 0.20
#: A height is not the edge's, but that of a car or a hedge on it, if it is this far from the median of so many stations to
#: either side: a dropped kerb takes a metre to rise by 10 cm. [m]
_UNSTEADY_M, _ABOUT_STATIONS = 0.06, 4
#: An edge is measured at a station whose points make it this likely that it is there. [log odds of 95 %]
_MEASURED = float(np.log(19.0))
#: Error that neighbouring points have in common (calibration, trajectory within a metre), which their spread does not
#: show; and the spacing of the offsets. [m]
_COMMON_M, _SPACING_M = 0.003, 0.01
#: Method of such lines.
TEMPLATE_METHOD = "template"

#: Points of an area: (n, 3) positions [m, world] and (n,) intensities.
AreaPoints = Callable[[Bounds], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, slots=True)
class TemplateLines:
    """The lines of a template beside a line, and the nodes without one.

    Parameters
    ----------
    lines
        In the order of the nodes.
    nodes
        Name of the node of each line.
    unseen
        Names of nodes that the points show nowhere.
    """

    lines: LineSet
    nodes: tuple[str, ...]
    unseen: tuple[str, ...]


#: The work of `template_steps`, which yields while it lasts.
TemplateSteps = Generator[None, object, TemplateLines]


def lines_of_template(line: LineSet, template: CrossTemplate, points_in: AreaPoints) -> TemplateLines:
    """Return the parallel lines of a template, as the points show them.

    Parameters
    ----------
    line
        A single line: the one that the template's nodes are measured from.
    points_in
        Returns the points of an area.

    Returns
    -------
    TemplateLines
        With a vertex every `TEMPLATE_STATION_M`, from the first to the last station where the node's edge was measured; bridged
        between them where it was not. The template is mirrored where the points say so.
    """
    steps = template_steps(line, template, points_in)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: TemplateLines = end.value
            return found


def template_steps(line: LineSet, template: CrossTemplate, points_in: AreaPoints) -> TemplateSteps:
    """Find the lines of a template as `lines_of_template` does, and yield every metre or two, so that it can be left."""
    course = _Course.of(line.xyz)
    n = len(course.at_m)
    few = np.arange(n) if n <= _FEW_STATIONS else np.linspace(0, n - 1, _FEW_STATIONS).astype(np.int64)
    sides = (template.nodes, tuple(node.mirrored for node in template.nodes))
    totals = []
    for side in sides:
        paths = yield from _paths(course, side, points_in, few)
        totals.append(sum(path.total for path in paths))
    nodes = sides[int(totals[1] > totals[0])]
    paths = yield from _paths(course, nodes, points_in, np.arange(n))
    lines, names, unseen = [], [], []
    for node, path in zip(nodes, paths, strict=True):
        made = _fixed(line, course, node) if node.edge == "fixed" else _line(line, course, node, path)
        if made is None:
            unseen.append(node.name)
            continue
        lines.append(made)
        names.append(node.name)
    empty = LineSet.empty(line.crs)
    return TemplateLines(LineSet.concatenate(lines) if lines else empty, tuple(names), tuple(unseen))


def _paths(
    course: _Course, nodes: tuple[TemplateNode, ...], points_in: AreaPoints, stations: IntArray
) -> Generator[None, object, list[_Path]]:
    """Find the path of each node over some stations."""
    seen = [[nothing_said()] * len(stations) for _ in nodes]
    reach_m = max((abs(node.across_m) for node in nodes), default=0.0) + USED_M
    for i, (x, z, bright) in enumerate(_points_of_stations(course, reach_m, points_in, stations)):
        if i % _STEP_STATIONS == 0:
            yield
        for node, of_node in zip(nodes, seen, strict=True):
            if node.edge != "fixed":
                of_node[i] = edge_evidence(node.edge, x - node.across_m, z - node.up_m, bright)
    paths = []
    for node, of_node in zip(nodes, seen, strict=True):
        yield
        paths.append(_Path.of(of_node, _up_sigma(node)))
    return paths


@dataclass(frozen=True, slots=True)
class _Course:
    """Stations along a line: chainage (m,) [m], positions (m, 3) [m, world], unit vectors (m, 2) to the right."""

    at_m: FloatArray
    xyz: FloatArray
    right: FloatArray

    @classmethod
    def of(cls, xyz: FloatArray) -> _Course:
        along = distance_along(xyz[:, :2])
        at = np.linspace(0.0, along[-1], max(round(float(along[-1]) / TEMPLATE_STATION_M), 1) + 1)
        places = np.stack([np.interp(at, along, column) for column in xyz.T], axis=1)
        # The direction over 2 m: vertices of followed lines scatter by millimetres
        ahead, behind = (
            np.stack([np.interp(np.clip(at + d, 0.0, along[-1]), along, c) for c in xyz[:, :2].T], axis=1)
            for d in (1.0, -1.0)
        )
        way = ahead - behind
        way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
        return cls(at, places, np.stack([way[:, 1], -way[:, 0]], axis=1))


def _up_sigma(node: TemplateNode) -> float:
    return _WIRE_UP_M if node.edge == "wire" else _EXPECTED_UP_M


def _points_of_stations(
    course: _Course, reach_m: float, points_in: AreaPoints, stations: IntArray
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield the points of each station: offset to the right, height [m] and brightness."""
    half_m = 0.5 * TEMPLATE_STATION_M
    pieces = np.floor(course.at_m[stations] / _PIECE_M)
    for piece in np.unique(pieces):
        mine = stations[pieces == piece]
        about = course.xyz[mine, :2]
        xyz, bright = points_in(Bounds(*about.min(axis=0), *about.max(axis=0)).grown(reach_m + half_m))
        # In canonical order, so that the lines do not depend on that of the points
        order = np.lexsort((bright, xyz[:, 2], xyz[:, 1], xyz[:, 0]))
        xyz, bright = xyz[order], bright[order].astype(np.float64)
        for k in mine.tolist():
            step, right = xyz - course.xyz[k], course.right[k]
            across = step[:, :2] @ right
            along = step[:, 1] * right[0] - step[:, 0] * right[1]
            near = (np.abs(along) <= half_m) & (np.abs(across) <= reach_m)
            yield across[near], step[near, 2], bright[near]


@dataclass(frozen=True, slots=True)
class _Path:
    """The offset of an edge along a line: by forward and backward sums over all ways it may run.

    Parameters
    ----------
    offset_m, sigma_m
        (m,) from the expected place; mean and standard deviation. [m]
    height_m, height_sigma_m
        (m,) from the expected height; NaN: not measured. [m]
    is_measured
        (m,) bool.
    total
        Log ratio of the edge being there to there being none.
    """

    offset_m: FloatArray
    sigma_m: FloatArray
    height_m: FloatArray
    height_sigma_m: FloatArray
    is_measured: BoolArray
    total: float

    @classmethod
    def of(cls, evidence: list[EdgeEvidence], up_sigma_m: float) -> _Path:
        log = np.stack([one.log_ratio for one in evidence])
        grid = SOUGHT_OFFSETS_M
        apart = grid[:, None] - grid
        start = np.exp(-0.5 * (grid / _EXPECTED_M) ** 2)
        start /= start.sum()
        change = np.exp(-0.5 * (apart / _WANDERS_M) ** 2)
        change = (1.0 - _BEGINS_ANEW) * change / change.sum(axis=1, keepdims=True) + _BEGINS_ANEW * start
        about = _mean_about(log)
        worth = log - about + np.minimum(about, _MOST_WORTH)
        height = np.stack([one.height_m for one in evidence])
        usual = np.exp(-0.5 * (np.nan_to_num(height) / up_sigma_m) ** 2)
        worth += np.log(_OTHER_HEIGHT + (1.0 - _OTHER_HEIGHT) * usual)
        # An edge may be hidden or absent at a station (a dropped kerb): its points then say nothing
        here = 0.5 * np.exp(worth) + 0.5
        forward, backward = np.empty_like(here), np.ones_like(here)
        total = 0.0
        for k in range(len(here)):
            before = start if k == 0 else forward[k - 1] @ change
            forward[k] = before * here[k]
            scale = forward[k].sum()
            total += float(np.log(scale))
            forward[k] /= scale
        for k in range(len(here) - 2, -1, -1):
            backward[k] = change @ (backward[k + 1] * here[k + 1])
            backward[k] /= backward[k].sum()
        found = forward * backward
        found /= found.sum(axis=1, keepdims=True)
        # The mean about the likeliest offset: between two of them is neither
        mode = found.argmax(axis=1)
        near = found * (np.abs(grid - grid[mode][:, None]) <= _ONE_EDGE_M + 0.5 * _SPACING_M)
        offset = (near @ grid) / near.sum(axis=1)
        sigma = np.sqrt(np.sum(found * (grid - offset[:, None]) ** 2, axis=1))
        index = np.clip(np.rint((offset - grid[0]) / _SPACING_M).astype(np.int64), 0, len(grid) - 1)
        rows = np.arange(len(here))
        up = height[rows, index]
        up_sigma = np.stack([one.sigma_m for one in evidence])[rows, index]
        measured = (about[rows, index] > _MEASURED) & (np.abs(up) <= 3.0 * up_sigma_m)
        measured[measured] = _is_steady(up[measured])
        return cls(offset, sigma, up, up_sigma, measured, total)


def _is_steady(up_m: FloatArray) -> BoolArray:
    """Return which heights (n,) of successive stations agree with the median of those about them."""
    if not len(up_m):
        return np.zeros(0, dtype=np.bool_)
    middle = median_filter(up_m, size=2 * _ABOUT_STATIONS + 1, mode="nearest")
    return np.asarray(np.abs(up_m - middle) <= _UNSTEADY_M)


def _mean_about(log: FloatArray) -> FloatArray:
    """Return the log of the mean likelihood ratio (m, k) within `_ONE_EDGE_M` of each offset.

    An edge that is sharply placed is worth as much in all as one that is not.
    """
    n = round(_ONE_EDGE_M / _SPACING_M)
    wide = np.pad(log, ((0, 0), (n, n)), mode="edge")
    shifted = np.stack([wide[:, i : i + log.shape[1]] for i in range(2 * n + 1)])
    return np.asarray(np.logaddexp.reduce(shifted, axis=0) - np.log(2 * n + 1))


def _line(line: LineSet, course: _Course, node: TemplateNode, path: _Path) -> LineSet | None:
    """Return the line along a measured node, None where it was measured at fewer than two stations."""
    known = np.flatnonzero(path.is_measured)
    if len(known) < 2:
        return None
    inside = np.arange(known[0], known[-1] + 1)
    height = np.interp(inside, known, path.height_m[known])
    sigma_z = np.interp(inside, known, path.height_sigma_m[known])
    bridged = ~path.is_measured[inside]
    for first, last in runs_of(bridged):
        # Nothing was measured between: as uncertain as both ends differ
        sigma_z[first : last + 1] += 0.5 * abs(height[last] - height[first])
    xyz = course.xyz[inside].copy()
    xyz[:, :2] += (node.across_m + path.offset_m[inside])[:, None] * course.right[inside]
    xyz[:, 2] += node.up_m + height
    sigma_xy = np.hypot(path.sigma_m[inside], _COMMON_M)
    return _made(line, node, xyz, sigma_xy, np.hypot(sigma_z, _COMMON_M), bridged)


def _fixed(line: LineSet, course: _Course, node: TemplateNode) -> LineSet:
    """Return the line at a node's own distance; as sure as the line it is measured from."""
    xyz = course.xyz.copy()
    xyz[:, :2] += node.across_m * course.right
    xyz[:, 2] += node.up_m
    along = distance_along(line.xyz[:, :2])
    sigma_xy, sigma_z = (
        np.interp(course.at_m, along, column) for column in (line.sigma_xy_m, line.sigma_z_m)
    )
    return _made(line, node, xyz, sigma_xy, sigma_z, np.ones(len(xyz), dtype=np.bool_))


def _made(
    line: LineSet,
    node: TemplateNode,
    xyz: FloatArray,
    sigma_xy: FloatArray,
    sigma_z: FloatArray,
    bridged: BoolArray,
) -> LineSet:
    return LineSet.from_lines(
        [xyz], crs=line.crs, kind=[node.kind], role=[node.role], method=[TEMPLATE_METHOD], sigma_xy_m=sigma_xy,
        sigma_z_m=sigma_z, bridged=bridged,
    )  # fmt: skip
