"""Write laser points as LAS/LAZ 1.4, point format 6."""

from __future__ import annotations

from pathlib import Path

import laspy
import lazrs
import numpy as np
from laspy.header import GpsTimeType
from laspy.vlrs.known import WktCoordinateSystemVlr

from linework.crs import LOCAL, parse_crs
from linework.errors import MachineError, UsageError
from linework.files.las.header import read_las_header
from linework.files.output.publish import publish
from linework.model.points import Points

#: Step of the stored coordinates [m]: below a tenth of the finest scanner's range noise.
_SCALE_M = 0.001
#: Further columns that are fields of the format, by their largest value; scan angles, in degrees, have a step.
_FIELDS = {
    "classification": 255, "return_number": 15, "number_of_returns": 15, "user_data": 255, "point_source_id": 65_535,
    "scanner_channel": 3, "scan_direction_flag": 1, "edge_of_flight_line": 1,
}  # fmt: skip
_SCAN_ANGLE, _SCAN_ANGLE_DEG = "scan_angle", 0.006
#: Points compressed at a time, which bounds memory to twice the points.
_BATCH = 1_000_000


def write_las(
    points: Points, path: Path, *, crs: str, overwrite: bool = False, intensity_bits: int = 16
) -> None:
    """Write points as LAS 1.4, point format 6; compressed where the name ends in .laz.

    Parameters
    ----------
    crs
        "EPSG:...", WKT, or "local" (no CRS is written then).
    intensity_bits
        8 or 16: the largest intensity stored is 2**bits - 1; larger ones become that.

    Further columns named as fields of the format (classification, return_number, number_of_returns, user_data,
    point_source_id, scan_angle [deg], scanner_channel, scan_direction_flag, edge_of_flight_line) become these; others
    become extra dimensions, 32-bit floating-point numbers.

    Raises
    ------
    UsageError
        Neither .las nor .laz, coordinates that are not finite or too far apart for steps of 1 mm, or a column whose
        values its field cannot hold.
    OutputExistsError, MachineError
        As for `publish`.

    Notes
    -----
    Coordinates are rounded to 1 mm, scan angles to 0.006 degrees. Without return numbers, each point is the only
    return of its pulse. Times are marked as adjusted standard GPS time. Nothing of the day or
    the machine is written: equal points give equal files.
    """
    if path.suffix.lower() not in (".las", ".laz"):
        raise UsageError(f"suffix '{path.suffix}', expected .las or .laz", where=path)
    _check_fields(points, path)
    wkt = parse_crs(crs)
    header = _header(points, wkt, path)

    def write(part: Path) -> None:
        try:
            with laspy.open(
                part, mode="w", header=header, laz_backend=laspy.LazBackend.LazrsParallel
            ) as writer:
                for start in range(0, len(points), _BATCH):
                    record = _record(points.take(slice(start, start + _BATCH)), header, intensity_bits)
                    writer.write_points(record)
        except lazrs.LazrsError as error:  # the compressor hides the system's message
            raise MachineError(
                f"cannot be written: {error}", where=path, advice="check for free space"
            ) from error

    def verify(part: Path) -> None:
        _verify(part, points, path)

    publish(path, write, verify, overwrite=overwrite)


def _header(points: Points, wkt: str, path: Path) -> laspy.LasHeader:
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.creation_date = None
    header.generating_software = "linework"
    header.scales = np.full(3, _SCALE_M)
    if len(points):
        low, high = points.xyz.min(axis=0), points.xyz.max(axis=0)
        if not (np.isfinite(low).all() and np.isfinite(high).all()):
            raise UsageError("coordinates are not all finite", where=path)
        header.offsets = np.floor((low + high) / 2.0)
        reach_m = float(np.abs(np.stack([low, high]) - header.offsets).max())
        if reach_m / _SCALE_M > 2**31 - 2:
            raise UsageError(f"points reach {reach_m:.3g} m from their middle, at most 2.1e6", where=path)
    header.add_extra_dims([laspy.ExtraBytesParams(n, "f4") for n in points.columns if not _is_field(n)])
    header.global_encoding.gps_time_type = GpsTimeType.STANDARD
    if wkt != LOCAL:
        header.vlrs.append(WktCoordinateSystemVlr(wkt))
        header.global_encoding.wkt = True
    return header


def _record(points: Points, header: laspy.LasHeader, intensity_bits: int) -> laspy.ScaleAwarePointRecord:
    record = laspy.ScaleAwarePointRecord.zeros(len(points), header=header)
    for axis, name in enumerate("XYZ"):
        record[name] = np.rint((points.xyz[:, axis] - header.offsets[axis]) / _SCALE_M).astype(np.int32)
    if points.intensity is not None:
        top = float(2**intensity_bits - 1)
        record["intensity"] = np.clip(np.rint(points.intensity), 0.0, top).astype(np.uint16)
    if points.time_s is not None:
        record["gps_time"] = points.time_s
    one = np.ones(len(points), dtype=np.float32)
    for name, values in ({"return_number": one, "number_of_returns": one} | dict(points.columns)).items():
        if name == _SCAN_ANGLE:
            record[name] = np.rint(values / _SCAN_ANGLE_DEG).astype(np.int16)
        else:
            record[name] = np.rint(values).astype(np.uint16) if name in _FIELDS else values
    return record


def _is_field(name: str) -> bool:
    return name in _FIELDS or name == _SCAN_ANGLE


def _check_fields(points: Points, path: Path) -> None:
    """Refuse values that a field of the format cannot hold."""
    limits = {name: (0.0, float(top)) for name, top in _FIELDS.items()} | {_SCAN_ANGLE: (-180.0, 180.0)}
    for name, values in points.columns.items():
        low, high = limits.get(name, (-np.inf, np.inf))
        # NaN is in no range
        if name in limits and len(values) and not (values.min() >= low and values.max() <= high):
            raise UsageError(
                f"column {name!r} has values from {values.min():g} to {values.max():g}, its field holds {low:g} to {high:g}",
                where=path,
                advice="give the column another name to write it as an extra dimension",
            )


def _verify(part: Path, points: Points, path: Path) -> None:
    """Read the file back with the other decoder and compare count, extent and sums."""
    if read_las_header(part).n_points != len(points):
        raise MachineError("written file has another number of points", where=path, advice="check the disk")
    if len(points) == 0:
        return
    low, high, n = np.full(3, np.inf), np.full(3, -np.inf), 0
    with laspy.open(part, laz_backend=laspy.LazBackend.Lazrs) as reader:
        for chunk in reader.chunk_iterator(_BATCH):
            xyz = np.stack([chunk.x, chunk.y, chunk.z], axis=1)
            low, high, n = np.minimum(low, xyz.min(axis=0)), np.maximum(high, xyz.max(axis=0)), n + len(xyz)
    expected = np.stack([points.xyz.min(axis=0), points.xyz.max(axis=0)])
    # Half a step of rounding, and some for the float64 of large coordinates.
    if n != len(points) or np.abs(np.stack([low, high]) - expected).max() > 0.51 * _SCALE_M:
        raise MachineError("written file does not read back the same", where=path, advice="check the disk")
