"""What the heads of laser scanners send out: the direction, scan line, beam and angle of every pulse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray

#: Directions that are told apart between two pulses of a profile scanner.
_FINER = 64

#: Bodies of vehicles in their frame: beams through them are lost. (x, y, z from; to) [m]
BODIES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "van": ((-1.0, -0.95, 0.25), (4.2, 0.95, 1.9)),
    # The cabin; bonnet and boot are low enough not to matter
    "car": ((-1.0, -0.85, 0.20), (1.4, 0.85, 1.5)),
    # The foot of a tripod hides a cone of about 30 degrees below the scanner
    "tripod": ((-0.95, -0.95, -1.75), (0.95, 0.95, -1.65)),
}


@dataclass(frozen=True, slots=True)
class Pulses:
    """Pulses of one head, in the order in which they are sent.

    Parameters
    ----------
    direction
        (n, 3) float64: unit vectors, frame of what carries the head.
    sweep
        (n,) int64: number of the scan line, from 0: revolution or swing of the mirror; of a spinning scanner,
        revolution of each beam.
    beam
        (n,) int64: number of the laser within the head, from 0.
    angle_deg
        (n,) float32 [deg]: scan angle.
    is_edge
        (n,) bool: last pulse of a scan line before the mirror turns back or jumps.
    is_forward
        (n,) bool: the mirror swings from left to right.
    """

    direction: FloatArray
    sweep: IntArray
    beam: IntArray
    angle_deg: Float32Array
    is_edge: BoolArray
    is_forward: BoolArray

    def take(self, index: AnyArray) -> Pulses:
        """Return the chosen pulses."""
        return Pulses(*(getattr(self, name)[index] for name in self.__dataclass_fields__))


class Head(Protocol):
    """A scanner head: what `scan` asks of it."""

    @property
    def position_m(self) -> tuple[float, float, float]:
        """Where it is in the frame of what carries it."""
        ...

    @property
    def body(self) -> str:
        """What hides things from it, one of `BODIES`; "": nothing."""
        ...

    @property
    def n_beams(self) -> int:
        """How many lasers it has."""
        ...

    @property
    def pulses_per_s(self) -> float:
        """Pulses of all lasers together [1/s]."""
        ...

    @property
    def range_bias_m(self) -> tuple[float, ...]:
        """What the ranges of each beam are off by."""
        ...

    @property
    def gain(self) -> tuple[float, ...]:
        """How bright each beam sees things, in relation to the others."""
        ...

    @property
    def divergence_rad(self) -> float:
        """Full angle of a beam; 0: as fine as a ray."""
        ...

    @property
    def max_returns(self) -> int:
        """How many returns of a pulse are recorded."""
        ...

    def pulses(self, number: IntArray) -> Pulses:
        """Return the pulses of these numbers, counted from the start of a pass."""
        ...

    def n_sweeps(self, n_pulses: int) -> int:
        """Return how many scan lines that many pulses begin."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Scanner:
    """A profile scanner: position in the vehicle frame; its axis is x turned by yaw, then lowered by pitch.

    `rays_per_turn` is no whole number: pulses are not locked to the mirror, so that successive turns do not
    look in the same directions (a wire along the road would be met by every turn or by none).
    """

    position_m: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    turns_per_s: float
    rays_per_turn: float
    range_bias_m: tuple[float, ...] = (0.0,)
    gain: tuple[float, ...] = (1.0,)
    body: str = "van"
    n_beams: int = 1
    divergence_rad: float = 0.0
    max_returns: int = 1

    @property
    def pulses_per_s(self) -> float:
        """Pulses [1/s]."""
        return self.turns_per_s * self.rays_per_turn

    def pulses(self, number: IntArray) -> Pulses:
        """Return the pulses of these numbers; the scan angle is 0 downwards and negative to the left."""
        n = _FINER * int(self.rays_per_turn)
        turn = (np.mod(number / self.rays_per_turn, 1.0) * n).astype(np.int64)
        never = np.zeros(len(number), dtype=np.bool_)
        return Pulses(
            direction=_profile(self.yaw_deg, self.pitch_deg, n)[turn],
            sweep=np.floor(number / self.rays_per_turn).astype(np.int64),
            beam=np.zeros(len(number), dtype=np.int64),
            angle_deg=(360.0 / n * turn - 180.0).astype(np.float32),
            is_edge=never,
            is_forward=never,
        )

    def n_sweeps(self, n_pulses: int) -> int:
        """Return how many turns of the mirror that many pulses begin."""
        return int(n_pulses / self.rays_per_turn) + 1


@lru_cache(maxsize=8)
def _profile(yaw_deg: float, pitch_deg: float, n: int) -> FloatArray:
    """Return (n, 3) directions evenly around one turn of the mirror, vehicle frame."""
    yaw, pitch = np.radians(yaw_deg), np.radians(pitch_deg)
    # The profile's plane: across the scanner's axis (x turned by yaw, lowered by pitch, so that the
    # beams that go down go backwards, clear of the van)
    side = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    up = np.array([np.cos(yaw) * np.sin(pitch), np.sin(yaw) * np.sin(pitch), np.cos(pitch)])
    turn = 2.0 * np.pi * np.arange(n) / n
    directions = np.asarray(np.cos(turn)[:, None] * up + np.sin(turn)[:, None] * side)
    directions.flags.writeable = False
    return directions


@dataclass(frozen=True, slots=True, kw_only=True)
class SpinningScanner:
    """A multi-beam lidar that spins about its vertical axis, on the roof of a car.

    Parameters
    ----------
    elevation_deg, azimuth_deg
        Of each beam, as it really looks: azimuths are offsets from where the housing points.
    range_bias_m, gain
        Of each beam: what its ranges are off by, and how bright it sees things.
    turns_per_s
        5 to 20.
    columns_per_turn
        Firings of all beams per turn; no whole number.
    tilt_deg
        How far the axis leans to the front.
    """

    position_m: tuple[float, float, float]
    elevation_deg: tuple[float, ...]
    azimuth_deg: tuple[float, ...]
    range_bias_m: tuple[float, ...]
    gain: tuple[float, ...]
    turns_per_s: float
    columns_per_turn: float
    tilt_deg: float = 0.0
    body: str = "car"
    divergence_rad: float = 0.0
    max_returns: int = 1

    @property
    def n_beams(self) -> int:
        """How many lasers it has."""
        return len(self.elevation_deg)

    @property
    def pulses_per_s(self) -> float:
        """Pulses of all lasers together [1/s]."""
        return self.turns_per_s * self.columns_per_turn * self.n_beams

    def pulses(self, number: IntArray) -> Pulses:
        """Return the pulses of these numbers: the beams of a column fire one after another, from the lowest.

        The scan angle is the azimuth, 0 to the front and negative to the left (it turns clockwise).
        """
        beam = number % self.n_beams
        turns = number / (self.n_beams * self.columns_per_turn)
        sweep = np.floor(turns).astype(np.int64)
        elevation = np.radians(np.asarray(self.elevation_deg))[beam]
        clockwise = 2.0 * np.pi * (turns - sweep) - np.radians(np.asarray(self.azimuth_deg))[beam]
        flat, tilt = np.cos(elevation), np.radians(self.tilt_deg)
        x, y, z = flat * np.cos(clockwise), -flat * np.sin(clockwise), np.sin(elevation)
        direction = np.stack(
            [np.cos(tilt) * x + np.sin(tilt) * z, y, np.cos(tilt) * z - np.sin(tilt) * x], axis=1
        )
        never = np.zeros(len(number), dtype=np.bool_)
        angle = np.mod(np.degrees(clockwise) + 180.0, 360.0) - 180.0
        return Pulses(direction, sweep * self.n_beams + beam, beam, angle.astype(np.float32), never, never)

    def n_sweeps(self, n_pulses: int) -> int:
        """Return how many revolutions of single beams that many pulses begin."""
        return (int(n_pulses / (self.n_beams * self.columns_per_turn)) + 1) * self.n_beams


@dataclass(frozen=True, slots=True, kw_only=True)
class SwathScanner:
    """A scanner that looks down from an aircraft: its mirror sweeps across the course, within `half_angle_deg`.

    Parameters
    ----------
    oscillates
        The mirror swings to and fro, slower at the ends; else it rotates, and every line runs from left to right.
    lines_per_s, pulses_per_line
        Scan lines; pulses are not locked to the mirror.
    """

    half_angle_deg: float
    oscillates: bool
    lines_per_s: float
    pulses_per_line: float
    divergence_rad: float
    max_returns: int = 5
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    range_bias_m: tuple[float, ...] = (0.0,)
    gain: tuple[float, ...] = (1.0,)
    body: str = ""
    n_beams: int = 1

    @property
    def pulses_per_s(self) -> float:
        """Pulses [1/s]."""
        return self.lines_per_s * self.pulses_per_line

    def pulses(self, number: IntArray) -> Pulses:
        """Return the pulses of these numbers; the scan angle is 0 downwards and negative to the left."""
        line = np.floor(number / self.pulses_per_line).astype(np.int64)
        share = number / self.pulses_per_line - line
        swing = -np.cos(np.pi * share) if self.oscillates else 2.0 * share - 1.0
        forward = (line % 2 == 0) if self.oscillates else np.ones(len(number), dtype=np.bool_)
        angle = np.radians(self.half_angle_deg) * np.where(forward, swing, -swing)
        return Pulses(
            direction=np.stack([np.zeros(len(number)), -np.sin(angle), -np.cos(angle)], axis=1),
            sweep=line,
            beam=np.zeros(len(number), dtype=np.int64),
            angle_deg=np.degrees(angle).astype(np.float32),
            is_edge=np.floor((number + 1) / self.pulses_per_line).astype(np.int64) > line,
            is_forward=forward,
        )

    def n_sweeps(self, n_pulses: int) -> int:
        """Return how many scan lines that many pulses begin."""
        return int(n_pulses / self.pulses_per_line) + 1


@dataclass(frozen=True, slots=True, kw_only=True)
class StationScanner:
    """A scanner on a tripod: its mirror turns about a level axis, which turns by 180 degrees in `turns` of it."""

    turns: float
    rays_per_turn: float
    pulses_per_s: float
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    range_bias_m: tuple[float, ...] = (0.0,)
    gain: tuple[float, ...] = (1.0,)
    body: str = "tripod"
    n_beams: int = 1
    divergence_rad: float = 0.0
    max_returns: int = 1

    def pulses(self, number: IntArray) -> Pulses:
        """Return the pulses of these numbers; the scan angle is 0 downwards, in the turning plane of the mirror."""
        at = number / self.rays_per_turn
        turn = np.floor(at).astype(np.int64)
        fall, azimuth = 2.0 * np.pi * (at - turn), np.pi * at / self.turns
        flat = np.sin(fall)
        never = np.zeros(len(number), dtype=np.bool_)
        return Pulses(
            direction=np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), -np.cos(fall)], axis=1),
            sweep=turn,
            beam=np.zeros(len(number), dtype=np.int64),
            angle_deg=(np.mod(np.degrees(fall) + 180.0, 360.0) - 180.0).astype(np.float32),
            is_edge=never,
            is_forward=never,
        )

    def n_sweeps(self, n_pulses: int) -> int:
        """Return how many turns of the mirror that many pulses begin."""
        return int(n_pulses / self.rays_per_turn) + 1
