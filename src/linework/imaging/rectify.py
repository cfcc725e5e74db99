"""Rectification of stereo pairs, conversion between original and rectified pixels, and a check of the rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.errors import extra_needed
from linework.model.camera import Camera, RectifiedRig, StereoRig

#: Largest rotation between cameras that is ignored: it moves a corner of the image by less than 0.001 pixel, and
#: images are not resampled for it. [rad]
_SAME_DIRECTION = 1e-6
#: Steps of Newton's method, which squares its error each time; step of its numerical derivative; and the error from
#: which a pixel has no direction. [steps, 1, pixels]
_NEWTON_STEPS, _DIFFERENCE, _REACHED_PX = 8, 1e-6, 1e-6
#: Number of corners searched in each image: enough that a hundred are matched on an empty road.
_N_CORNERS = 1000
#: Threshold of the corner detector; OpenCV's default is 20. [grey values] How it was chosen is not recorded.
_CORNER_THRESHOLD = 10
#: Largest number of differing bits of 256 in the descriptors of one corner (fewer than 1 in 6, as usual for ORB).
_MAX_BITS = 40
#: Half the window that finds the row of a corner to a tenth of a pixel, and its largest move from the coarse match.
#: [pixels]
_WINDOW_PX, _MAX_MOVE_PX = 7, 3.0
#: Largest difference of rows of a match: beyond it the match is wrong, or the images do not belong together. [pixels]
ROW_TOLERANCE_PX = 1.0
#: Fewest matches that say anything about the rows: night, fog and bare walls have fewer.
LEAST_MATCHES = 30


@dataclass(frozen=True, slots=True)
class Rectifier:
    """Maps that resample the two images of a rig.

    Parameters
    ----------
    rig
        Geometry of the rectified pair.
    left_map, right_map
        (height, width, 2) float32: column and row in the original image of each rectified pixel; None where the image
        is rectified already.
    """

    rig: RectifiedRig
    left_map: Float32Array | None
    right_map: Float32Array | None

    def rectified(self, left: AnyArray, right: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Return both grey images (height, width) uint8 resampled; 0 outside the originals."""
        return _resampled(left, self.left_map), _resampled(right, self.right_map)


def rectifier_of(rig: StereoRig) -> Rectifier:
    """Return the rectifier of a rig.

    Notes
    -----
    The common x-axis is along the base, the common z-axis as near to both optical axes as that allows. The focal
    length is that of the left camera, so that the resolution is preserved.

    References
    ----------
    A. Fusiello, E. Trucco, A. Verri, "A compact algorithm for rectification of stereo pairs", Machine Vision and
    Applications 12 (2000), doi:10.1007/s001380050120.
    """
    left, right = rig.left, rig.right
    base = right.position_m - left.position_m
    x = base / np.linalg.norm(base)
    ahead = left.R_vehicle_camera[:, 2] + right.R_vehicle_camera[:, 2]
    z = ahead - x * (ahead @ x)
    z /= np.linalg.norm(z)
    rotation = np.stack([x, np.cross(z, x), z], axis=1)
    if all(_turn(c.R_vehicle_camera, rotation) < _SAME_DIRECTION for c in (left, right)):
        rotation = left.R_vehicle_camera
    common = RectifiedRig(
        focal_px=left.fx, cx=left.cx, cy=left.cy, width=left.width, height=left.height,
        base_m=float(np.linalg.norm(base)), position_m=left.position_m, R_vehicle_camera=rotation,
    )  # fmt: skip
    return Rectifier(common, _map_of(left, common), _map_of(right, common))


def _turn(a: FloatArray, b: FloatArray) -> float:
    """Return the rotation between two frames, as the largest element of its matrix less identity."""
    return float(np.abs(a.T @ b - np.eye(3)).max())


def _map_of(camera: Camera, rig: RectifiedRig) -> Float32Array | None:
    """Return (height, width, 2) the original pixel of each rectified pixel; None where they are equal."""
    ideal = (rig.focal_px, rig.focal_px, rig.cx, rig.cy, rig.width, rig.height)
    own = (camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height)
    is_ideal = own == ideal and not any(camera.distortion)
    if is_ideal and _turn(camera.R_vehicle_camera, rig.R_vehicle_camera) < _SAME_DIRECTION:
        return None
    row, col = np.mgrid[: rig.height, : rig.width]
    ray = np.stack([(col - rig.cx) / rig.focal_px, (row - rig.cy) / rig.focal_px, np.ones(col.shape)], -1)
    ray = ray @ (rig.R_vehicle_camera.T @ camera.R_vehicle_camera)
    return np.asarray(distorted(camera, ray[..., :2] / ray[..., 2:]), dtype=np.float32)


def distorted(camera: Camera, ideal: FloatArray) -> FloatArray:
    """Return pixels (..., 2) of the original image for directions x/z, y/z (..., 2) in the camera frame.

    References
    ----------
    D. C. Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32 (1966).
    """
    k1, k2, p1, p2, k3 = camera.distortion
    x, y = ideal[..., 0], ideal[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    x_seen = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    y_seen = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([camera.fx * x_seen + camera.cx, camera.fy * y_seen + camera.cy], axis=-1)


def directions(camera: Camera, pixels: FloatArray) -> FloatArray:
    """Return directions x/z, y/z (n, 2) in the camera frame of original pixels (n, 2); NaN where there is none.

    Notes
    -----
    The inverse of `distorted`, which has no closed form: Newton's method on both coordinates, to 1e-6 pixels.

    >>> camera = Camera(width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0,
    ...     distortion=(-0.3, 0.1, 0.001, 0.0, 0.0))
    >>> seen = np.array([[0.3, -0.2]])
    >>> np.abs(directions(camera, distorted(camera, seen)) - seen).max() < 1e-9
    np.True_
    """
    wanted = np.asarray(pixels, dtype=np.float64)
    scale = np.array([camera.fx, camera.fy])
    ideal = (wanted - [camera.cx, camera.cy]) / scale
    for _ in range(_NEWTON_STEPS):
        error = distorted(camera, ideal) - wanted
        # Derivatives of both pixel coordinates by each direction
        along_x, along_y = (
            (distorted(camera, ideal + step) - distorted(camera, ideal - step)) / (2.0 * _DIFFERENCE)
            for step in ([_DIFFERENCE, 0.0], [0.0, _DIFFERENCE])
        )
        det = along_x[..., 0] * along_y[..., 1] - along_y[..., 0] * along_x[..., 1]
        ideal = ideal - np.stack(
            [
                (along_y[..., 1] * error[..., 0] - along_y[..., 0] * error[..., 1]) / det,
                (along_x[..., 0] * error[..., 1] - along_x[..., 1] * error[..., 0]) / det,
            ],
            axis=-1,
        )
    missed = np.abs(distorted(camera, ideal) - wanted).max(axis=-1, keepdims=True) > _REACHED_PX
    return np.where(missed, np.nan, ideal)


def rectified_pixels(camera: Camera, rig: RectifiedRig, pixels: FloatArray) -> FloatArray:
    """Return rectified pixels (n, 2) of original pixels (n, 2); NaN where there is none."""
    ideal = directions(camera, pixels)
    ray = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
    ray = ray @ camera.R_vehicle_camera.T @ rig.R_vehicle_camera
    return np.asarray(rig.focal_px * ray[:, :2] / ray[:, 2:] + [rig.cx, rig.cy])


def original_pixels(camera: Camera, rig: RectifiedRig, pixels: FloatArray) -> FloatArray:
    """Return original pixels (n, 2) of rectified pixels (n, 2)."""
    ideal = (np.asarray(pixels) - [rig.cx, rig.cy]) / rig.focal_px
    ray = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1)
    ray = ray @ rig.R_vehicle_camera.T @ camera.R_vehicle_camera
    return distorted(camera, ray[:, :2] / ray[:, 2:])


def _resampled(image: AnyArray, source: Float32Array | None) -> AnyArray:
    if source is None:
        return image
    # Neither its codecs nor its threads are used: images are decoded in a worker, and kernels are serial
    with extra_needed("stereo"):
        import cv2

    cv2.setNumThreads(1)
    # Cubic: linear interpolation blurs a stripe two pixels wide by an amount that depends on its position
    return np.asarray(cv2.remap(image, source[..., 0], source[..., 1], cv2.INTER_CUBIC))


@dataclass(frozen=True, slots=True)
class RowFit:
    """Agreement of the rows of two rectified images.

    Parameters
    ----------
    n_matches
        Number of corners matched in both images.
    n_fitting
        Number of matches in the same row to `ROW_TOLERANCE_PX` and with a disparity that is not negative.
    n_swapped
        Number of matches in the same row with a negative disparity, as in swapped images.
    offset_px
        Median of the right row less the left row; NaN without matches. [pixels]
    error_px
        Median of the absolute difference of the rows; NaN without matches. [pixels]
    """

    n_matches: int
    n_fitting: int
    n_swapped: int
    offset_px: float
    error_px: float

    @property
    def is_known(self) -> bool:
        """Whether there are at least `LEAST_MATCHES` matches."""
        return self.n_matches >= LEAST_MATCHES


def row_fit(left: AnyArray, right: AnyArray) -> RowFit:
    """Return the agreement of rows of corners that were matched without regard to rows.

    Parameters
    ----------
    left, right
        (height, width) uint8.

    References
    ----------
    E. Rublee, V. Rabaud, K. Konolige, G. Bradski, "ORB: an efficient alternative to SIFT or SURF", ICCV 2011,
    doi:10.1109/ICCV.2011.6126544; B. Lucas, T. Kanade, "An iterative image registration technique", IJCAI 1981.
    """
    place_left, place_right = _matched_corners(left, right)
    n = len(place_left)
    if n == 0:
        return RowFit(0, 0, 0, float("nan"), float("nan"))
    rows = place_right[:, 1] - place_left[:, 1]
    is_behind: BoolArray = place_right[:, 0] - place_left[:, 0] > ROW_TOLERANCE_PX
    is_in_row = np.abs(rows) <= ROW_TOLERANCE_PX
    return RowFit(
        n_matches=n,
        n_fitting=int(np.count_nonzero(is_in_row & ~is_behind)),
        n_swapped=int(np.count_nonzero(is_in_row & is_behind)),
        offset_px=float(np.median(rows)),
        error_px=float(np.median(np.abs(rows))),
    )


def _matched_corners(left: AnyArray, right: AnyArray) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) column and row of the same corners in both images, to a tenth of a pixel."""
    with extra_needed("stereo"):
        import cv2

    cv2.setNumThreads(1)
    orb = cv2.ORB_create(nfeatures=_N_CORNERS, fastThreshold=_CORNER_THRESHOLD)  # type: ignore[attr-defined]
    (seen_left, bits_left), (seen_right, bits_right) = (orb.detectAndCompute(i, None) for i in (left, right))
    none = np.zeros((0, 2))
    if not len(seen_left) or not len(seen_right):
        return none, none
    # Mutual best matches
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(bits_left, bits_right)
    matches = [m for m in matches if m.distance < _MAX_BITS]
    if not matches:
        return none, none
    start = np.array([seen_left[m.queryIdx].pt for m in matches], dtype=np.float32)
    coarse = np.array([seen_right[m.trainIdx].pt for m in matches], dtype=np.float32)
    size = (2 * _WINDOW_PX + 1, 2 * _WINDOW_PX + 1)
    fine, found, _ = cv2.calcOpticalFlowPyrLK(
        left, right, start[:, None], coarse[:, None].copy(), winSize=size, maxLevel=0,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )  # fmt: skip
    fine = fine[:, 0]
    kept = (found[:, 0] == 1) & (np.abs(fine - coarse).max(axis=1) < _MAX_MOVE_PX)
    return start[kept].astype(np.float64), fine[kept].astype(np.float64)
