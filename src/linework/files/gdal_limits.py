"""What GDAL may not do here: import this before pyogrio or rasterio.

Opening a file with GDAL can read other files and the network: a .gpx that is an OGR VRT in disguise returns
another file's content, a .tif that is a VRT sends HTTP requests. Two copies of GDAL live in this process
(pyogrio's and rasterio's); both read these variables when they are first imported. What the user has set
already stays.

The drivers are left out of GDAL altogether; beside that `checked_vector_file` lets only files pass whose
first bytes are those of a format we read.
"""

from __future__ import annotations

import os
from pathlib import Path

from linework.errors import InputError
from linework.files.las_header import regular_file_bytes

#: Drivers that read other files or the network on behalf of the file they open.
FORBIDDEN_DRIVERS = (
    "VRT", "OGR_VRT", "GTI", "GDALG", "DERIVED", "HTTP", "WMS", "WMTS", "WCS", "WFS", "CSW", "OAPIF", "OGCAPI",
    "PLSCENES", "PLMOSAIC", "Elasticsearch", "Carto", "AmigoCloud", "EEDA", "EEDAI", "NGW", "DAAS", "STACIT",
    "STACTA", "ADBC", "GPSBabel",
)  # fmt: skip

os.environ.setdefault("OGR_SKIP", ",".join(FORBIDDEN_DRIVERS))
os.environ.setdefault("CPL_VSIL_CURL_ALLOWED_EXTENSIONS", ".invalid")
os.environ.setdefault("GDAL_HTTP_TIMEOUT", "1")

#: First bytes of the binary formats that GDAL reads for us.
_FIRST_BYTES = {
    ".gpkg": b"SQLite format 3\0",
    ".fgb": b"fgb\x03fgb",
    ".shp": b"\x00\x00\x27\x0a",
}


def checked_vector_file(path: Path) -> Path:
    """Return the absolute path of a file that GDAL may open, known by its first bytes.

    Raises
    ------
    InputError
        Not a regular file, or not what its name says.
    """
    if regular_file_bytes(path) == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy the file again")
    expected = _FIRST_BYTES.get(path.suffix.lower())
    with path.open("rb") as file:
        first = file.read(16)
    if expected is None or not first.startswith(expected):
        raise InputError(
            f"not a {path.suffix} file (it begins with {first[:8]!r})",
            where=path,
            advice="check what this file is",
        )
    return Path(os.path.abspath(path))  # noqa: PTH100 (resolve() would follow links to other names)
