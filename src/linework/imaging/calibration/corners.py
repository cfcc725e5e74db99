"""Corners of the images of a few pairs in a row, found in both cameras and followed from pair to pair."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.errors import extra_needed
from linework.imaging.rectify import Rectifier, directions, distorted, original_pixels, rectified_pixels
from linework.model.camera import StereoRig
from linework.model.columns import Columns, column
from linework.model.images import Poses

#: Corners are sought in cells of an image, so that the road has its share beside trees and houses: cells across and down,
#: and corners in each. [cells, corners]
_CELLS, _PER_CELL = (10, 5), 6
#: Corners keep this distance from each other and from the edges of the image. [pixels]
_APART_PX, _EDGE_PX = 10, 12
#: Least quality of a corner, as part of that of the best in its cell (Shi and Tomasi).
_QUALITY = 0.05
#: Half the window that is compared, and how far around the expected place it is sought at half the resolution. [pixels]
_HALF_PX, _LEVELS = 8, 2
#: A corner that is followed there and back returns to its place to this much, else it is another. [pixels]
_RETURN_PX = 0.3
#: Half the height of the strip in which the right corner is sought: rows of a calibration that needs mending differ.
#: [pixels]
_STRIP_PX = 4
#: Least correlation of a corner in both images, and how much better than its next best place it must be.
_LEAST_LIKE, _BETTER = 0.8, 0.05
#: Light is made even over windows of this standard deviation: cameras of a pair have gains of their own. [pixels]
_EVEN_PX = 12.0
#: Disparities that are sought, as part of the width of the image: down to a base's four widths from it.
_MOST_DISPARITY = 0.2
#: A corner that grows by more from one pair to the next is another patch of the road by then.
_MOST_GROWTH = 1.35


@dataclass(frozen=True, slots=True)
class CornerTracks(Columns):
    """Pixels of corners in the images of a window of pairs, one row each.

    Parameters
    ----------
    frame
        (n,) pair in the window, from 0.
    side
        (n,) 0: left, 1: right.
    corner
        (n,) number of the corner, from 0.
    pixel
        (n, 2) column and row in the original image. [pixels]
    """

    frame: IntArray = column(np.int64)
    side: IntArray = column(np.int64)
    corner: IntArray = column(np.int64)
    pixel: FloatArray = column(np.float64, 2)


@dataclass(frozen=True, slots=True)
class _Followed:
    """Corners that are being followed: numbers, and pixels in both images of the latest pair."""

    number: IntArray
    left: FloatArray
    right: FloatArray

    def take(self, kept: BoolArray) -> _Followed:
        return _Followed(self.number[kept], self.left[kept], self.right[kept])


def follow_corners(
    pairs: Iterator[tuple[AnyArray, AnyArray]] | Sequence[tuple[AnyArray, AnyArray]],
    rectifier: Rectifier,
    rig: StereoRig,
    poses: Poses,
) -> CornerTracks:
    """Return corners that are visible in both images of a pair, followed through the pairs after it.

    Parameters
    ----------
    pairs
        Left and right image of each pair, original, (height, width) uint8.
    rectifier, rig
        Of the given calibration.
    poses
        Of the pairs: where corners are expected, from their distance and the way of the van.

    References
    ----------
    J. Shi, C. Tomasi, "Good features to track", CVPR 1994, doi:10.1109/CVPR.1994.323794; B. Lucas, T. Kanade,
    "An iterative image registration technique", IJCAI 1981; Z. Kalal, K. Mikolajczyk, J. Matas, "Forward-backward
    error", ICPR 2010, doi:10.1109/ICPR.2010.675.
    """
    with extra_needed("stereo"):
        import cv2

    cv2.setNumThreads(1)
    rows: list[tuple[int, int, IntArray, FloatArray]] = []
    known = _Followed(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2)))
    before: tuple[AnyArray, AnyArray] | None = None
    n = 0
    for frame, pair in enumerate(pairs):
        left, right = (_even(image) for image in pair)
        if before is not None and len(known.number):
            known = _carried(known, before, (left, right), rig, poses, frame)
        new = _new_corners(left, right, pair[0].shape, rectifier, rig, known.left)
        new = _Followed(new.number + n, new.left, new.right)
        n += len(new.number)
        known = _Followed(*(np.concatenate([a, b]) for a, b in zip(
            (known.number, known.left, known.right), (new.number, new.left, new.right), strict=True)))  # fmt: skip
        rows += [(frame, side, known.number, pixels) for side, pixels in enumerate((known.left, known.right))]
        before = left, right
    return CornerTracks(
        np.concatenate([np.full(len(r[2]), r[0]) for r in rows]),
        np.concatenate([np.full(len(r[2]), r[1]) for r in rows]),
        np.concatenate([r[2] for r in rows]),
        np.concatenate([r[3] for r in rows]),
    )


def _even(image: AnyArray) -> AnyArray:
    """Return an image whose light and contrast are the same everywhere, uint8."""
    with extra_needed("stereo"):
        import cv2

    grey = image.astype(np.float32)
    mean = cv2.GaussianBlur(grey, (0, 0), _EVEN_PX)
    spread = cv2.GaussianBlur((grey - mean) ** 2, (0, 0), _EVEN_PX)
    # Half a grey value is the noise of rounding and more: what has less contrast is not made to look like texture
    return np.asarray(
        np.clip(127.5 + 40.0 * (grey - mean) / np.sqrt(spread + 0.25), 0.0, 255.0), dtype=np.uint8
    )


def _new_corners(
    left: AnyArray,
    right: AnyArray,
    shape: tuple[int, ...],
    rectifier: Rectifier,
    rig: StereoRig,
    known: FloatArray,
) -> _Followed:
    """Return corners of the left image that are found in the right one, away from those that are known."""
    with extra_needed("stereo"):
        import cv2

    height, width = shape[:2]
    free = np.zeros((height, width), dtype=np.uint8)
    free[_EDGE_PX : height - _EDGE_PX, _EDGE_PX : width - _EDGE_PX] = 255
    for col, row in known.round().astype(int).tolist():
        cv2.circle(free, (col, row), _APART_PX, 0, -1)
    found: list[FloatArray] = []
    cols, rows = (
        np.linspace(0, size, n + 1).astype(int) for size, n in zip((width, height), _CELLS, strict=True)
    )
    for top, bottom in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        for first, last in zip(cols[:-1].tolist(), cols[1:].tolist(), strict=True):
            here = cv2.goodFeaturesToTrack(
                left[top:bottom, first:last],
                _PER_CELL,
                _QUALITY,
                _APART_PX,
                mask=free[top:bottom, first:last],
            )
            if here is not None:
                found.append(here[:, 0].astype(np.float64) + np.array([first, top]))
    corners = np.concatenate(found) if found else np.zeros((0, 2))
    flat_left, flat_right = rectifier.rectified(left, right)
    expected = _along_rows(corners, flat_left, flat_right, rectifier, rig)
    is_there = np.isfinite(expected).all(axis=1)
    corners, expected = corners[is_there], expected[is_there]
    place, is_same = _matched(left, right, corners, expected)
    return _Followed(np.arange(int(is_same.sum())), corners[is_same], place[is_same])


def _along_rows(
    corners: FloatArray, left: AnyArray, right: AnyArray, rectifier: Rectifier, rig: StereoRig
) -> FloatArray:
    """Return (n, 2) where corners of the left image are in the right one to a pixel; NaN where it is not clear."""
    with extra_needed("stereo"):
        import cv2

    height, width = left.shape
    most, half = int(_MOST_DISPARITY * width), _HALF_PX
    found = np.full((len(corners), 2), np.nan)
    flat = rectified_pixels(rig.left, rectifier.rig, corners)
    for i, (col, row) in enumerate(np.nan_to_num(flat, nan=-1.0).round().astype(int).tolist()):
        reach = half + _STRIP_PX
        if not (half <= col < width - half and reach <= row < height - reach):
            continue
        # Far corners may have a small disparity of the wrong sign where the cameras look apart
        first, last = max(col - most, half), min(col + _STRIP_PX, width - half - 1)
        patch = left[row - half : row + half + 1, col - half : col + half + 1]
        strip = right[row - reach : row + reach + 1, first - half : last + half + 1]
        like = cv2.matchTemplate(strip, patch, cv2.TM_CCOEFF_NORMED)
        at_row, at_col = np.unravel_index(int(like.argmax()), like.shape)
        best = float(like[at_row, at_col])
        # Without other places to compare with, it is not clear
        others = np.hstack([like[:, : max(at_col - half, 0)], like[:, at_col + half + 1 :]])
        if best >= _LEAST_LIKE and others.size and best - float(others.max()) >= _BETTER:
            found[i] = flat[i] + [first + at_col - col, at_row - _STRIP_PX]
    is_there = np.isfinite(found).all(axis=1)
    found[is_there] = original_pixels(rig.right, rectifier.rig, found[is_there])
    return found


def _carried(
    known: _Followed,
    before: tuple[AnyArray, AnyArray],
    now: tuple[AnyArray, AnyArray],
    rig: StereoRig,
    poses: Poses,
    frame: int,
) -> _Followed:
    """Return the corners that are found in both images of the next pair."""
    ray, inverse = inverse_distances(rig, known.left, known.right)
    to_now = poses.R_world_vehicle[frame].T @ poses.R_world_vehicle[frame - 1]
    moved = poses.to_vehicle(frame, poses.xyz[frame - 1][None])[0]
    left, right = rig.left, rig.right
    direction = ray @ left.R_vehicle_camera.T @ to_now.T
    expected = []
    origin = to_now @ left.position_m + moved
    growth = np.ones(len(ray))
    for camera in (left, right):
        seen = (direction + inverse[:, None] * (origin - camera.position_m)) @ camera.R_vehicle_camera
        ahead = np.where(seen[:, 2] > 0.05, seen[:, 2], np.nan)
        expected.append(distorted(camera, seen[:, :2] / ahead[:, None]))
        growth = np.where(np.isfinite(ahead), np.maximum(growth, 1.0 / ahead), np.inf)
    height, width = now[0].shape
    is_inside = growth < _MOST_GROWTH
    for place in expected:
        is_inside &= ((place >= _EDGE_PX) & (place < [width - _EDGE_PX, height - _EDGE_PX])).all(axis=1)
    known, expected = known.take(is_inside), [place[is_inside] for place in expected]
    place_left, is_left = _matched(before[0], now[0], known.left, expected[0])
    shift = place_left - expected[0]
    place_right, is_right = _matched(now[0], now[1], place_left, expected[1] + shift)
    kept = is_left & is_right
    return _Followed(known.number[kept], place_left[kept], place_right[kept])


def inverse_distances(rig: StereoRig, left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rays (n, 3) (x, y, 1) in the left camera frame of corners, and their inverse distances along z (n,) [1/m].

    Parameters
    ----------
    left, right
        (n, 2) original pixels of the same corners.

    Notes
    -----
    From the columns alone. Corners farther than infinity, as wrong angles make them, have negative values.
    """
    ray = np.concatenate([directions(rig.left, left), np.ones((len(left), 1))], axis=1)
    x = directions(rig.right, right)[:, 0]
    to_right = rig.right.R_vehicle_camera.T
    a = ray @ (to_right @ rig.left.R_vehicle_camera).T
    b = to_right @ (rig.right.position_m - rig.left.position_m)
    return ray, np.asarray((a[:, 0] - x * a[:, 2]) / (b[0] - x * b[2]))


def _matched(
    here: AnyArray, there: AnyArray, corners: FloatArray, expected: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return (n, 2) places of corners in another image, and whether the way back ends where it began."""
    with extra_needed("stereo"):
        import cv2

    if not len(corners):
        return corners, np.zeros(0, dtype=bool)
    size = 2 * _HALF_PX + 1
    until = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 30, 0.005)
    follow = partial(
        cv2.calcOpticalFlowPyrLK, winSize=(size, size), maxLevel=_LEVELS, flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        criteria=until,
    )  # fmt: skip
    start = np.ascontiguousarray(corners, dtype=np.float32)[:, None].copy()
    guess = np.ascontiguousarray(expected, dtype=np.float32)[:, None].copy()
    there_px, is_found, _ = follow(here, there, start, guess)
    back_px, is_back, _ = follow(there, here, there_px, start.copy())
    away = np.abs(back_px - start).max(axis=(1, 2))
    height, width = there.shape
    place = there_px[:, 0].astype(np.float64)
    is_inside = ((place > _HALF_PX) & (place < [width - _HALF_PX, height - _HALF_PX])).all(axis=1)
    kept = (is_found[:, 0] == 1) & (is_back[:, 0] == 1) & (away < _RETURN_PX) & is_inside
    return place, np.asarray(kept)
