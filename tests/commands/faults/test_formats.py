"""Formats that can read other files, grow without bound or run code are not opened, under any name, in any place."""

import io
import pickle
import zipfile
from pathlib import Path

import pytest

from linework.errors import MachineError
from linework.files.array_file import read_named_arrays

XML = """<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY f SYSTEM "file:///etc/passwd">]><kml><Placemark><name>&b;&f;</name></Placemark></kml>"""
YAML = "a: &a [x, x, x]\nb: &b [*a, *a, *a]\nc: !!python/object/apply:pathlib.Path.touch ['{canary}']\n"


class Touches:
    """Creates a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple:
        return Path.touch, (self.path,)


def archive() -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("../../outside.txt", "x")
        file.writestr("zeros.laz", bytes(50_000_000))
    return content.getvalue()


def hostile(canary: Path) -> dict[str, bytes]:
    """Return the content of files that could do harm."""
    return {
        "xml": XML.encode(), "yaml": YAML.format(canary=canary).encode(), "pickle": pickle.dumps(Touches(canary)),
        "archive": archive(),
        "npy": b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }".ljust(117) + b"\n"
        + pickle.dumps([Touches(canary)]),
    }  # fmt: skip


SUFFIXES = (
    ".kml", ".gpx", ".osm", ".xml", ".yaml", ".npy", ".npz", ".pkl", ".joblib", ".zip", ".kmz", ".tar", ".geojson", ".gpkg",
    ".dxf", ".fgb", ".shp", ".laz", ".csv", ".toml",
)  # fmt: skip


@pytest.mark.parametrize("content", ["xml", "yaml", "pickle", "archive", "npy"])
def test_hostile_formats_are_refused_under_every_name(linework, las_file, tmp_path, content):
    canary, folder = tmp_path / "canary", tmp_path / "files"
    data = hostile(canary)[content]
    folder.mkdir()
    for suffix in SUFFIXES:
        path = folder / f"a{suffix}"
        path.write_bytes(data)
        for arguments in (
            ("info", path), ("convert", path, tmp_path / "out.gpkg"),
            ("extract", las_file, "-o", tmp_path / "out.gpkg", "--trajectory", path),
            ("extract", las_file, "-o", tmp_path / "out.gpkg", "--config", path),
        ):  # fmt: skip
            found = linework(*arguments)
            assert found.code in (2, 3), (suffix, found.stderr)
            assert len(found.line) < 500
            assert "root:" not in found.line
    assert not canary.exists()
    assert not (tmp_path.parent / "outside.txt").exists()
    assert not (tmp_path / "out.gpkg").exists()


def test_arrays_of_a_work_folder_are_not_unpickled(tmp_path):
    canary, path = tmp_path / "canary", tmp_path / "part"
    for name in ("pickle", "npy", "archive"):
        path.write_bytes(hostile(canary)[name])
        with pytest.raises(MachineError):
            read_named_arrays(path)
    assert not canary.exists()
