"""Recovery of scan lines: which points one beam drew in one turn or swing of its mirror, in any order of the points."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray, Int32Array, IntArray
from linework.errors import UsageError
from linework.kernels.scanlines.along import place_along_lines, spacing_to_next
from linework.kernels.scanlines.strings import next_strings, track_strings
from linework.kernels.scanlines.turns import order_by_line, turn_of_points
from linework.model.points import Points
from linework.model.tile import UNORDERED, ScannerTiming
from linework.scanlines.fields import fields_of
from linework.scanlines.pattern import spacing_pattern
from linework.scanlines.scan_lines import ScanLines
from linework.scanlines.timing import LEAP_M, PAUSE_PULSES, DeviceStream, device_streams, timing_of_streams


def recover_scan_lines(points: Points, timing: ScannerTiming | None = None) -> ScanLines:
    """Return the scan lines of points: line, position in it, direction and spacings of each.

    Parameters
    ----------
    points
        In any order; the order does not matter. Fields that are used are those of `scanner_timing`.
    timing
        Of the whole survey, where `points` is a part of it: lines are then the same as in the whole. None: found from
        the points.

    Notes
    -----
    A line is a turn or swing of the mirror, of one laser and head. When turns begin follows from scan angle and flags,
    where they are written, and else from how long the spot takes to return to a place. Where several heads write one
    stream without telling which, a line is what the spot drew without a break: each point joins the nearest open
    string. Where the points have no times, direction and spacing are those of the pattern of the points.

    With the timing of the whole, lines and beams of a part are exactly those of the whole, but for streams of several
    heads: there what lies within 5 m of a point decides. It decides about directions and spacings too (in the air, 24
    spacings; of a pattern, three blocks), but where a line is parted by something that the part lacks, far behind it.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.tile(np.linspace(0.0, 5.0, 50), 20)
    >>> y = np.repeat(np.arange(20) * 0.1, 50)
    >>> time = np.repeat(np.arange(20) * 0.02, 50) + np.tile(np.arange(50) * 1e-4, 20)
    >>> lines = recover_scan_lines(Points(np.stack([x, y, 0.0 * x], axis=1), time_s=time))
    >>> lines.n_lines, lines.direction[7].tolist()
    (20, [1.0, 0.0])
    """
    n = len(points)
    fields = fields_of(points, None if timing is None else timing.used)
    streams, labels = device_streams(points, fields) if fields.orders and n else ([], [])
    if timing is None:
        timing = timing_of_streams(points, fields, streams, labels)
    if timing.kind == UNORDERED or not streams:
        return _without_lines(points, timing)
    line = np.full(n, -1, dtype=np.int32)
    known = {(int(s), int(h)): i for i, (s, h) in enumerate(zip(timing.source, timing.head, strict=True))}
    numbers: list[IntArray] = []
    is_merged: list[bool] = []
    turns: list[float] = []
    n_lines, n_beams = 0, len(timing.ring_m)
    for stream, label in zip(streams, labels, strict=True):
        if label not in known:
            raise UsageError(
                "points are of a source or head that the timing does not have",
                where="points",
                advice="make the timing from all points of the survey",
            )
        turns.append(float(timing.turn_s[known[label]]))
        is_merged.append(bool(timing.is_merged[known[label]]))
        number = _numbers(stream, timing, known[label])
        if n_beams:
            assert fields.beam is not None
            number = number * n_beams + fields.beam[stream.points]
        compact, existing = _compact(number)
        line[stream.points] = compact + n_lines
        numbers.append(existing)
        n_lines += len(existing)
    by_device = np.concatenate([stream.points for stream in streams])
    order, start = order_by_line(line, by_device, n_lines)
    rank, position, direction, along = place_along_lines(
        order, start, points.xyz, timing.leap_m, timing.half_chord_m
    )
    following = _following(numbers, is_merged, timing.ring_m)
    delay = np.zeros(following.shape)
    delay[:, 0] = np.repeat(turns, [len(n) for n in numbers])
    assert fields.time_s is not None
    if timing.is_merged.any():
        strings = next_strings(by_device, fields.time_s, points.xyz, line, direction, n_lines)
        following = np.concatenate([following, strings[:, None]], axis=1)
        delay = np.concatenate([delay, np.full((n_lines, 1), np.nan)], axis=1)
    across = spacing_to_next(order, start, points.xyz, fields.time_s, direction, following, delay)
    first = order[start[:-1]]
    beam = np.full(n, -1, dtype=np.int32) if fields.beam is None else fields.beam
    return ScanLines(
        kind=timing.kind, how=timing.how, line=line, rank=rank, position_m=position, direction=direction,
        spacing_along_m=along, spacing_across_m=across, beam=beam, order=order, start=start, line_time_s=fields.time_s[first],
        line_source=_at(fields.source, first), line_head=_at(fields.head, first), line_beam=beam[first],
    )  # fmt: skip


def _without_lines(points: Points, timing: ScannerTiming) -> ScanLines:
    n = len(points)
    direction, along, across = spacing_pattern(points.xyz, timing.spacing_m)
    none, no_line = np.full(n, -1, dtype=np.int32), np.zeros(0, dtype=np.int32)
    return ScanLines(
        kind=timing.kind, how=timing.how, line=none, rank=none, position_m=np.full(n, np.nan, dtype=np.float32),
        direction=direction, spacing_along_m=along, spacing_across_m=across, beam=none, order=np.zeros(0, np.int64),
        start=np.zeros(1, np.int64), line_time_s=np.zeros(0), line_source=no_line, line_head=no_line, line_beam=no_line,
    )  # fmt: skip


def _numbers(stream: DeviceStream, timing: ScannerTiming, device: int) -> IntArray:
    """Return the number of each point's turn or string, (n,) int64."""
    if timing.is_merged[device]:
        pulse = float(timing.pulse_s[device])
        return track_strings(stream.time_s, stream.xyz, pulse, LEAP_M, PAUSE_PULSES).astype(np.int64)
    return turn_of_points(stream.time_s, timing.cuts(device)).astype(np.int64)


def _compact(number: IntArray) -> tuple[Int32Array, IntArray]:
    """Return numbers as those of the ones that some point has, and these, ascending."""
    low = int(number.min())
    has = np.bincount(number - low) > 0
    return (np.cumsum(has) - 1)[number - low].astype(np.int32), np.flatnonzero(has) + low


def _at(values: Int32Array | None, index: IntArray) -> Int32Array:
    return np.full(len(index), -1, dtype=np.int32) if values is None else values[index]


def _following(numbers: list[IntArray], is_merged: list[bool], ring_m: FloatArray) -> IntArray:
    """Return the lines that may be next to each line, (m, k) int64, -1 for none: of the next turn, of the next lasers.

    Numbers of lasers are in the order of their elevations, or in that of the housing: then it is the order of the sizes
    of their rings that tells neighbours. Strings of several heads have no such order.
    """
    device = np.repeat(np.arange(len(numbers)), [len(n) for n in numbers])
    number, n_beams = np.concatenate(numbers), len(ring_m)
    turn, laser = (number // n_beams, number % n_beams) if n_beams else (number, np.zeros_like(number))
    found = [_next_in(device, laser, turn, most=2)]
    found[0][np.array(is_merged)[device]] = -1
    if n_beams:
        by_size = np.argsort(np.argsort(ring_m, kind="stable"), kind="stable")
        by_number, by_ring = (
            _next_in(device, turn, laser, most=2),
            _next_in(device, turn, by_size[laser], most=2),
        )
        # No line twice: each costs a search
        by_ring[by_ring == by_number] = -1
        found += [by_number, by_ring]
    return np.stack(found, axis=1)


def _next_in(device: IntArray, group: IntArray, number: IntArray, *, most: int) -> IntArray:
    """Return the line of the same device and group with the next number, up to `most` further; -1: none."""
    order = np.lexsort((number, group, device))
    a, b = order[:-1], order[1:]
    is_next = (device[a] == device[b]) & (group[a] == group[b]) & (number[b] - number[a] <= most)
    found = np.full(len(order), -1, dtype=np.int64)
    found[a[is_next]] = b[is_next]
    return found
