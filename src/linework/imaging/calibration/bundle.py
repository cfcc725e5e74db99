"""Adjustment of a calibration with the places of corners and the poses of pairs: a bundle adjustment in windows.

Each window of pairs is reduced to a quadratic form of the calibration's parameters alone: its corners are eliminated,
then its poses, which are those of the trajectory with errors whose size is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.imaging.calibration.corners import CornerTracks, inverse_distances
from linework.imaging.calibration.parameters import NAMES, adjusted_rig, prior_of, turned
from linework.imaging.rectify import distorted
from linework.model.camera import StereoRig
from linework.model.images import Poses

#: Residuals beyond this many deviations lose weight (Huber, 1964): 95 % efficiency without outliers; and those beyond
#: this many count no more: what moves, or was mistaken for another corner.
_HUBER, _REJECTED = 1.345, 5.0
#: Fewest pixels seen of a corner that is used: two in one pair give its distance, and the third tells something.
_LEAST_SEEN = 4
#: Errors of poses from one pair to the next before they are estimated, and their least: forward, left, up [m]; roll,
#: pitch, heading [rad]. A millimetre and a thousandth of a degree are what logs are written to.
_FIRST_MOVES = np.array([0.01, 0.01, 0.01, 1e-3, 1e-3, 1e-3])
_LEAST_MOVES = np.array([1e-3, 1e-3, 1e-3, 2e-5, 2e-5, 2e-5])
#: A window has landmarks that hardly change the fit: kept from running away. [share of their normal matrix]
_DAMPED = 1e-9
_MOVES = 6
#: Signs of roll, pitch and heading about the vehicle's axes forward, left and up.
_TURNS = np.array([1.0, -1.0, -1.0])
#: Step of numerical derivatives, as part of a parameter's prior; of directions of length 1.
_STEP, _DIRECTION_STEP = 1e-4, 1e-7


@dataclass(frozen=True, slots=True)
class CornerWindow:
    """Corners of a few pairs in a row, and where the van was.

    Parameters
    ----------
    tracks
        Where the corners were seen.
    poses_at
        Poses of the pairs, if their images were taken so many seconds later than their times say.
    """

    tracks: CornerTracks
    poses_at: Callable[[float], Poses]


@dataclass
class _Fit:
    """A window while it is being fitted: landmarks, moves of the poses, and the anchors of the landmarks."""

    window: CornerWindow
    tracks: CornerTracks
    anchor_xyz: FloatArray
    anchor_axes: FloatArray
    landmarks: FloatArray
    moves: FloatArray


@dataclass(frozen=True, slots=True)
class ReducedWindow:
    """What a window says of the parameters: misfit(x) = 0.5 x' normal x - right' x + constant, in weighted squares.

    Parameters
    ----------
    normal
        (p, p) in the units of the parameters.
    right
        (p,).
    effect_px
        (p,) root mean square of the pixels by which one unit of a parameter moves corners that it moves.
    """

    normal: FloatArray
    right: FloatArray
    effect_px: FloatArray


def _started(window: CornerWindow, rig: StereoRig) -> _Fit:
    """Return a window with its landmarks intersected, each in the frame of the left camera that saw it first."""
    tracks = window.tracks
    poses = window.poses_at(0.0)
    order = np.lexsort((tracks.side, tracks.frame, tracks.corner))
    tracks = tracks.take(order)
    _, first, number, count = np.unique(
        tracks.corner, return_index=True, return_inverse=True, return_counts=True
    )
    # The first two pixels of a corner are left and right in one pair
    ray, inverse = inverse_distances(rig, tracks.pixel[first], tracks.pixel[first + 1])
    is_good = (count >= _LEAST_SEEN) & np.isfinite(inverse) & np.isfinite(ray).all(axis=1)
    kept = is_good[number]
    renumbered = np.cumsum(is_good) - 1
    tracks = CornerTracks(tracks.frame[kept], tracks.side[kept], renumbered[number[kept]], tracks.pixel[kept])
    at = window.tracks.take(order).frame[first[is_good]]
    R = poses.R_world_vehicle[at]
    return _Fit(
        window, tracks,
        anchor_xyz=poses.xyz[at] + R @ rig.left.position_m,
        anchor_axes=R @ rig.left.R_vehicle_camera,
        landmarks=np.column_stack([ray[is_good, :2], inverse[is_good]]),
        moves=np.zeros((len(poses), _MOVES)),
    )  # fmt: skip


def _in_vehicle(fit: _Fit, poses: Poses) -> tuple[FloatArray, FloatArray]:
    """Return directions (n, 3) from the vehicle's origin to corners, in its axes, and rotations (f, 3, 3) of its errors.

    Directions are multiplied by inverse distances: a camera at a in the vehicle sees a landmark of inverse distance w in
    direction d - w a.
    """
    tracks, landmarks = fit.tracks, fit.landmarks
    turn = turned(fit.moves[:, 3:] * _TURNS)
    R = poses.R_world_vehicle @ turn
    xyz = poses.xyz + (poses.R_world_vehicle @ fit.moves[:, :3, None])[..., 0]
    world = (fit.anchor_axes @ np.column_stack([landmarks[:, :2], np.ones(len(landmarks))])[..., None])[
        ..., 0
    ]
    away = world[tracks.corner] - landmarks[tracks.corner, 2:] * (
        xyz[tracks.frame] - fit.anchor_xyz[tracks.corner]
    )
    return (away[:, None] @ R[tracks.frame])[:, 0], turn


def _seen(fit: _Fit, rig: StereoRig, from_vehicle: FloatArray) -> FloatArray:
    """Return (n, 2) the pixels [px] at which the cameras of a rig see directions in the vehicle."""
    pixels = np.empty((len(from_vehicle), 2))
    inverse = fit.landmarks[fit.tracks.corner, 2:]
    for side, camera in enumerate((rig.left, rig.right)):
        own = fit.tracks.side == side
        seen = (from_vehicle[own] - inverse[own] * camera.position_m) @ camera.R_vehicle_camera
        pixels[own] = distorted(camera, seen[:, :2] / np.maximum(seen[:, 2:], 1e-3))
    return pixels


class Bundle:
    """Windows of corners that are fitted together: parameters of the calibration, landmarks and errors of poses.

    Parameters
    ----------
    rig
        As given.
    windows
        At least one with corners.
    """

    def __init__(self, rig: StereoRig, windows: Sequence[CornerWindow]) -> None:
        self.rig = rig
        self.fits = [fit for fit in (_started(w, rig) for w in windows) if len(fit.landmarks)]
        self.x = np.zeros(len(NAMES))
        self.sigma_px = 1.0
        self.sigma_moves = _FIRST_MOVES.copy()
        self.reduced: list[ReducedWindow] = []

    def residuals(self, fit: _Fit, x: FloatArray) -> FloatArray:
        """Return (n, 2) pixels [px] expected less measured."""
        rig, offset = adjusted_rig(self.rig, x)
        return _seen(fit, rig, _in_vehicle(fit, fit.window.poses_at(offset))[0]) - fit.tracks.pixel

    def fit(self, free: BoolArray, n_steps: int, *, estimate: bool = True) -> None:
        """Fit the parameters that are free, all landmarks and all poses, by steps of Gauss and Newton.

        Parameters
        ----------
        free
            (p,) bool; the others stay.
        estimate
            Also estimate the sizes of residuals and of errors of poses.
        """
        weight = np.diag(1.0 / prior_of()[free] ** 2)
        for _ in range(n_steps):
            around = _Around.at(self.rig, self.x)
            linear = [_linearised(fit, around) for fit in self.fits]
            if estimate:
                self.sigma_px = _scale_of([r for r, *_ in linear], self.fits)
            solved = [_eliminated(self, fit, *parts) for fit, parts in zip(self.fits, linear, strict=True)]
            normal = np.sum([s.normal for s in solved], axis=0)[np.ix_(free, free)] + weight
            right = np.sum([s.right for s in solved], axis=0)[free] - weight @ self.x[free]
            step = np.zeros(len(self.x))
            step[free] = np.linalg.solve(normal, right)
            self.x = self.x + step
            squares = []
            for fit, one in zip(self.fits, solved, strict=True):
                moves, landmarks = one.back(step)
                fit.moves = fit.moves + moves
                fit.landmarks = fit.landmarks + landmarks
                squares.append(fit.moves**2 + one.variance_moves)
            if estimate:
                # One step of expectation and maximisation for the variances of the poses' errors
                self.sigma_moves = np.maximum(np.sqrt(np.concatenate(squares).mean(axis=0)), _LEAST_MOVES)

    def reduce(self) -> list[ReducedWindow]:
        """Return what each window says of all parameters, as a form around 0."""
        found, around = [], _Around.at(self.rig, self.x)
        for fit in self.fits:
            parts = _linearised(fit, around)
            one = _eliminated(self, fit, *parts)
            square = (parts[1] ** 2).sum(axis=1)
            effect = np.sqrt(square.sum(axis=0) / np.maximum((square > 0.0).sum(axis=0), 1))
            found.append(ReducedWindow(one.normal, one.right + one.normal @ self.x, effect))
        return found


@dataclass(frozen=True, slots=True)
class _Solved:
    """A window with its landmarks and poses eliminated, and how to get them back."""

    normal: FloatArray
    right: FloatArray
    back: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    variance_moves: FloatArray


@dataclass(frozen=True, slots=True)
class _Around:
    """The rig at given parameters, and a step of each; with the seconds to add to times."""

    here: tuple[StereoRig, float]
    steps: FloatArray
    ends: tuple[tuple[StereoRig, float], ...]

    @staticmethod
    def at(rig: StereoRig, x: FloatArray) -> _Around:
        steps = _STEP * prior_of()
        ends = tuple(adjusted_rig(rig, x + step) for step in np.diag(steps))
        return _Around(adjusted_rig(rig, x), steps, ends)


def _linearised(fit: _Fit, around: _Around) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return residuals (n, 2), and derivatives by parameters (n, 2, p), moves (n, 2, 6) and landmarks (n, 2, 3)."""
    rig, offset = around.here
    tracks, poses = fit.tracks, fit.window.poses_at(offset)
    towards, turn = _in_vehicle(fit, poses)
    here = _seen(fit, rig, towards)
    by_parameter = np.empty((*here.shape, len(NAMES)))
    for k, (step, (moved, later)) in enumerate(zip(around.steps.tolist(), around.ends, strict=True)):
        at = towards if later == offset else _in_vehicle(fit, fit.window.poses_at(later))[0]
        by_parameter[..., k] = (_seen(fit, moved, at) - here) / step
    by_direction = np.stack(
        [(_seen(fit, rig, towards + _DIRECTION_STEP * e) - here) / _DIRECTION_STEP for e in np.eye(3)],
        axis=-1,
    )
    inverse = fit.landmarks[tracks.corner, 2]
    moving = np.empty((len(here), 3, _MOVES))
    moving[..., :3] = -inverse[:, None, None] * turn.transpose(0, 2, 1)[tracks.frame]
    for k in range(3):
        moving[..., 3 + k] = -_TURNS[k] * np.cross(np.eye(3)[k], towards)
    # Directions change by landmarks as the anchors' axes lie; the way from the anchor also shifts the cameras
    R = poses.R_world_vehicle @ turn
    xyz = poses.xyz + (poses.R_world_vehicle @ fit.moves[:, :3, None])[..., 0]
    axes = R.transpose(0, 2, 1)[tracks.frame] @ fit.anchor_axes[tracks.corner]
    way = (xyz[tracks.frame] - fit.anchor_xyz[tracks.corner])[:, None] @ R[tracks.frame]
    place = np.stack([rig.left.position_m, rig.right.position_m])[tracks.side]
    placing = np.concatenate([axes[..., :2], -(way[:, 0] + place)[..., None]], axis=-1)
    return here - tracks.pixel, by_parameter, by_direction @ moving, by_direction @ placing


def _scale_of(residuals: Sequence[FloatArray], fits: Sequence[_Fit]) -> float:
    """Return the standard deviation of pixels, from the median of residuals and the share of them that is free."""
    size = np.concatenate([np.abs(r).ravel() for r in residuals])
    n_unknown = sum(fit.landmarks.size for fit in fits)
    share = max(1.0 - n_unknown / len(size), 0.1)
    return max(1.4826 * float(np.median(size)) / math.sqrt(share), 1e-4)


def _eliminated(
    bundle: Bundle,
    fit: _Fit,
    residual: FloatArray,
    by_parameter: FloatArray,
    by_move: FloatArray,
    by_landmark: FloatArray,
) -> _Solved:
    """Return the window's normal equations of the parameters alone."""
    tracks, n_frames, n_corners = fit.tracks, len(fit.moves), len(fit.landmarks)
    size = np.linalg.norm(residual, axis=1) / bundle.sigma_px
    factor = np.minimum(1.0, _HUBER / np.maximum(size, 1e-9)) * (size < _REJECTED)
    # Corners whose weights are all but gone keep their landmarks by the damping
    weight = factor / bundle.sigma_px**2
    n, p = len(residual), by_parameter.shape[2]
    A = np.zeros((n, 2, p + _MOVES * n_frames))
    A[..., :p] = by_parameter
    for k in range(_MOVES):
        A[np.arange(n), :, p + _MOVES * tracks.frame + k] = by_move[..., k]
    weighted = by_landmark * weight[:, None, None]
    across = weighted.transpose(0, 2, 1)
    HL = _summed(across @ by_landmark, tracks.corner, n_corners)
    trace = np.trace(HL, axis1=1, axis2=2)[:, None, None]
    HL = HL + (_DAMPED * trace + 1e-6) * np.eye(3)
    gL = _summed((across @ residual[..., None])[..., 0], tracks.corner, n_corners)
    HLA = _summed(across @ A, tracks.corner, n_corners)
    inverse = np.linalg.inv(HL)
    solved = inverse @ HLA
    flat = A.reshape(2 * n, -1)
    flat_weight = np.repeat(weight, 2)
    S = flat.T @ (flat * flat_weight[:, None]) - HLA.reshape(3 * n_corners, -1).T @ solved.reshape(
        3 * n_corners, -1
    )
    b = -(flat.T @ (flat_weight * residual.ravel())) + solved.reshape(3 * n_corners, -1).T @ gL.ravel()
    prior = np.tile(1.0 / bundle.sigma_moves**2, n_frames)
    S[np.arange(p, len(S)), np.arange(p, len(S))] += prior
    b[p:] -= prior * fit.moves.ravel()
    covariance = np.linalg.inv(S[p:, p:])
    gain = covariance @ S[p:, :p]
    at_rest = covariance @ b[p:]

    def back(step: FloatArray) -> tuple[FloatArray, FloatArray]:
        moves = at_rest - gain @ step
        both = np.concatenate([step, moves])
        landmarks = -(inverse @ gL[..., None])[..., 0] - solved @ both
        return moves.reshape(-1, _MOVES), landmarks

    normal = S[:p, :p] - S[:p, p:] @ gain
    return _Solved(
        0.5 * (normal + normal.T), b[:p] - S[:p, p:] @ at_rest, back,
        np.diag(covariance).reshape(-1, _MOVES),
    )  # fmt: skip


def _summed(values: FloatArray, index: IntArray, n: int) -> FloatArray:
    """Return the sums (n, ...) of rows of the same index, which ascends."""
    total = np.zeros((n, *values.shape[1:]))
    first = np.flatnonzero(np.diff(index, prepend=-1))
    total[index[first]] = np.add.reduceat(values, first, axis=0)
    return total


def misfit_px(
    rig: StereoRig, windows: Sequence[CornerWindow], x: FloatArray, *, n_steps: int = 4
) -> FloatArray:
    """Return the residuals (n,) [px] of corners where poses are those of the trajectory and landmarks fit best.

    Parameters
    ----------
    x
        (p,) correction of the calibration.
    """
    bundle = Bundle(rig, windows)
    bundle.x = np.asarray(x, dtype=np.float64)
    bundle.sigma_moves = np.full(_MOVES, 1e-9)
    around = _Around.at(rig, bundle.x)
    for _ in range(n_steps):
        linear = [_linearised(fit, around) for fit in bundle.fits]
        bundle.sigma_px = _scale_of([r for r, *_ in linear], bundle.fits)
        for fit, parts in zip(bundle.fits, linear, strict=True):
            fit.landmarks = fit.landmarks + _eliminated(bundle, fit, *parts).back(np.zeros(len(NAMES)))[1]
    return np.concatenate([np.linalg.norm(bundle.residuals(fit, bundle.x), axis=1) for fit in bundle.fits])
