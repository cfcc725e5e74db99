"""What scanner a survey has, from some of its points: pieces of a few blocks, whatever the size of the survey.

Separate from `linework.scanlines.timing`, which looks at every point it is given: here, lines follow from what is near a
point and from a table of turns that needs no points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from linework.arrays import FloatArray, IntArray, offsets_of
from linework.model.grid import Bounds, holds
from linework.model.points import Points
from linework.model.tile import SPINNING, UNORDERED, LaserGains, ScannerTiming
from linework.scanlines.beams import laser_gains
from linework.scanlines.fields import laser_column
from linework.scanlines.pattern import mean_spacing_m, spacing_pattern
from linework.scanlines.timing import scanner_timing

#: Side of the blocks that pieces are taken from [m], and how many: at a van's speed each is drawn in seconds, some
#: hundred turns.
SAMPLED_BLOCK_M, _N_PIECES = 64.0, 4
#: Points of a piece: the middle of a block that has more. A hundred turns of the fastest scanners. [points]
_PIECE_POINTS = 500_000
#: Mean spacing of points from which rows are looked for: as wide as the narrowest line. Nearer ones give each line several
#: rows. [m]
ROWS_APART_M = 0.1
#: Directions within this are one: sine of 1 degree, less than a row of 3 m and 4 cm shows; the share of all points
#: that a direction has at least, and most directions: two crossing flights, with to and fro of each mirror.
_SAME_ROWS, _ROWS_SHARE, _MOST_ROWS = 0.0175, 0.05, 4


def pieces_to_sample(blocks: IntArray, counts: IntArray) -> list[Bounds]:
    """Return the areas whose points show a survey's scanner.

    Parameters
    ----------
    blocks, counts
        (n, 2) int64 numbers of the blocks east and north, and (n,) points in each.

    Examples
    --------
    >>> pieces_to_sample(np.array([[0, 0]]), np.array([2_000_000]))
    [Bounds(west=16.0, south=16.0, east=48.0, north=48.0)]
    """
    order = np.lexsort((blocks[:, 0], blocks[:, 1]))
    ends = np.cumsum(counts[order])
    at = np.searchsorted(ends, (np.arange(_N_PIECES) + 0.5) / _N_PIECES * ends[-1])
    found = []
    for i in np.unique(order[at]).tolist():
        share = math.sqrt(min(1.0, _PIECE_POINTS / max(int(counts[i]), 1)))
        half = 0.5 * max(round(SAMPLED_BLOCK_M * share), 1)
        east, north = ((float(number) + 0.5) * SAMPLED_BLOCK_M for number in blocks[i])
        found.append(Bounds(east - half, north - half, east + half, north + half))
    return found


def sampled_timing(
    blocks: IntArray, counts: IntArray, read: Callable[[Bounds], Points], times_s: tuple[float, float]
) -> ScannerTiming:
    """Return what is known of a survey's scanner, from pieces of the survey.

    Parameters
    ----------
    blocks, counts
        Blocks of 64 m, see `pieces_to_sample`.
    read
        Returns the points of an area.
    times_s
        First and last time of the survey's points. [s]

    Notes
    -----
    Of profile scanners and strips, each point joins the line that was last drawn beside it. Turns of a spinning lidar are
    counted from the survey's first time: where a turn begins is a convention.
    """
    read_pieces = [read(area) for area in pieces_to_sample(blocks, counts)]
    sample = [_without_devices(piece) for piece in read_pieces]
    timing = replace(scanner_timing(Points.concatenate(sample)), gains=_gains_of_pieces(read_pieces))
    if timing.kind == UNORDERED:
        spacings = [scanner_timing(piece).spacing_m for piece in sample if len(piece)]
        return replace(timing, spacing_m=float(np.median(spacings)) if spacings else timing.spacing_m)
    if timing.kind == SPINNING:
        turn = _turn_s(timing)
        cuts = _turns_between(times_s, turn)
        return replace(timing, turn_s=np.array([turn]), cut_start=offsets_of([len(cuts)]), cut_s=cuts)
    n = len(timing.source)
    return replace(
        timing, is_merged=np.ones(n, dtype=np.bool_), cut_start=offsets_of([0] * n), cut_s=np.zeros(0)
    )


def sampled_gains(blocks: IntArray, counts: IntArray, read: Callable[[Bounds], Points]) -> LaserGains:
    """Return the gains of a survey's lasers, from the pieces that `sampled_timing` looks at; parameters as there."""
    first, *rest = pieces_to_sample(blocks, counts)
    piece = read(first)
    # Of most surveys one piece tells that they have one laser, and many points
    if len(piece) and not laser_column(piece) and mean_spacing_m(piece.xyz) < ROWS_APART_M:
        return LaserGains()
    return _gains_of_pieces([piece, *(read(area) for area in rest)])


def gains_of_points(points: Points) -> LaserGains:
    """Return the gains of the lasers of points that are a survey by themselves.

    >>> gains_of_points(Points(np.zeros((3, 3)))).column
    ''
    """
    return sampled_gains(*_blocks_of(points), _reader_of(points)) if len(points) else LaserGains()


def timing_of_points(points: Points) -> ScannerTiming:
    """Return what is known of the scanner of points that are a survey by themselves, as for a survey of files.

    >>> timing_of_points(Points(np.zeros((3, 3)))).kind
    'none'
    """
    if not len(points):
        return scanner_timing(points)
    time = points.time_s
    times = (math.nan, math.nan) if time is None else (float(time.min()), float(time.max()))
    return sampled_timing(*_blocks_of(points), _reader_of(points), times)


def _blocks_of(points: Points) -> tuple[IntArray, IntArray]:
    """Return the blocks that hold points, (n, 2), and how many each does, (n,)."""
    number = np.floor(points.xyz[:, :2] / SAMPLED_BLOCK_M).astype(np.int64)
    low = number.min(axis=0)
    n_north = int(number[:, 1].max() - low[1]) + 1
    codes, counts = np.unique((number[:, 0] - low[0]) * n_north + number[:, 1] - low[1], return_counts=True)
    return np.stack(np.divmod(codes, n_north), axis=1) + low, counts


def _reader_of(points: Points) -> Callable[[Bounds], Points]:
    return lambda area: points.take(holds(area, points.xyz[:, :2]))


def _gains_of_pieces(pieces: Sequence[Points]) -> LaserGains:
    """Return the gains of the lasers of some pieces; none where they have one laser, or no intensities."""
    known = [piece for piece in pieces if len(piece)]
    name = laser_column(known[0]) if known else ""
    if not name or any(piece.intensity is None or name not in piece.columns for piece in known):
        return LaserGains(rows=_rows_of_pieces(known))
    laser = np.concatenate([piece.columns[name] for piece in known])
    intensity = np.concatenate([piece.intensity for piece in known if piece.intensity is not None])
    has = np.flatnonzero(laser >= 0)  # NaN: of a file without lasers
    xyz = np.concatenate([piece.xyz for piece in known])
    numbers, gains, sigmas = laser_gains(Points(xyz[has], intensity=intensity[has]), laser[has])
    of_number = np.ones(int(numbers.max(initial=-1)) + 1)
    of_number[numbers] = np.where(np.isfinite(sigmas), gains, 1.0)
    return LaserGains(name, of_number, _rows_of_pieces(known))


def _rows_of_pieces(pieces: Sequence[Points]) -> FloatArray:
    """Return the directions of scan lines of sparse points, (k, 3): see `LaserGains.rows`.

    Whether the points are sparse is told by the first piece, as `sampled_gains` does. Strips that are flown to and fro share
    one direction; the directions that most points have come first.
    """
    rows = list[tuple[int, FloatArray]]()
    if pieces and mean_spacing_m(pieces[0].xyz) >= ROWS_APART_M:
        patterns, counts = _patterns_of(pieces)
        while len(patterns):
            best = patterns[np.argmax(counts)]
            alike = np.abs(patterns[:, 0] * best[1] - patterns[:, 1] * best[0]) <= _SAME_ROWS
            # Of either sign: turned as the best, then the mean over all points
            sign = np.where(patterns[alike, :2] @ best[:2] < 0.0, -1.0, 1.0)
            same = patterns[alike] * np.column_stack([sign, sign, np.ones(len(sign))])
            x, y, apart_m = np.average(same, axis=0, weights=counts[alike])
            rows.append(
                (int(counts[alike].sum()), np.array([x, y, apart_m]) / [*[math.hypot(x, y)] * 2, 1.0])
            )
            patterns, counts = patterns[~alike], counts[~alike]
    least = _ROWS_SHARE * sum(map(len, pieces))
    found = sorted((row for row in rows if row[0] >= least), key=lambda row: -row[0])[:_MOST_ROWS]
    return np.array([row for _, row in found]).reshape(-1, 3)


def _patterns_of(pieces: Sequence[Points]) -> tuple[FloatArray, IntArray]:
    """Return the patterns of the blocks of pieces, (m, 3): direction and spacing across; and how many points have each, (m,)."""
    found: list[FloatArray] = [np.zeros((0, 3))]
    for piece in pieces:
        direction, _, across_m = spacing_pattern(piece.xyz, mean_spacing_m(piece.xyz))
        rows = np.column_stack([direction, across_m]).astype(np.float64)
        found.append(rows[np.isfinite(direction[:, 0])])
    return np.unique(np.concatenate(found), axis=0, return_counts=True)


def _without_devices(points: Points) -> Points:
    """Return points with times and lasers alone: other fields tell heads apart that a part of a survey may lack."""
    laser = laser_column(points)
    kept = {laser: points.columns[laser]} if laser else {}
    return Points(points.xyz, time_s=points.time_s, crs=points.crs, columns=kept)


def _turn_s(timing: ScannerTiming) -> float:
    """Return how long a turn of a spinning lidar takes; NaN where it was not observed."""
    step = np.diff(timing.cuts(0))
    step = step[step < 1.0]  # between two pieces the lidar turned unseen
    return float(np.median(step)) if len(step) >= 2 else math.nan


def _turns_between(times_s: tuple[float, float], turn_s: float) -> FloatArray:
    if not math.isfinite(turn_s):
        return np.array([times_s[0]])
    return np.asarray(np.arange(times_s[0], times_s[1] + turn_s, turn_s), dtype=np.float64)
