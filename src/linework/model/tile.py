"""A tile of a survey as a method receives it, and what is known of the scanner of all tiles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Local origins are whole multiples of this: of every lattice that methods use (cells, windows, columns). [m]
ORIGIN_STEP_M = 1200.0


#: Kinds of scanners: a mirror that turns one beam (on a van, or at rest), beams that spin together, an aircraft's strips,
#: and points from which no scan lines can be recovered.
PROFILE, SPINNING, AIRBORNE, UNORDERED = "profile", "spinning", "airborne", "none"


@dataclass(frozen=True, slots=True, eq=False)
class LaserGains:
    """What lasers differ by in brightness: gains of the lasers of a spinning scanner, and rows of strips that overlap.

    Gains are those at the ranges at which each laser sees the road.

    Parameters
    ----------
    column
        Column of the points that has their laser; "" where there is one laser, or it is not known.
    gain
        (b,) float64: by the number of the laser; 1 for the mean over all points.
    rows
        (k, 3) float64: directions of the scan lines of sparse points, which are as far apart as a line of paint is wide and
        more, as unit vectors in plan, and how far the lines are apart [m]. Where strips overlap, each may see things with a gain of its own
        (`linework.kernels.paint.scan_rows`).
    """

    column: str = ""
    gain: FloatArray = field(default_factory=lambda: np.ones(0))
    rows: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def without(self, points: Points) -> Points:
        """Return points with the intensities that one laser would have recorded.

        >>> gains = LaserGains("ring", np.array([0.5, 2.0]))
        >>> points = Points(np.zeros((2, 3)), intensity=np.array([10.0, 40.0]), ring=np.array([0, 1]))
        >>> gains.without(points).intensity.tolist()
        [20.0, 20.0]
        """
        if points.intensity is None or self.column not in points.columns:
            return points
        evened = self.evened(points.intensity, points.columns[self.column])
        return Points(
            points.xyz, intensity=evened, time_s=points.time_s, crs=points.crs, columns=points.columns
        )

    def evened(self, intensity: Float32Array, laser: Float32Array) -> Float32Array:
        """Return intensities (n,) without the gains of their lasers (n,), NaN: not known.

        >>> LaserGains("ring", np.array([0.5, 2.0])).evened(np.float32([10.0, 40.0]), np.float32([0, 1])).tolist()
        [20.0, 20.0]
        """
        known = (laser >= 0) & (laser < len(self.gain))
        if not known.any():
            return intensity
        gain = np.where(known, self.gain[np.where(known, laser, 0).astype(np.int64)], 1.0)
        return (intensity / gain).astype(np.float32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScannerTiming:
    """What is to be known of a scanner to give each point its line: the same for every tile of a survey.

    Parameters
    ----------
    kind
        As in `ScanLines`.
    how
        What the points showed, a sentence each.
    source, head
        (d,) int32: source and head of each device, -1 where points have no such field.
    pulse_s
        (d,) float64 [s]: time between two pulses.
    turn_s
        (d,) float64 [s]: time between the beginnings of two lines; NaN: unknown, or the spot moves to and fro.
    is_merged
        (d,) bool: the device is several heads in one stream, told apart by tracking only.
    cut_start, cut_s
        (d + 1,) int64 and (c,) float64 [s]: when the lines of each device begin.
    leap_m
        Farthest that two successive points of a line are apart without a gap. [m]
    half_chord_m
        Directions are measured over this distance to either side. [m]
    ring_m
        (b,) float64 [m]: mean distance of the points of each laser of a spinning scanner from the middle of its turns;
        empty for others.
    spacing_m
        Mean spacing of the points in plan, for points without lines. [m]
    used
        The columns of the points that tell their devices and lasers apart.
    gains
        Of the lasers.
    """

    kind: str
    how: tuple[str, ...]
    source: Int32Array
    head: Int32Array
    pulse_s: FloatArray
    turn_s: FloatArray
    is_merged: BoolArray
    cut_start: IntArray
    cut_s: FloatArray
    leap_m: float
    half_chord_m: float
    ring_m: FloatArray
    spacing_m: float
    used: tuple[str, ...]
    gains: LaserGains = LaserGains()

    def cuts(self, device: int) -> FloatArray:
        """Return when the lines of a device begin [s]."""
        return self.cut_s[self.cut_start[device] : self.cut_start[device + 1]]


@dataclass(frozen=True, slots=True)
class TileData:
    """The points of a tile's core and of the buffer around it.

    Parameters
    ----------
    tile_id
        Name of the tile, the same in every run.
    core
        Area that this tile is responsible for (half open); points beyond it are buffer.
    points
        Points of core and buffer.
    trajectory
        The vehicle's path (whole), or None.
    source
        Name of the data source, for the lines' `source` field.
    surface
        Road and ground surface of the survey over core and buffer; None: the method derives it from the points.
    origin
        Local origin shared by all tiles of a survey [m, world], so that the same points give the same
        numbers in each of them; None: derived from the points (see `local_origin`).
    is_whole
        Whether the tile is the whole survey: its lines are then not cut at the edges of the core.
    scanner
        What is known of the survey's scanner; None: the method derives it from the points.
    gains
        Of the scanner's lasers; methods that weigh brightness take them out of the intensities.
    """

    tile_id: str
    core: Bounds
    points: Points
    trajectory: Trajectory | None = None
    source: str = ""
    surface: Ground | None = None
    origin: tuple[float, float, float] | None = None
    is_whole: bool = True
    scanner: ScannerTiming | None = None
    gains: LaserGains = LaserGains()


def local_origin(west: float, south: float, low: float) -> tuple[float, float, float]:
    """Return the local origin of a survey with this south-west corner and lowest height.

    >>> local_origin(500100.0, 5400000.0, 31.0)
    (499200.0, 5400000.0, 0.0)
    """
    east, north, up = (math.floor(value / ORIGIN_STEP_M) * ORIGIN_STEP_M for value in (west, south, low))
    return east, north, up
