"""Check vector files of other programs before GDAL opens them.

An OGR VRT named .gpx returns the content of another file, a WFS in a text file sends requests. The drivers that do
this are disabled in GDAL when pyogrio is imported here (unless a program has imported it before), and only files
pass whose first bytes are those of a format we read. GeoPackages are checked by `gpkg_guard`.

pyogrio looks for geopandas and pandas when it is imported: to learn their versions, it loads both, which takes longer
than all else of it. Here it is told the versions, and loads them when somebody reads a data frame.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from linework.errors import InputError, LineworkError
from linework.files.input import open_input, plainly_named
from linework.files.vectors.gpkg_guard import check_geopackage

#: Drivers that read other files or the network on behalf of the file they open.
FORBIDDEN_DRIVERS = (
    "VRT", "OGR_VRT", "GTI", "GDALG", "DERIVED", "HTTP", "WMS", "WMTS", "WCS", "WFS", "CSW", "OAPIF", "OGCAPI",
    "PLSCENES", "PLMOSAIC", "Elasticsearch", "Carto", "AmigoCloud", "EEDA", "EEDAI", "NGW", "DAAS", "STACIT",
    "STACTA", "ADBC", "GPSBabel",
)  # fmt: skip


class _OnlyVersion(ModuleType):
    """A package of which nothing but the version is known until something else of it is asked for."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.__version__ = metadata.version(name)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # of the import system, which asks what a module is
            raise AttributeError(name)
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(import_module(self.__name__), name)


@contextlib.contextmanager
def _only_versions(*names: str) -> Iterator[None]:
    """Have packages imported as their versions only; those that are loaded or missing stay so."""
    hidden = {}
    for name in names:
        with contextlib.suppress(ModuleNotFoundError):
            if name not in sys.modules and find_spec(name) is not None:
                hidden[name] = sys.modules[name] = _OnlyVersion(name)
    try:
        yield
    finally:
        for name, module in hidden.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]


# The variable is read when GDAL starts, and removed again: rasterio's GDAL lacks some of the drivers and warns.
_before = os.environ.get("OGR_SKIP")
os.environ["OGR_SKIP"] = ",".join(FORBIDDEN_DRIVERS)

with _only_versions("geopandas", "pandas"):
    import pyogrio as pyogrio

del os.environ["OGR_SKIP"]
if _before is not None:
    os.environ["OGR_SKIP"] = _before

#: First bytes of the binary formats that GDAL reads for us.
_FIRST_BYTES = {
    ".gpkg": b"SQLite format 3\0",
    ".fgb": b"fgb\x03fgb",
    ".shp": b"\x00\x00\x27\x0a",
}


@contextlib.contextmanager
def reading_with_gdal(path: Path) -> Iterator[Path]:
    """Yield the path by which pyogrio reads a file, unless it would execute what is in it; errors become one line.

    Raises
    ------
    InputError
        With the first line of theirs.
    ForeignSchemaError
        A GeoPackage with views, virtual tables or computed columns.
    """
    with open_input(path) as file:
        is_database = file.read(16).startswith(_FIRST_BYTES[".gpkg"])
    if is_database:
        check_geopackage(path)
    try:
        with plainly_named(path) as source:
            yield source
    except LineworkError:
        raise
    # Texts that are not in their encoding, a .prj that pyogrio takes for neither kind of CRS
    except (RuntimeError, OSError, ValueError, UnboundLocalError) as error:
        text = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise InputError(f"cannot be read ({text})", where=path, advice="copy the file again") from error


def checked_vector_file(path: Path) -> Path:
    """Return the absolute path of a file that GDAL may open, recognised by its first bytes.

    Raises
    ------
    InputError
        Not a regular file, or its content does not match its suffix.
    """
    if not path.name.isprintable():
        raise InputError("control characters in the name", where=path, advice="give it another name")
    expected = _FIRST_BYTES.get(path.suffix.lower())
    with open_input(path) as file:
        first = file.read(16)
    if expected is None or not first.startswith(expected):
        raise InputError(
            f"not a {path.suffix} file (it begins with {first[:8]!r})",
            where=path,
            advice="check what this file is",
        )
    return path.absolute()
