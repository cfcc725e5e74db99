"""What each laser and head of a scanner is off by, in height and in brightness, and values without it.

In a small cell of level ground all beams measure the same height and, about, the same brightness: differences between
their means are the beams' own. They are estimated together by least squares over all cells in which two beams meet.

Separate from `sampled`, which chooses what of a survey is looked at.

References
----------
Glennie, C., Lichti, D. D. (2010): Static calibration and analysis of the Velodyne HDL-64E S2 for high accuracy mobile
scanning. Remote Sensing 2(6), 1610-1624. doi:10.3390/rs2061610
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray, checked
from linework.kernels.scanlines.beams import beam_means
from linework.model.points import Points
from linework.scanlines.scan_lines import ScanLines

#: Cells in which beams are compared: as small as the spacing of rings allows, for roads slope by 5 cm in 2 m. [m]
CELL_M = 0.5
#: Fewest points of a beam in a cell.
_LEAST = 3
#: A beam is compared with others in this number of cells at least, or is taken to be right.
_LEAST_CELLS = 20
#: Cells whose points scatter by more are not ground: grass, a kerb, a wall. [m]
_ROUGHEST_M = 0.08
#: Rounds of leaving out what is off by more than three of its sigmas: edges of paint, cars.
_ROUNDS, _SIGMAS = 5, 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamBiases:
    """What beams are off by.

    Parameters
    ----------
    head, beam
        (b,) int32: the beams, as in `ScanLines`.
    height_m, height_sigma_m
        (b,) float64 [m]: how much higher than the others a beam sees level ground, and the standard deviation of that;
        means over all points are 0. NaN sigma: not compared with any other.
    gain, gain_sigma
        (b,) float64: how much brighter it sees things, as a factor; 1 without intensities.
    index
        (n,) int64: the beam of each point.
    """

    head: AnyArray
    beam: AnyArray
    height_m: FloatArray
    height_sigma_m: FloatArray
    gain: FloatArray
    gain_sigma: FloatArray
    index: IntArray

    def heights(self, z: FloatArray) -> FloatArray:
        """Return heights without the biases of their beams, (n,) [m].

        Parameters
        ----------
        z
            (n,) float64 [m]: of the points that the biases were estimated from.
        """
        z = checked("z", z, np.float64, (len(self.index),))
        return np.asarray(z - self.height_m[self.index], dtype=np.float64)

    def intensities(self, intensity: AnyArray) -> Float32Array:
        """Return intensities without the gains of their beams, (n,) float32.

        Parameters
        ----------
        intensity
            (n,): of the points that the biases were estimated from.
        """
        intensity = checked("intensity", intensity, np.float64, (len(self.index),))
        return np.asarray(intensity / self.gain[self.index], dtype=np.float32)


def beam_biases(points: Points, lines: ScanLines) -> BeamBiases:
    """Return what each laser and head is off by, against the mean of the others where they meet.

    Parameters
    ----------
    points
        In any order.
    lines
        Their scan lines.

    Notes
    -----
    A laser that looks down steeply is nearer to a place and sees it at a steeper angle than one that grazes it: its gain
    here includes that, so that values without it are those of one brightness.

    A bias in range shows as one in height where a beam looks down, and less and less where it grazes: the estimate is the
    mean over the ground that the beam saw together with others. Passes and vehicles' errors of position are no beams:
    only points of one source are compared with each other.
    """
    head, beam, index = _beams_of(lines)
    n_beams = len(head)
    height, sigma = np.zeros(n_beams), np.full(n_beams, np.nan)
    gain, gain_sigma = np.zeros(n_beams), np.full(n_beams, np.nan)
    if n_beams > 1:
        cell = _cells(points, lines)
        order = np.argsort(cell, kind="stable")
        z = points.xyz[order, 2].copy()
        z[_is_rough(cell[order], z)] = np.nan
        weight = np.bincount(index, minlength=n_beams).astype(np.float64)
        height, sigma = _offsets(cell[order], index[order], z, weight)
        if points.intensity is not None:
            bright = points.intensity[order].astype(np.float64)
            # Ratios: gains multiply. Saturated values and zeros say nothing
            known = (bright > 0.0) & (bright < bright.max()) & np.isfinite(z)
            logs = np.full(len(bright), np.nan)
            logs[known] = np.log(bright[known])
            gain, gain_sigma = _offsets(cell[order], index[order], logs, weight)
    return BeamBiases(
        head=head, beam=beam, height_m=height, height_sigma_m=sigma, gain=np.exp(gain), gain_sigma=gain_sigma,
        index=index,
    )  # fmt: skip


def laser_gains(points: Points, laser: AnyArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the lasers, how much brighter each sees things than all, and the sigma of the logarithm of that, (b,) each.

    Parameters
    ----------
    points
        With intensities, in any order; their heads are not told apart.
    laser
        (n,) int number of the laser, 0 and more.

    Notes
    -----
    As `beam_biases`, without scan lines. The sigma is NaN, and the gain 1, of lasers that meet others in few cells.
    """
    if points.intensity is None or not len(points):
        return np.zeros(0, dtype=np.int64), np.ones(0), np.ones(0)
    # Numbers of lasers may be any: 64 of them from 1000 on
    numbers, index = np.unique(laser.astype(np.int64), return_inverse=True)
    index = index.ravel()
    weight = np.bincount(index).astype(np.float64)
    place = np.floor(points.xyz[:, :2] / CELL_M).astype(np.int64)
    place -= place.min(axis=0)
    cell = place[:, 0] * (int(place[:, 1].max()) + 1) + place[:, 1]
    # Ties by height and brightness: sums do not depend on the order of the points
    order = np.lexsort((points.intensity, points.xyz[:, 2], index, cell))
    z = points.xyz[order, 2].copy()
    z[_is_rough(cell[order], z)] = np.nan
    bright = points.intensity[order].astype(np.float64)
    known = (bright > 0.0) & (bright < bright.max()) & np.isfinite(z)
    logs = np.full(len(bright), np.nan)
    logs[known] = np.log(bright[known])
    gain, sigma = _offsets(cell[order], index[order], logs, weight)
    return numbers, np.exp(gain), sigma


def _beams_of(lines: ScanLines) -> tuple[AnyArray, AnyArray, IntArray]:
    """Return head and laser of each beam, and the beam of each point; points without lines are of the first."""
    index = np.zeros(len(lines), dtype=np.int64)
    if not lines.n_lines:
        return np.full(1, -1, dtype=np.int32), np.full(1, -1, dtype=np.int32), index
    pairs = np.stack([lines.line_head, lines.line_beam], axis=1)
    unique, of_line = np.unique(pairs, axis=0, return_inverse=True)
    has = lines.line >= 0
    index[has] = of_line.reshape(-1)[lines.line[has]]
    return unique[:, 0], unique[:, 1], index


def _cells(points: Points, lines: ScanLines) -> IntArray:
    """Return a number for each point's cell and source, (n,) int64."""
    place = np.floor(points.xyz[:, :2] / CELL_M).astype(np.int64)
    place -= place.min(axis=0)
    source = lines.line_source[lines.line] if lines.n_lines else np.zeros(len(points), dtype=np.int32)
    source = source - source.min()
    width = int(place[:, 1].max()) + 1
    return np.asarray(
        (source * (int(place[:, 0].max()) + 1) + place[:, 0]) * width + place[:, 1], dtype=np.int64
    )


def _is_rough(cell: IntArray, z: FloatArray) -> AnyArray:
    """Return which points, by cells, are of cells whose heights scatter, or beside others."""
    start = np.flatnonzero(np.r_[True, np.diff(cell) != 0])
    count = np.diff(np.r_[start, len(cell)])
    shifted = z - np.repeat(z[start], count)
    mean = np.add.reduceat(shifted, start) / count
    spread = np.sqrt(np.maximum(np.add.reduceat(shifted**2, start) / count - mean**2, 0.0))
    return np.repeat(spread > _ROUGHEST_M, count)


def _offsets(
    cell: IntArray, beam: IntArray, value: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return what each beam is off by, and its sigma: least squares over cells, each with a level of its own."""
    n_beams = len(weight)
    offset: FloatArray = np.zeros(n_beams)
    sigma: FloatArray = np.full(n_beams, np.nan)
    cells, beams, means, variances = beam_means(cell, beam, value, n_beams, _LEAST)
    _, at = np.unique(cells, return_inverse=True)
    keep = np.bincount(at, minlength=1)[at] > 1 if len(at) else np.zeros(0, dtype=bool)
    at, beams, means, variances = at[keep], beams[keep], means[keep], variances[keep]
    if not len(at):
        return offset, sigma
    # Within a cell slopes and paint add to the noise of means, the same for all beams: its size follows from residuals
    floor = float(np.median(variances)) + 1e-12
    w = 1.0 / (variances + floor)
    good = np.ones(len(at), dtype=bool)
    n_cells = int(at.max()) + 1
    normal = np.zeros((n_beams, n_beams))
    for _ in range(_ROUNDS):
        wg = w * good
        total = np.maximum(np.bincount(at, wg, n_cells), 1e-30)
        level = np.bincount(at, wg * means, n_cells) / total
        # Reduced normal equations: cells' levels eliminated
        normal = np.diag(np.bincount(beams, wg, n_beams))
        order = np.argsort(at, kind="stable")
        _less_levels(normal, at[order], beams[order], wg[order], total)
        right = np.bincount(beams, wg * (means - level[at]), n_beams)
        # The mean over all points is 0
        share = weight / weight.sum()
        scale = float(np.trace(normal)) + 1e-30
        solved = np.linalg.lstsq(normal + scale * np.outer(share, share), right, rcond=1e-10)[0]
        offset = np.asarray(solved, dtype=np.float64)
        level = np.bincount(at, wg * (means - offset[beams]), n_cells) / total
        residual = (means - offset[beams] - level[at]) * np.sqrt(w)
        spread = 1.4826 * float(np.median(np.abs(residual[good]))) + 1e-12
        good = np.abs(residual) <= _SIGMAS * spread
    met = np.bincount(beams[good], minlength=n_beams)
    enough = met >= _LEAST_CELLS
    spread2 = float(np.mean(residual[good] ** 2))
    inverse = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
    sigma[enough] = np.sqrt(np.maximum(spread2 * np.diag(inverse)[enough], 0.0))
    offset = np.where(enough, offset, 0.0)
    return offset - float(np.sum(offset * weight) / weight.sum()), sigma


def _less_levels(normal: FloatArray, at: IntArray, beams: IntArray, w: FloatArray, total: FloatArray) -> None:
    """Subtract from normal equations what the unknown levels of cells take, in place; rows are sorted by cell."""
    start = np.flatnonzero(np.r_[True, np.diff(at) != 0, True])
    longest = int(np.diff(start).max())
    # Pairs of beams of a cell, by how far apart they stand in it
    for step in range(longest):
        a = np.arange(len(at) - step)
        b = a + step
        same = at[a] == at[b]
        a, b = a[same], b[same]
        share = w[a] * w[b] / total[at[a]]
        np.add.at(normal, (beams[a], beams[b]), -share)
        if step:
            np.add.at(normal, (beams[b], beams[a]), -share)
