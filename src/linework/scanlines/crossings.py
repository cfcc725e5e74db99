"""How many independent measurements a candidate rests on: the scan lines, passes and lasers that cross it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.errors import UsageError
from linework.model.tile import AIRBORNE, SPINNING, ScannerTiming
from linework.scanlines.scan_lines import ScanLines

#: A pause between scan lines at one place that makes them two passes: a mirror is back within a second, a van that turns
#: round needs longer. [s]
PASS_PAUSE_S = 10.0
#: A candidate nearer to the direction of the scan lines lies along them: one line may draw all of it. [deg]
ALONG_DEG = 10.0
#: A single scan line draws a curve on whatever it meets, and two neighbouring lasers draw two beside each other: a line
#: takes this many scan lines (effective number) that agree.
LEAST_CROSSINGS = 3.0
#: Half a turn of the fastest mirrors, of 500 turns a second. [s]
HALF_TURN_S = 1e-3
#: Mean step between successive points of a scan line over their extent: 1 over their number, and noise; at random a third.
#: Of fewer points nothing is said: a swing that turns back among them leaps as far.
_MOST_LEAP, _LEAST_LEAPS = 0.15, 12
#: Points of a candidate that have one time: four returns of a pulse, from two heads. More is a coarse clock.
_MOST_AT_ONCE = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Support:
    """What a candidate rests on.

    Parameters
    ----------
    n_points
        Points of the candidate.
    n_lines
        Scan lines that have points in it: independent crossings. Where points have no scan lines: estimated from its
        length, direction, and the spacing of the pattern.
    n_eff
        Effective number of crossings: (sum w)**2 / sum w**2 over the points w of each line; one line with many points
        and two with one each are little more than one crossing.
    n_passes
        Passes: sources, and times that are more than 10 s apart.
    n_beams
        Lasers and heads; 1 where points do not tell.
    angle_deg
        Angle between the candidate and the scan lines, 0 to 90; NaN: unknown.
    """

    n_points: int
    n_lines: int
    n_eff: float
    n_passes: int
    n_beams: int
    angle_deg: float

    @property
    def is_along(self) -> bool:
        """Whether it lies along the scan lines: it then needs two passes or lasers that agree."""
        return bool(self.angle_deg < ALONG_DEG)


def support_of(lines: ScanLines, points: IntArray, along: tuple[float, float] | None = None) -> Support:
    """Return what a candidate rests on.

    Parameters
    ----------
    lines
        Scan lines of the points.
    points
        (k,) int64: indices of the candidate's points.
    along
        From start to end of the candidate, in plan [m]; None: unknown. Its length matters for points without scan lines.

    Raises
    ------
    UsageError
        An index that no point has.

    Examples
    --------
    >>> from linework.model.points import Points
    >>> from linework.scanlines.recover import recover_scan_lines
    >>> x, y = np.tile(np.linspace(0.0, 5.0, 50), 20), np.repeat(np.arange(20) * 0.1, 50)
    >>> time = np.repeat(np.arange(20) * 0.02, 50) + np.tile(np.arange(50) * 1e-4, 20)
    >>> lines = recover_scan_lines(Points(np.stack([x, y, 0.0 * x], axis=1), time_s=time))
    >>> found = support_of(lines, np.flatnonzero((x > 2.0) & (x < 2.3)), (0.0, 1.0))
    >>> found.n_lines, found.n_passes, found.angle_deg, found.is_along
    (20, 1, 90.0, False)
    """
    points = np.asarray(points, dtype=np.int64)
    if len(points) and (points.min() < 0 or points.max() >= len(lines)):
        raise UsageError(
            f"indices from {points.min()} to {points.max()} of {len(lines)} points",
            where="points",
            advice="give indices of the points whose scan lines these are",
        )
    angle = _angle(lines.direction[points], along)
    number = lines.line[points]
    number = number[number >= 0]
    if not len(number):
        return _estimated(lines, points, along, angle)
    crossing, count = np.unique(number, return_counts=True)
    weight = count.astype(np.float64)
    return Support(
        n_points=len(points),
        n_lines=len(crossing),
        n_eff=float(weight.sum() ** 2 / np.sum(weight**2)),
        n_passes=_passes(lines, crossing),
        n_beams=len(
            np.unique(np.stack([lines.line_head[crossing], lines.line_beam[crossing]], axis=1), axis=0)
        ),
        angle_deg=angle,
    )


def crossings_in_time(
    time_s: FloatArray, xyz: FloatArray, laser: AnyArray | None = None, timing: ScannerTiming | None = None
) -> float:
    """Return how many scan lines drew the points of a candidate, as their effective number (sum w)**2 / sum w**2.

    Told by pauses alone, for candidates of few points: a beam crosses a thing within a fraction of a turn.

    Parameters
    ----------
    time_s
        (n,) float64 [s], in any order.
    xyz
        (n, 3) float64 [m].
    laser
        (n,) number of the laser of a spinning scanner, or None.
    timing
        Of the survey; None: not known.

    Notes
    -----
    A pause of half a turn is between two lines. How long a turn takes is not known of several heads in one stream, and of
    strips: there a millisecond is, half a turn of the fastest mirrors. Of a spinning lidar that was not seen to turn, all
    points of a laser are one line.

    NaN where times tell nothing: where the points of what would be a scan line leap to and fro along the candidate, files
    have coarse or made-up times.

    Examples
    --------
    >>> from linework.model.points import Points
    >>> from linework.scanlines.timing import scanner_timing
    >>> x, y = np.tile(np.linspace(0.0, 5.0, 50), 20), np.repeat(np.arange(20) * 0.1, 50)
    >>> time = np.repeat(np.arange(20) * 0.02, 50) + np.tile(np.arange(50) * 1e-4, 20)
    >>> xyz = np.stack([x, y, 0.0 * x], axis=1)
    >>> timing = scanner_timing(Points(xyz, time_s=time))
    >>> [crossings_in_time(time[on], xyz[on], timing=timing) for on in (x == 0.0, y == 0.0)]
    [20.0, 1.0]
    """
    if not len(time_s):
        return 0.0
    pause = HALF_TURN_S
    if timing is not None and timing.kind != AIRBORNE:
        turn = np.fmax.reduce(timing.turn_s, initial=np.nan)
        if np.isfinite(turn):
            pause = 0.5 * float(turn)
        elif timing.kind == SPINNING:
            pause = np.inf
    beam = np.zeros(len(time_s)) if laser is None else laser
    along = _along(xyz)
    order = np.lexsort((along, time_s, beam))
    is_first = np.concatenate(
        [[True], (np.diff(beam[order]) != 0) | (np.diff(time_s[order]) > pause), [True]]
    )
    start = np.flatnonzero(is_first)
    weight = np.diff(start).astype(np.float64)
    n_eff = float(weight.sum() ** 2 / np.sum(weight**2))
    largest = int(np.argmax(weight))
    if n_eff < LEAST_CROSSINGS:
        drawn = order[start[largest] : start[largest + 1]]
        if _leaps(along[drawn], time_s[drawn]):
            return float("nan")
    return n_eff


def _along(xyz: FloatArray) -> FloatArray:
    """Return the positions of points (n, 3) along their longest extent, (n,) [m]."""
    away = xyz - xyz.mean(axis=0)
    axis = np.linalg.eigh(away.T @ away)[1][:, -1]
    return np.asarray(away @ axis)


def _leaps(along: FloatArray, time_s: FloatArray) -> bool:
    """Return whether positions (n,) in the order of their times (n,) cannot be those of one scan line.

    A scan line passes them once, at random they are a third of the way apart. Many points of one time have no order.
    """
    if len(along) < _LEAST_LEAPS:
        return False
    if np.count_nonzero(np.diff(time_s)) < len(along) / _MOST_AT_ONCE:
        return True
    return bool(np.abs(np.diff(along)).sum() > _MOST_LEAP * len(along) * np.ptp(along))


def points_near_segment(xy: FloatArray, start: FloatArray, end: FloatArray, width_m: float) -> IntArray:
    """Return the points within half a width of a segment in plan, (k,) int64.

    Parameters
    ----------
    xy
        (n, 2) or (n, 3) float64 [m].
    start, end
        (2,) or (3,) float64 [m].
    width_m
        Of the strip around the segment. [m]
    """
    along = end[:2] - start[:2]
    length = float(np.hypot(*along))
    if length == 0.0:
        return np.flatnonzero(np.hypot(*(xy[:, :2] - start[:2]).T) <= 0.5 * width_m)
    unit = along / length
    away = xy[:, :2] - start[:2]
    inside = np.abs(away @ np.array([-unit[1], unit[0]])) <= 0.5 * width_m
    at = away @ unit
    found: BoolArray = inside & (at >= 0.0) & (at <= length)
    return np.flatnonzero(found)


def _angle(direction: AnyArray, along: tuple[float, float] | None) -> float:
    """Return the angle between a candidate and the mean axis of the scan lines at its points [deg]."""
    if along is None:
        return float("nan")
    known = direction[np.isfinite(direction[:, 0])].astype(np.float64)
    if not len(known):
        return float("nan")
    double = 2.0 * np.arctan2(known[:, 1], known[:, 0])
    axis = 0.5 * np.arctan2(np.sin(double).mean(), np.cos(double).mean())
    off = np.degrees(axis - np.arctan2(along[1], along[0])) % 180.0
    return float(min(off, 180.0 - off))


def _passes(lines: ScanLines, crossing: AnyArray) -> int:
    source, time = lines.line_source[crossing], lines.line_time_s[crossing]
    order = np.lexsort((time, source))
    source, time = source[order], time[order]
    return 1 + int(np.count_nonzero((np.diff(source) != 0) | (np.diff(time) > PASS_PAUSE_S)))


def _estimated(
    lines: ScanLines, points: IntArray, along: tuple[float, float] | None, angle_deg: float
) -> Support:
    """Return the support of a candidate without scan lines: as many crossings as lines of the pattern lie across it."""
    n = len(points)
    crossings = float(n)
    if n and along is not None:
        across = float(np.median(lines.spacing_across_m[points]))
        sine = np.sin(np.radians(angle_deg)) if np.isfinite(angle_deg) else 1.0
        crossings = float(np.clip(np.hypot(*along) * sine / across, 1.0, n))
    return Support(
        n_points=n, n_lines=round(crossings), n_eff=crossings, n_passes=min(n, 1), n_beams=min(n, 1), angle_deg=angle_deg
    )  # fmt: skip
