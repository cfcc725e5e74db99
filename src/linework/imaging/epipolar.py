"""Do two rectified images belong together: is the same place seen in the same row of both.

Where they do not, they were taken at different moments, or the calibration is not theirs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray

#: Corners looked for in each image: enough that a hundred are left on an empty road.
_N_CORNERS = 1000
#: Bits of 256 in which the descriptions of one corner may differ (as usual for ORB: fewer than 1 in 6).
_MAX_BITS = 40
#: Half the window, in pixels, that is laid over a corner to find its row to a tenth of a pixel; and how far
#: that may move it from where the coarse match saw it.
_WINDOW_PX, _MAX_MOVE_PX = 7, 3.0
#: A point that is this far off its row is another place, or the images do not belong together. [pixels]
ROW_TOLERANCE_PX = 1.0
#: Fewer matches say nothing: night, fog, a wall without marks.
LEAST_MATCHES = 30


@dataclass(frozen=True, slots=True)
class RowFit:
    """How well the rows of two images match.

    Parameters
    ----------
    n_matches
        Places found in both.
    n_fitting
        Of these, how many are in the same row to `ROW_TOLERANCE_PX`, and not behind infinity.
    n_swapped
        In the same row, but behind infinity: farther right in the right image than in the left.
    offset_px
        Median of the right row less the left row; NaN without matches.
    error_px
        Median of the absolute difference of the rows; NaN without matches.
    """

    n_matches: int
    n_fitting: int
    n_swapped: int
    offset_px: float
    error_px: float

    @property
    def is_known(self) -> bool:
        """Whether there are enough matches to say anything."""
        return self.n_matches >= LEAST_MATCHES


def row_fit(left: AnyArray, right: AnyArray) -> RowFit:
    """Match corners of two rectified grey images without regard to rows, and compare their rows.

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
    import cv2

    cv2.setNumThreads(1)
    orb = cv2.ORB_create(nfeatures=_N_CORNERS, fastThreshold=10)  # type: ignore[attr-defined]
    (seen_left, bits_left), (seen_right, bits_right) = (orb.detectAndCompute(i, None) for i in (left, right))
    none = np.zeros((0, 2))
    if not len(seen_left) or not len(seen_right):
        return none, none
    # Each the other's best
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
