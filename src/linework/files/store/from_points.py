"""Write points that are in memory into a tile store, as `build` writes those of laser files.

Arrays take the same path as files: what is found in them depends neither on their order nor on the machine's memory.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, Float32Array
from linework.crs import parse_crs, unit_factors
from linework.errors import CrsError, UsageError, argument
from linework.files.las.batches import EARLIEST_S, LATEST_S
from linework.files.las.repeats import PointSample, repeated_inside, sample_bits, sampled
from linework.files.las.tally import TimeCounts, TimeKind, time_kind_of
from linework.files.store.build import check_free_space
from linework.files.store.extent import refuse_degrees, stray_limits
from linework.files.store.facts import FileFacts, StoreFacts, facts_document, facts_of_store
from linework.files.store.layout import POINTS_SUFFIX, STORE_STEPS_PER_M
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index
from linework.model.grid import Bounds
from linework.model.points import Points, refuse_unusable

#: Points written at a time: larger batches make longer runs of points in any order, and take 34 bytes a point.
_BATCH = 1 << 20
#: Largest intensity of the store, which has 16 bits for it as LAS files do.
_MOST = 65_535


def store_points(
    points: Points,
    folder: Path,
    *,
    name: str = "points",
    progress: Callable[[int, int], None] | None = None,
    batch_points: int = _BATCH,
) -> StoreFacts:
    """Write points into a tile store, and return the facts about them.

    Parameters
    ----------
    points
        In a metric CRS, in any order.
    folder
        An existing, empty folder; the caller removes it if this fails.
    name
        Name of the points, for messages and for the sources of lines.
    progress
        Called with the number of points written so far, and their number.
    batch_points
        Points written at a time; what is read from the store does not depend on it.

    Raises
    ------
    UsageError
        No points; a coordinate, time or intensity that is not finite; times that are not seconds.
    CrsError
        The CRS is not known, or its lengths are not in metres; or the coordinates are degrees.
    MachineError
        Not enough space, or the disk failed.

    Notes
    -----
    Coordinates are rounded to the store's lattice of 0.1 mm. Intensities that are whole numbers from 0 to 65,535 are
    kept. All others are scaled linearly so that 0 stays 0 (or the lowest becomes 0 where some are negative) and the
    highest becomes 65,535; a warning names the range. Further columns are kept as they are.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     facts = store_points(Points([[3.0, 4.0, 5.0], [1.0, 2.0, 3.0]], intensity=[0.5, 1.0]), Path(folder))
    >>> facts.n_points, facts.warnings
    (2, ('points: intensities from 0.5 to 1 are not whole numbers from 0 to 65,535: 0 to 1 became 0 to 65,535',))
    """
    n = len(points)
    if n == 0:
        raise UsageError("no points", where=name, advice="give at least one")
    refuse_unusable(points)
    crs = _metric_crs(points.crs)
    light, warnings = _intensity_range(points.intensity)
    time_kind, more = _time_kind(points)
    warnings += more
    has_time, names = time_kind != "none", sorted(points.columns)
    check_free_space(folder, n, len(names))
    writer, bits, times = StoreWriter(folder / f"0{POINTS_SUFFIX}"), sample_bits(n), TimeCounts()
    repeats, samples = PointSample(bits), []
    try:
        for start in range(0, n, batch_points):
            part = slice(start, start + batch_points)
            xyz = points.xyz[part]
            intensity = _in_16_bits(points.intensity, part, light, len(xyz))
            time = points.time_s[part] if points.time_s is not None and has_time else None
            columns = (
                np.stack([points.columns[name][part] for name in names])
                if names
                else np.empty((0, 0), np.float32)
            )
            writer.append(xyz, intensity, time, columns)
            repeats.add(xyz, intensity, time)
            samples.append(xyz[sampled(xyz, bits)])
            if time is not None:
                times.add(time)
            if progress is not None:
                progress(start + len(xyz), n)
        refuse_degrees(samples, n, where=name)
        runs = writer.close()
    except BaseException:
        writer.abort()
        raise
    warnings += repeated_inside(repeats.numbers(), has_time=has_time)
    facts = FileFacts(
        Path(name), n, n, {}, _on_lattice(points.bounds), time_kind, -1, "", warnings, tuple(names)
    )
    is_light = points.intensity is not None and light != (0.0, 0.0)
    document = facts_document(
        (facts,), (), tuple(f"{name}: {text}" for text in warnings), times,
        gps_time_kind=time_kind, has_intensity=is_light, has_time=has_time, crs=crs, columns=names,
        in_time_order=has_time and points.time_s is not None and bool(np.all(np.diff(points.time_s) >= 0.0)),
    )  # fmt: skip
    write_index(folder, runs, document, stray_limits(runs, [writer.height_counts]))
    return facts_of_store(PointStore.open(folder))


def _metric_crs(crs: str) -> str:
    """Return the WKT2 of a CRS, or "local"."""
    wkt = parse_crs(crs, where=argument("crs"))
    factors = unit_factors(wkt)
    if factors != (1.0, 1.0):
        plan, height = factors
        raise CrsError(
            f"lengths in units of {plan:.9g} m, heights in units of {height:.9g} m: points need metres", where=argument("crs"),
            advice="multiply the coordinates by these, and give the CRS in metres",
        )  # fmt: skip
    return wkt


#: Lowest and highest intensity, which become 0 and 65,535; (0, 0): all are 0; (0, 65535): they are kept.
_Range = tuple[float, float]


def _intensity_range(intensity: Float32Array | None) -> tuple[_Range, tuple[str, ...]]:
    """Return the range of intensities to be scaled to 16 bits, and a warning about them."""
    if intensity is None or not intensity.any():
        return (0.0, 0.0), () if intensity is None else ("no intensity (0 for all points)",)
    low, high = float(intensity.min()), float(intensity.max())
    if low >= 0.0 and high <= _MOST and bool(np.all(intensity == np.rint(intensity))):
        return (0.0, float(_MOST)), ()
    to_low, to_high = min(low, 0.0), max(high, 0.0)
    text = (
        f"intensities from {low:g} to {high:g} are not whole numbers from 0 to {_MOST:,}: {to_low:g} to {to_high:g} became"
        f" 0 to {_MOST:,}"
    )
    return (to_low, to_high), (text,)


def _in_16_bits(intensity: Float32Array | None, part: slice, light: _Range, n: int) -> AnyArray:
    """Return some of the intensities as (n,) uint16."""
    low, high = light
    if intensity is None or high == low:
        return np.zeros(n, np.uint16)
    if light == (0.0, float(_MOST)):
        return np.rint(intensity[part]).astype(np.uint16)
    return np.rint((intensity[part].astype(np.float64) - low) * (_MOST / (high - low))).astype(np.uint16)


def _time_kind(points: Points) -> tuple[TimeKind, tuple[str, ...]]:
    """Return the kind of the times, and a warning about times that are not used."""
    if points.time_s is None:
        return "none", ()
    low, high = float(points.time_s.min()), float(points.time_s.max())
    if low == high == 0.0:
        return "none", ("no times (0 for all points)",)
    if low < EARLIEST_S or high > LATEST_S:
        raise UsageError(
            f"times from {low:g} to {high:g} are not seconds of any clock ({EARLIEST_S:g} to {LATEST_S:g})",
            where="time_s",
            advice="give seconds, or leave time_s out",
        )
    return time_kind_of(low, high), ()


def _on_lattice(bounds: Bounds) -> Bounds:
    """Return the extent of points as the store holds them."""
    return Bounds(*(round(edge * STORE_STEPS_PER_M) / STORE_STEPS_PER_M for edge in bounds))
