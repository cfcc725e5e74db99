"""Projection of lines into an original image: clipped to the field of view, then distorted by the lens."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along, offsets_of
from linework.imaging.rectify import directions, distorted
from linework.model.camera import Camera
from linework.model.images import Poses
from linework.model.lines import LineSet

#: Smallest and largest depth: nearer is the van itself, farther a marking is thinner than a pixel. [m]
PROJECTED_DEPTH_M = (0.5, 80.0)
#: Margin around the image in which lines are kept, so that they visibly continue. [pixels]
MARGIN_PX = 16.0
#: Longest part of a straight segment: the lens bends it by far less than a pixel. [pixels]
_STEP_PX = 16.0
#: Shortest distance between vertices: nearer ones are one on the screen. [pixels]
_LEAST_STEP_PX = 1.0
#: Number of places along each edge of the image from which the field of view is computed.
_N_EDGE = 33


@dataclass(frozen=True, slots=True)
class ProjectedLines:
    """The visible parts of lines in an image, as connected pieces.

    Parameters
    ----------
    pixels
        (n, 2) column and row in the original image. [pixels]
    offsets
        (k + 1,) int64: first pixel of each piece, and n at the end.
    line
        (k,) int64: index of the line of each piece, ascending.
    bridged
        (k,) bool: the piece is bridged.
    """

    pixels: FloatArray
    offsets: IntArray
    line: IntArray
    bridged: BoolArray

    def __len__(self) -> int:
        return len(self.line)


def projected(lines: LineSet, camera: Camera, poses: Poses, i: int) -> ProjectedLines:
    """Return the parts of lines in the field of view of a camera at pose i.

    Notes
    -----
    Occlusion is not considered. A segment is bridged where one of its ends is, as in `bridged_m`. Lines are clipped in
    space, by the planes through the camera and the edges of its image, before they are distorted: far outside the
    image the lens model folds back into it.
    """
    xyz = (poses.to_vehicle(i, lines.xyz) - camera.position_m) @ camera.R_vehicle_camera
    owner = lines.line_of_vertex
    first = np.flatnonzero(owner[:-1] == owner[1:]) if len(owner) else np.zeros(0, dtype=np.int64)
    begin, end = _seen_parts(xyz[first], xyz[first + 1], camera)
    seen = begin < end
    first, begin, end = first[seen], begin[seen], end[seen]
    step = xyz[first + 1] - xyz[first]
    a, b = (_ideal(xyz[first] + t[:, None] * step) for t in (begin, end))
    is_bridged = lines.bridged[first] | lines.bridged[first + 1]
    goes_on = (
        (first[1:] == first[:-1] + 1)
        & (owner[first[1:]] == owner[first[:-1]])
        & (end[:-1] == 1.0)
        & (begin[1:] == 0.0)
        & (is_bridged[1:] == is_bridged[:-1])
    )
    starts = np.flatnonzero(np.r_[True, ~goes_on]) if len(first) else np.zeros(0, dtype=np.int64)
    ideal, piece = _divided(a, b, starts, camera)
    pixels = distorted(camera, ideal)
    kept = _apart(pixels, piece)
    offsets = offsets_of(np.bincount(piece[kept], minlength=len(starts)))
    return ProjectedLines(pixels[kept], offsets, owner[first[starts]], is_bridged[starts])


def _ideal(xyz_camera: FloatArray) -> FloatArray:
    """Return (n, 2) x/z and y/z of (n, 3) places in the camera frame."""
    return np.asarray(xyz_camera[:, :2] / xyz_camera[:, 2:])


def _seen_parts(a: FloatArray, b: FloatArray, camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return the visible part of segments a-b [m, camera] as shares of their length; begin >= end where there is none."""
    begin, end = np.zeros(len(a)), np.ones(len(a))
    (left, top), (right, bottom) = _looked_at(camera)
    near, far = PROJECTED_DEPTH_M
    # Inside: normal . place >= least
    for normal, least in (
        ((0.0, 0.0, 1.0), near), ((0.0, 0.0, -1.0), -far), ((1.0, 0.0, -left), 0.0), ((-1.0, 0.0, right), 0.0),
        ((0.0, 1.0, -top), 0.0), ((0.0, -1.0, bottom), 0.0),
    ):  # fmt: skip
        from_a, from_b = a @ np.array(normal) - least, b @ np.array(normal) - least
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = from_a / (from_a - from_b)
        begin = np.where((from_a < 0.0) & (from_b >= 0.0), np.maximum(begin, crossing), begin)
        end = np.where((from_a >= 0.0) & (from_b < 0.0), np.minimum(end, crossing), end)
        end = np.where((from_a < 0.0) & (from_b < 0.0), -1.0, end)
    return begin, end


@lru_cache(maxsize=8)
def _limits(
    width: int, height: int, fx: float, fy: float, cx: float, cy: float, lens: tuple[float, ...]
) -> tuple[tuple[float, float], tuple[float, float]]:
    camera = Camera(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy, distortion=lens)  # type: ignore[arg-type]
    for margin in (MARGIN_PX, 0.0):
        cols = np.linspace(-margin, width - 1 + margin, _N_EDGE)
        rows = np.linspace(-margin, height - 1 + margin, _N_EDGE)
        edge = np.concatenate(
            [np.stack([cols, np.full(_N_EDGE, row)], axis=1) for row in rows[[0, -1]]]
            + [np.stack([np.full(_N_EDGE, col), rows], axis=1) for col in cols[[0, -1]]]
        )
        ideal = directions(camera, edge)
        # A strong lens does not reach beyond its image
        if np.isfinite(ideal).all():
            break
    low, high = np.nanmin(ideal, axis=0), np.nanmax(ideal, axis=0)
    return (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))


def _looked_at(camera: Camera) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the smallest and largest x/z and y/z in the image and its margin."""
    c = camera
    return _limits(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.distortion)


def _divided(a: FloatArray, b: FloatArray, starts: IntArray, camera: Camera) -> tuple[FloatArray, IntArray]:
    """Return (n, 2) directions along segments a-b and the (n,) piece of each; `starts`: first segment of each piece."""
    if not len(a):
        return np.zeros((0, 2)), np.zeros(0, dtype=np.int64)
    length_px = np.abs((b - a) * [camera.fx, camera.fy]).max(axis=1)
    n_parts = np.maximum(np.ceil(length_px / _STEP_PX), 1.0).astype(np.int64)
    is_last = np.zeros(len(a), dtype=np.bool_)
    is_last[np.r_[starts[1:] - 1, len(a) - 1]] = True
    # The begin of every part, and at the end of a piece its end
    n = n_parts + is_last
    segment = np.repeat(np.arange(len(a)), n)
    nth = np.arange(len(segment)) - np.repeat(np.cumsum(n) - n, n)
    share = (nth / n_parts[segment])[:, None]
    piece = np.searchsorted(starts, segment, side="right") - 1
    return a[segment] * (1.0 - share) + b[segment] * share, piece.astype(np.int64)


def _apart(pixels: FloatArray, piece: IntArray) -> BoolArray:
    """Return (n,) bool: pixels of each piece to keep, its ends and one for every `_LEAST_STEP_PX` along it."""
    kept = np.ones(len(pixels), dtype=np.bool_)
    if len(pixels) < 2:
        return kept
    mark = np.floor(distance_along(pixels) / _LEAST_STEP_PX)
    kept[1:-1] = (mark[1:-1] != mark[:-2]) | (piece[1:-1] != piece[:-2]) | (piece[1:-1] != piece[2:])
    return kept
