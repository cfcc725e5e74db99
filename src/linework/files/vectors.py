"""Read and write lines: the format follows the file's suffix."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from linework.errors import UsageError
from linework.files.crs import LOCAL, parse_crs
from linework.files.gdal_limits import checked_vector_file
from linework.files.line_fields import check_writable
from linework.files.publish import check_output, publish
from linework.files.vectors_dxf import read_dxf, verify_dxf, write_dxf, write_prj
from linework.files.vectors_flatgeobuf import verify_flatgeobuf, write_flatgeobuf
from linework.files.vectors_foreign import read_foreign
from linework.files.vectors_geojson import read_geojson, verify_geojson, write_geojson
from linework.files.vectors_gpkg import read_own_gpkg, verify_gpkg, write_gpkg
from linework.files.vectors_kml import verify_kml, write_kml
from linework.model.lines import LineSet

_Write = Callable[[LineSet, Path, Sequence[str]], None]
_Verify = Callable[[Path, LineSet, Path], None]
_Read = Callable[[Path, str, "Mapping[str, str] | None", "str | None"], LineSet]
#: How each format is written to a part file, and how that file is verified.
_WRITERS: dict[str, tuple[_Write, _Verify]] = {
    ".gpkg": (write_gpkg, verify_gpkg),
    ".geojson": (write_geojson, verify_geojson),
    ".json": (write_geojson, verify_geojson),
    ".dxf": (write_dxf, verify_dxf),
    ".kml": (write_kml, verify_kml),
    ".fgb": (write_flatgeobuf, verify_flatgeobuf),
}


def write_lines(lines: LineSet, path: Path, *, kinds: Sequence[str] = (), overwrite: bool = False) -> None:
    """Write lines; the suffix says the format.

    Parameters
    ----------
    kinds
        Kinds that get a layer even where no line is of that kind (formats with layers).

    Raises
    ------
    UsageError
        Unknown suffix, a coordinate that is not finite, a line of fewer than two vertices.
    OutputExistsError, MachineError
        As for `publish`.

    Notes
    -----
    Equal lines give equal bytes.
    """
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        raise UsageError(f"cannot write '{suffix}' files", where=path, advice=f"use {', '.join(_WRITERS)}")
    check_writable(lines, path)
    write, verify = _WRITERS[suffix]
    check_output(path, overwrite=overwrite)
    if suffix == ".dxf" and lines.crs != LOCAL:
        write_prj(lines.crs, path.with_suffix(".prj"), overwrite=overwrite)
    publish(
        path,
        lambda part: write(lines, part, kinds),
        lambda part: verify(part, lines, path),
        overwrite=overwrite,
    )


def read_lines(
    path: Path, *, kind_field: str = "kind", kinds: Mapping[str, str] | None = None, crs: str | None = None
) -> LineSet:
    """Read lines that we or others made.

    Parameters
    ----------
    kind_field
        The property that says what a feature is; without it the layer's name does.
    kinds
        Names in the file and the kinds they are here; features of other names are left out.
    crs
        What the CRS is where the file does not say: "EPSG:...", WKT or "local" (the default).

    Returns
    -------
    LineSet
        Our own files come back exactly. In others, multi-part geometries become one line per part, polygons
        one closed line per ring, and heights that are missing are NaN (such sets cannot be written).

    Raises
    ------
    InputError
        Not a readable file of lines.
    CrsError
        In degrees, or several CRSs.
    """
    suffix = path.suffix.lower()
    if suffix not in _READERS:
        raise UsageError(
            f"cannot read lines from '{suffix}' files", where=path, advice=f"use {', '.join(_READERS)}"
        )
    given = None if crs is None else parse_crs(crs, where="--crs")
    return _READERS[suffix](path, kind_field, kinds, given)


def _read_gpkg(path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None) -> LineSet:
    """Read a GeoPackage: our own exactly, others as they are."""
    checked = checked_vector_file(path)
    own = read_own_gpkg(checked) if kinds is None and kind_field == "kind" else None
    return own if own is not None else read_foreign(checked, kind_field, kinds, crs)


def _read_with_gdal(path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None) -> LineSet:
    return read_foreign(checked_vector_file(path), kind_field, kinds, crs)


_READERS: dict[str, _Read] = {
    ".gpkg": _read_gpkg,
    ".geojson": read_geojson,
    ".json": read_geojson,
    ".dxf": read_dxf,
    ".fgb": _read_with_gdal,
    ".shp": _read_with_gdal,
}
