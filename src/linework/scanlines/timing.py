"""The scanner behind points: its kind, its pulses, and when its lines begin.

Separate from `linework.scanlines.recover`: this is done once for a survey, that for each of its tiles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray, Int32Array, IntArray, offsets_of
from linework.kernels.scanlines.strings import (
    share_interleaved,
    speed_of_spot,
    time_back_at_place,
    track_strings,
)
from linework.kernels.scanlines.strips import cuts_of_flags, cuts_of_strips, mean_motion
from linework.kernels.scanlines.turns import (
    cuts_of_angles,
    cuts_of_turns,
    in_order_of_ties,
    order_by_line,
    turn_of_points,
)
from linework.model.points import Points
from linework.model.tile import AIRBORNE, PROFILE, SPINNING, UNORDERED, ScannerTiming
from linework.scanlines.fields import ScanFields, fields_of
from linework.scanlines.pattern import mean_spacing_m

#: A spot that leaves its string by more than this is on another thing: a car or a pole stands out by less, walls and
#: ditches beside a road by about as much. [m]
LEAP_M = 1.5
#: A direction is measured over this distance to either side: range noise of 2 cm turns a chord of 1 m by 1.6 degrees. [m]
HALF_CHORD_M = 0.5
#: A pause of more pulses ends a string: the beam went through the sky, or behind something. [pulses]
PAUSE_PULSES = 60.0
#: How near the spot comes to a place again after one turn: a vehicle moves less in a turn, at 30 m/s and 10 Hz. [m]
_NEAR_M = 3.0
#: Mirrors of profile and spinning scanners take 2 ms to 0.5 s for a turn (500 to 2 Hz); stations are slower than none. [s]
_LONGEST_TURN_S = 1.0
#: Samples of the length of a turn, and how many agree at least: a chance return is as far off as the window is wide.
_SAMPLES, _LEAST_SAMPLES = 400, 8
#: More points than this in the pattern of two strings drawn at once: two heads in one stream. Several returns of a pulse
#: share its time, and are not counted.
_MERGED = 0.02
#: They are looked for in this number of pieces of this number of points: a few hundred turns.
_PIECES, _PIECE = 20, 10_000
#: The spot of a scanner in the air moves faster over the ground than this: 60 m high at 50 lines a second and more; on a
#: van it is at most 15 km/s near the road. [m/s]
_SPOT_IN_THE_AIR = 20_000.0
#: Scan angles of aircraft reach 30 degrees to a side, a few 60; mirrors on vehicles turn all round. [deg]
_WIDEST_IN_THE_AIR = 130.0
#: Falls of the scan angle of less are noise of the field: whole degrees in LAS 1.0 to 1.3. [deg]
_FALL_DEG = 1.5
#: Falls of the spot across the strip that begin a line without any pause: leaves and ground of one direction lie no
#: farther apart, 40 m of height at 30 degrees. [m]
_FALL_M = 25.0
#: A pause of more pulses between two lines: the mirror's way back. [pulses]
_WAY_BACK_PULSES = 20.0
#: A pause that ends a line whatever the flags are: scanners draw 10 lines a second and more. [s]
_LONGEST_PAUSE_S = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class DeviceStream:
    """Points of one head of one source, by time.

    Parameters
    ----------
    points
        (n,) int64: which points, ascending in time, ties by x, y, z.
    time_s, xyz
        (n,) float64 [s], and (n, 3) float64 [m].
    """

    points: IntArray
    time_s: FloatArray
    xyz: FloatArray


def scanner_timing(points: Points) -> ScannerTiming:
    """Return what scanner the points are of, and when its scan lines begin.

    It is found once for a survey; `recover_scan_lines` then gives a point the same line in every tile that has it.

    Parameters
    ----------
    points
        In any order. Used, where there: time, and the columns point_source_id, scanner_channel, ring (or laser_id, beam,
        user_data), scan_angle, scan_direction_flag, edge_of_flight_line.
    """
    fields = fields_of(points)
    streams = device_streams(points, fields) if fields.orders else ([], [])
    return timing_of_streams(points, fields, *streams)


def timing_of_streams(
    points: Points, fields: ScanFields, devices: list[DeviceStream], labels: list[tuple[int, int]]
) -> ScannerTiming:
    """Return the timing of points whose fields and streams are known, see `scanner_timing`."""
    if not fields.orders or fields.time_s is None:
        why = "no times" if fields.time_s is None else "times of whole scans, not of pulses"
        found_out = (f"{why}: direction and spacings are those of the pattern of the points",)
        return ScannerTiming(
            kind=UNORDERED, how=found_out, source=np.zeros(0, np.int32), head=np.zeros(0, np.int32), pulse_s=np.zeros(0),
            turn_s=np.zeros(0), is_merged=np.zeros(0, np.bool_), cut_start=offsets_of([]), cut_s=np.zeros(0), leap_m=LEAP_M, half_chord_m=HALF_CHORD_M,
            ring_m=np.zeros(0), spacing_m=mean_spacing_m(points.xyz), used=(),
        )  # fmt: skip
    if fields.beam is not None:
        return _spinning(fields, devices, labels)
    kind, how = _kind(fields, devices)
    pulses, merged, to_and_fro, cuts = [], [], [], []
    for stream in devices:
        pulse = _pulse_s(stream.time_s)
        pulses.append(pulse)
        if kind == AIRBORNE:
            found, said, swings = _strip_cuts(fields, stream, pulse)
            merged.append(False)
            to_and_fro.append(swings)
        else:
            found, said, is_merged = _profile_cuts(fields, stream, pulse)
            merged.append(is_merged)
            to_and_fro.append(False)
        cuts.append(found)
        if said not in how:
            how = (*how, said)
    return replace(
        _timing(kind, how, fields, labels, pulses, merged, cuts, devices),
        turn_s=np.array(
            [np.nan if swings else _turn_s(c) for swings, c in zip(to_and_fro, cuts, strict=True)]
        ),
    )


def device_streams(points: Points, fields: ScanFields) -> tuple[list[DeviceStream], list[tuple[int, int]]]:
    """Return the streams of points of each source and head, and (source, head) of each, -1 where not known."""
    assert fields.time_s is not None
    order = _by_time(fields.time_s, points.xyz)
    columns = [fields.source, fields.head]
    lows = [-1 if values is None else int(values.min()) for values in columns]
    heads = 1 if fields.head is None else int(fields.head.max()) - lows[1] + 1
    key = np.zeros(len(points), dtype=np.int32)
    if fields.source is not None:
        key += (fields.source - lows[0]) * heads
    if fields.head is not None:
        key += fields.head - lows[1]
    n_keys = int(key.max()) + 1
    start = np.array([0, len(points)])
    if n_keys > 1:
        order, start = order_by_line(key, order, n_keys)
    # Files are mostly in order, and then nothing is copied
    is_whole = bool(np.all(order[1:] > order[:-1]))
    time, xyz = (fields.time_s, points.xyz) if is_whole else (fields.time_s[order], points.xyz[order])
    streams, labels = [], []
    for k in np.flatnonzero(np.diff(start)):
        own = slice(int(start[k]), int(start[k + 1]))
        streams.append(DeviceStream(order[own], time[own], xyz[own]))
        labels.append((lows[0] + int(k) // heads, lows[1] + int(k) % heads))
    return streams, labels


def _by_time(time_s: FloatArray, xyz: FloatArray) -> IntArray:
    # Files are mostly in order already; then sorting costs nothing
    order = np.arange(len(time_s)) if np.all(time_s[1:] >= time_s[:-1]) else np.argsort(time_s)
    order = order.astype(np.int64)
    if not in_order_of_ties(order, time_s, xyz):
        return np.lexsort((xyz[:, 2], xyz[:, 1], xyz[:, 0], time_s)).astype(np.int64)
    return order


def _pulse_s(time_s: FloatArray) -> float:
    """Return the time between two pulses: the median between successive times, the first million of them."""
    step = np.diff(time_s[:1_000_000])
    step = step[step > 1e-9]
    return float(np.median(step)) if len(step) else 1.0


def _kind(fields: ScanFields, devices: list[DeviceStream]) -> tuple[str, tuple[str, ...]]:
    """Return profile or airborne, and how it was decided."""
    widest = None if fields.angle_deg is None else float(np.ptp(fields.angle_deg))
    if widest is not None and widest > _WIDEST_IN_THE_AIR:
        return PROFILE, (f"scan angles over {widest:.0f} degrees: mirrors that turn all round",)
    largest = max(devices, key=lambda stream: len(stream.points))
    sample = np.unique(np.linspace(0, len(largest.time_s) - 1, 20_000).astype(np.int64))
    speeds = speed_of_spot(largest.time_s, largest.xyz, sample, _pulse_s(largest.time_s))
    speed = float(np.nanmedian(speeds)) if np.isfinite(speeds).any() else 0.0
    where = AIRBORNE if speed > _SPOT_IN_THE_AIR else PROFILE
    return where, (
        f"the spot moves at {speed / 1000.0:.1f} km/s: {'in the air' if where == AIRBORNE else 'near the ground'}",
    )


def _profile_cuts(fields: ScanFields, stream: DeviceStream, pulse_s: float) -> tuple[FloatArray, str, bool]:
    """Return when the turns of one head begin, how that was found, and whether there are several heads in the stream."""
    if _share_interleaved(stream, pulse_s) > _MERGED:
        return np.zeros(0), "several heads in one stream: lines by tracking the spots", True
    known, turn = _turns(stream, pulse_s)
    if fields.angle_deg is not None and np.ptp(fields.angle_deg) > _WIDEST_IN_THE_AIR:
        angle = fields.angle_deg[stream.points]
        # The sense of rotation: falls are the rarer of the two
        if np.median(np.sign(np.diff(angle))) < 0.0:
            angle = -angle
        longest = float(np.median(turn)) if len(turn) else _LONGEST_TURN_S
        return (
            cuts_of_angles(stream.time_s, angle, _FALL_DEG, longest),
            "lines by falls of the scan angle",
            False,
        )
    if not len(known):
        return np.zeros(0), "no regular turns of the mirror: lines by tracking the spot", True
    rate = 1.0 / float(np.median(turn))
    return (
        cuts_of_turns(stream.time_s, known, turn),
        f"the spot is back at a place {rate:.1f} times a second",
        False,
    )


def _share_interleaved(stream: DeviceStream, pulse_s: float) -> float:
    """Return the share of points that are of two strings drawn at once, over some pieces of the stream."""
    n = len(stream.time_s)
    starts = np.unique(np.linspace(0, max(n - _PIECE, 0), _PIECES).astype(np.int64))
    shares = [
        share_interleaved(
            track_strings(
                stream.time_s[a : a + _PIECE], stream.xyz[a : a + _PIECE], pulse_s, LEAP_M, PAUSE_PULSES
            )
        )
        for a in starts
    ]
    return float(np.mean(shares))


def _turns(stream: DeviceStream, pulse_s: float) -> tuple[FloatArray, FloatArray]:
    """Return times and how long a turn takes then, (k,) each; empty where the spot does not come back regularly."""
    n = len(stream.time_s)
    sample = np.unique(np.linspace(0, n - 1, _SAMPLES).astype(np.int64))
    back = time_back_at_place(stream.time_s, stream.xyz, sample, pulse_s, _NEAR_M, _LONGEST_TURN_S)
    good = np.isfinite(back)
    if np.count_nonzero(good) < _LEAST_SAMPLES:
        return np.zeros(0), np.zeros(0)
    turn = _mode(back[good])
    # A place along the vehicle's own path drifts by a few pulses; a mirror holds its speed to some percent
    good &= np.abs(back - turn) < 0.05 * turn
    if np.count_nonzero(good) < max(_LEAST_SAMPLES, 0.25 * np.count_nonzero(np.isfinite(back))):
        return np.zeros(0), np.zeros(0)
    known, turns = stream.time_s[sample[good]], back[good]
    smooth = np.array([np.median(turns[max(i - 10, 0) : i + 11]) for i in range(len(turns))])
    return known, smooth


def _mode(values: FloatArray) -> float:
    """Return the middle of the shortest interval with a third of the values."""
    ordered = np.sort(values)
    k = max(len(ordered) // 3, 1)
    width = ordered[k:] / np.maximum(ordered[:-k], 1e-12)
    at = int(np.argmin(width))
    return float(np.median(ordered[at : at + k + 1]))


def _strip_cuts(fields: ScanFields, stream: DeviceStream, pulse_s: float) -> tuple[FloatArray, str, bool]:
    """Return when the lines of a flight strip begin, how that was found, and whether the spot moves to and fro."""
    n = len(stream.points)
    flag = np.zeros(n, dtype=np.int32) if fields.flag is None else fields.flag[stream.points]
    edge = np.zeros(n, dtype=np.bool_) if fields.is_edge is None else fields.is_edge[stream.points]
    if flag.min() != flag.max():
        cuts = cuts_of_flags(stream.time_s, flag, edge, _LONGEST_PAUSE_S)
        return cuts, "lines by the flag of the scan direction", True
    x, y, double_x, double_y = mean_motion(stream.time_s, stream.xyz, 3.0 * pulse_s)
    to_and_fro = bool(np.hypot(x, y) < 0.5 * np.hypot(double_x, double_y))
    heading = 0.5 * np.arctan2(double_y, double_x) if to_and_fro else np.arctan2(y, x)
    direction = (float(np.cos(heading)), float(np.sin(heading)))
    cuts = cuts_of_strips(
        stream.time_s, stream.xyz, direction, to_and_fro, pulse_s, _WAY_BACK_PULSES, _FALL_M
    )
    how = (
        "lines by the turns of the spot"
        if to_and_fro
        else "lines by where the spot falls back across the strip"
    )
    if edge.any():
        cuts = np.union1d(cuts, cuts_of_flags(stream.time_s, flag, edge, np.inf))
        how += ", and by the flag of their ends"
    return cuts, how, to_and_fro


def _spinning(
    fields: ScanFields, devices: list[DeviceStream], labels: list[tuple[int, int]]
) -> ScannerTiming:
    """Return the timing of lidars that spin: the turns of each, from its laser with the most points."""
    assert fields.beam is not None
    pulses, cuts = [], []
    rate = ""
    for stream in devices:
        beam = fields.beam[stream.points]
        own = beam == np.bincount(beam - beam.min()).argmax() + beam.min()
        single = DeviceStream(stream.points[own], stream.time_s[own], stream.xyz[own])
        pulses.append(_pulse_s(single.time_s))
        known, turn = _turns(single, pulses[-1])
        if len(known):
            cuts.append(cuts_of_turns(stream.time_s, known, turn))
            rate = f"turns of the lidar {1.0 / float(np.median(turn)):.1f} times a second"
        else:
            cuts.append(stream.time_s[:1])
            rate = rate or "no place is met twice by one laser: one turn of the lidar"
    n = int(np.count_nonzero(np.bincount(fields.beam - fields.beam.min())))
    how = (f"{n} lasers by the field {fields.beam_field}", rate)
    rings = _rings(fields.beam, devices, cuts)
    return _timing(SPINNING, how, fields, labels, pulses, [False] * len(devices), cuts, devices, rings)


def _rings(beam: Int32Array, devices: list[DeviceStream], cuts: list[FloatArray]) -> FloatArray:
    """Return the mean distance of the points of each laser from the middle of its turns, (b,) [m]."""
    n_beams = int(beam.max()) + 1
    total, count = np.zeros(n_beams), np.zeros(n_beams)
    for stream, own_cuts in zip(devices, cuts, strict=True):
        turn = turn_of_points(stream.time_s, own_cuts)
        n = np.maximum(np.bincount(turn), 1)
        x, y = (stream.xyz[:, c] - (np.bincount(turn, stream.xyz[:, c]) / n)[turn] for c in (0, 1))
        total += np.bincount(beam[stream.points], np.hypot(x, y), n_beams)
        count += np.bincount(beam[stream.points], minlength=n_beams)
    return np.asarray(total / np.maximum(count, 1.0), dtype=np.float64)


def _turn_s(cuts: FloatArray) -> float:
    """Return the time between the beginnings of two lines; NaN where it is not one: the spot moves to and fro."""
    if len(cuts) < 3:
        return float("nan")
    step = np.diff(cuts)
    turn = float(np.median(step))
    # Strips that are wider than what the points cover are drawn there and back at two times
    return turn if np.mean(np.abs(step - turn) < 0.1 * turn) > 0.5 else float("nan")


def _timing(
    kind: str,
    how: tuple[str, ...],
    fields: ScanFields,
    labels: list[tuple[int, int]],
    pulses: list[float],
    merged: list[bool],
    cuts: list[FloatArray],
    devices: list[DeviceStream],
    ring_m: FloatArray | None = None,
) -> ScannerTiming:
    leap, half_chord = LEAP_M, HALF_CHORD_M
    if kind == AIRBORNE:
        # Eight times the usual distance between two pulses: a wet patch or a lost return is no end of a line
        steps = [np.linalg.norm(np.diff(d.xyz[:100_000], axis=0), axis=1) for d in devices]
        # Leaves and ground of neighbouring pulses are shifted along the line: directions reach as far
        leap = half_chord = max(LEAP_M, 8.0 * float(np.median(np.concatenate(steps))))
    merged_flags: BoolArray = np.array(merged, dtype=np.bool_)
    return ScannerTiming(
        kind=kind,
        how=how,
        source=np.array([source for source, _ in labels], dtype=np.int32),
        head=np.array([head for _, head in labels], dtype=np.int32),
        pulse_s=np.array(pulses, dtype=np.float64),
        turn_s=np.array([_turn_s(c) for c in cuts], dtype=np.float64),
        is_merged=merged_flags,
        cut_start=offsets_of([len(c) for c in cuts]),
        cut_s=np.concatenate([np.zeros(0), *cuts]),
        leap_m=leap,
        half_chord_m=half_chord,
        ring_m=np.zeros(0) if ring_m is None else ring_m,
        spacing_m=float("nan"),
        used=fields.used,
    )
