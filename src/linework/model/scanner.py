"""What is known of the scanner behind a survey's points, for every tile alike.

Separate from `linework.scanlines`, which recovers scan lines with it: tiles carry it to the methods.
"""

from __future__ import annotations

from dataclasses import dataclass

from linework.arrays import BoolArray, FloatArray, Int32Array, IntArray

#: Kinds of scanners: a mirror that turns one beam (on a van, or at rest), beams that spin together, an aircraft's strips,
#: and points from which no scan lines can be recovered.
PROFILE, SPINNING, AIRBORNE, UNORDERED = "profile", "spinning", "airborne", "none"


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

    def cuts(self, device: int) -> FloatArray:
        """Return when the lines of a device begin [s]."""
        return self.cut_s[self.cut_start[device] : self.cut_start[device + 1]]
