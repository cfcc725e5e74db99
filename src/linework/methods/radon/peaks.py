"""Peaks of a Radon image by morphology: bins that equal its dilation and exceed a threshold."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy import ndimage

from linework.arrays import AnyArray, FloatArray
from linework.errors import OwnCodeError
from linework.kernels.radon import peaks as kernels
from linework.methods.radon.transform import RadonImage
from linework.processes.own_code import call_own


@dataclass(frozen=True, slots=True)
class Peaks:
    """Peaks as lines ``x cos(theta) + y sin(theta) = rho``, the strongest first, ties by theta, then rho.

    Parameters
    ----------
    theta_rad
        (n,) in [0, pi). [rad]
    rho_m
        (n,) from the Radon image's centre. [m]
    strength_m
        (n,) Radon image at the peak's bin; for a binary image the occupied length. [value x m]
    """

    theta_rad: FloatArray
    rho_m: FloatArray
    strength_m: FloatArray

    def __len__(self) -> int:
        return len(self.theta_rad)


def find_peaks(
    values: FloatArray,
    angles_rad: FloatArray,
    rho_m: FloatArray,
    *,
    threshold: float,
    theta_window_rad: float,
    rho_window_m: float,
) -> Peaks:
    """Return the peaks of a Radon image.

    A function of the same signature can take its place: ``Radon(find_peaks=mine)``, see `PeakFinder`.

    Parameters
    ----------
    values
        (n_angles, n_rho) float64 Radon image: for a binary image the occupied length of each line. [value x m]
    angles_rad
        (n_angles,) float64 theta, rising within [0, pi): direction of the lines' normals, anticlockwise from east.
        [rad]
    rho_m
        (n_rho,) float64 distance of the lines from the centre of the image, evenly spaced, symmetric about 0. [m]
    threshold
        Least strength, exclusive. [value x m]
    theta_window_rad, rho_window_m
        Lengths of the two line elements [rad, m]; of two peaks within half of both only the higher counts.

    Raises
    ------
    ValueError
        A window is negative, that of the angles is pi or more, the angles do not rise within [0, pi), or the shapes
        do not agree.

    Notes
    -----
    The image is dilated by a line along rho and by one along theta; a peak equals its dilation. The image
    is periodic in theta: beyond pi it continues at 0 with the sign of rho changed, and so do the elements.
    Bins of equal value in one another's window are one peak. Positions are refined below the bin by the
    paraboloid through the peak and its neighbours.

    References
    ----------
    Manandhar and Shibasaki (2002), "Line Detection by Radon Transformation": dilation with structuring
    line elements and a threshold in Radon space. The lengths of the elements are not published.

    Examples
    --------
    >>> from linework.methods.radon.transform import evenly_spaced_angles, radon_transform
    >>> from linework.model.grid import Grid, Image
    >>> rail = np.zeros((20, 51), dtype=bool)
    >>> rail[5] = True  # 10.2 m from west to east, 0.9 m north of the middle
    >>> radon = radon_transform(Image(rail, Grid(0.0, 4.0, 0.2, 0.2, 20, 51)), evenly_spaced_angles(2.0))
    >>> windows = {"theta_window_rad": 0.3, "rho_window_m": 1.0}
    >>> find_peaks(radon.values, radon.angles_rad, radon.rho_m, threshold=5.0, **windows).rho_m.round(3)
    array([0.9])
    """
    step = _rho_step(values, angles_rad, rho_m)
    half_window, half_bins = _half_windows(theta_window_rad, rho_window_m, step)
    theta, rho, strength = kernels.peaks(values, angles_rad, rho_m, threshold, half_window, half_bins).T
    order = np.lexsort((rho, theta, -strength))
    return Peaks(theta[order], rho[order], strength[order])


class PeakFinder(Protocol):
    """A function that finds the peaks of a Radon image, as `find_peaks` does.

    It returns `Peaks`, or three arrays of equal length: theta in [0, pi) [rad], rho [m] and strength [value x m].
    The order does not matter.
    """

    def __call__(
        self,
        values: FloatArray,
        angles_rad: FloatArray,
        rho_m: FloatArray,
        /,
        *,
        threshold: float,
        theta_window_rad: float,
        rho_window_m: float,
    ) -> Peaks | tuple[AnyArray, AnyArray, AnyArray]:
        """Return the peaks."""
        ...


def peaks_by(
    finder: PeakFinder,
    values: FloatArray,
    angles_rad: FloatArray,
    rho_m: FloatArray,
    *,
    threshold: float,
    theta_window_rad: float,
    rho_window_m: float,
) -> Peaks:
    """Return the peaks that an own function finds, checked and in the order of `find_peaks`.

    Raises
    ------
    OwnCodeError
        The function failed, or what it returns is not peaks.
    """
    found = call_own(
        finder, "find_peaks", values, angles_rad, rho_m,
        threshold=threshold, theta_window_rad=theta_window_rad, rho_window_m=rho_window_m,
    )  # fmt: skip
    columns = (found.theta_rad, found.rho_m, found.strength_m) if isinstance(found, Peaks) else found
    try:
        theta, rho, strength = (np.asarray(column, dtype=np.float64) for column in columns)
    except (TypeError, ValueError):
        raise OwnCodeError(
            f"returned {type(found).__name__}, expected Peaks or three arrays: theta_rad, rho_m, strength_m",
            where="find_peaks",
        ) from None
    if theta.ndim != 1 or not theta.shape == rho.shape == strength.shape:
        shapes = f"{theta.shape}, {rho.shape} and {strength.shape}"
        raise OwnCodeError(f"returned arrays of shapes {shapes}, expected one length", where="find_peaks")
    if not all(np.isfinite(column).all() for column in (theta, rho, strength)):
        raise OwnCodeError("returned peaks that are not finite numbers", where="find_peaks")
    if np.any((theta < 0.0) | (theta >= math.pi)):
        raise OwnCodeError("returned angles outside [0, pi)", where="find_peaks", advice="take radians")
    order = np.lexsort((rho, theta, -strength))
    return Peaks(theta[order], rho[order], strength[order])


def dilate(radon: RadonImage, *, theta_window_rad: float, rho_window_m: float) -> RadonImage:
    """Return the dilated Radon image that `find_peaks` compares with, for pictures.

    Raises
    ------
    ValueError
        As `find_peaks`.
    """
    step = _rho_step(radon.values, radon.angles_rad, radon.rho_m)
    half_window, half_bins = _half_windows(theta_window_rad, rho_window_m, step)
    return replace(radon, values=kernels.dilate_radon(radon.values, radon.angles_rad, half_window, half_bins))


def ridges(radon: RadonImage, *, width_m: float) -> RadonImage:
    """Return the white top hat of a Radon image along rho: its ridges narrower than `width_m` [m].

    Crowns, ramps and clusters of cells are broad in rho, a thin straight line is not. The opening by a line
    element along rho holds what is broad; it is subtracted.
    """
    n = 2 * max(1, round(0.5 * width_m / radon.rho_step_m)) + 1
    broad = ndimage.grey_opening(radon.values, size=(1, n), mode="constant")
    return replace(radon, values=radon.values - broad)


def _rho_step(values: FloatArray, angles_rad: FloatArray, rho_m: FloatArray) -> float:
    if values.shape != (len(angles_rad), len(rho_m)):
        raise ValueError(f"values: shape {values.shape}, expected {(len(angles_rad), len(rho_m))}")
    if np.any(np.diff(angles_rad) <= 0) or not (angles_rad[0] >= 0 and angles_rad[-1] < math.pi):
        raise ValueError("angles_rad: must rise within [0, pi)")
    return float(rho_m[1] - rho_m[0]) if len(rho_m) > 1 else 1.0


def _half_windows(theta_window_rad: float, rho_window_m: float, step: float) -> tuple[float, int]:
    if not (0.0 <= theta_window_rad < math.pi and rho_window_m >= 0.0):
        raise ValueError(
            f"windows of {theta_window_rad} rad and {rho_window_m} m, expected 0 to pi and not negative"
        )
    return 0.5 * theta_window_rad, int(0.5 * rho_window_m / step + 1e-9)
