"""Odd and damaged files of other projects' tests: each has its right answer or its one line, none a traceback."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import pytest
from tests.scenes.places import REAL

HOSTILE = REAL / "hostile"
FOOT, US_FOOT = 0.3048, 1200 / 3937


@dataclass(frozen=True)
class Right:
    """What a sound file is to come to; points and extent are taken from the file by another reader.

    Parameters
    ----------
    crs
        Code of the CRS the points come in, "" where the metric twin has none.
    given
        What the user has to say because the file does not.
    factors
        Metres per unit of the file, in plan and in height.
    said
        Parts of its warnings, one each, beside those about feet.
    refused
        Part of the line without `given`.
    """

    crs: str = "local"
    given: str | None = None
    factors: tuple[float, float] = (1.0, 1.0)
    said: tuple[str, ...] = ()
    refused: str = "the file does not state its CRS"


UNSAID = Right(given="local")
#: Positions alone.
BARE = Right(given="local", said=("no intensity (0 for all points)",))
OWN_KEYS = "the file's GeoTIFF keys define a projection of their own, without EPSG code"
NO_INTENSITY, NO_TIME = "no intensity (0 for all points)", "no GPS time (0 for all points)"
LATE = "GPS times from 1205902800 to 1205902800, though the header says seconds of the week: read as 'gps'"
OREGON_FEET = Right("EPSG:2993", factors=(FOOT, FOOT))
OREGON = Right("EPSG:2991+5703", factors=(1.0, US_FOOT))
NEW_MEXICO = Right("", factors=(US_FOOT, US_FOOT))
UTM15, UTM17 = "EPSG:26915", "EPSG:32617"

RIGHT = {
    "1_4_w_evlr.las": NEW_MEXICO,
    "1_4_w_evlr.laz": NEW_MEXICO,
    "append-bug.laz": Right("EPSG:2154"),
    "autzen.las": OREGON_FEET,
    "autzen_geo_proj.las": OREGON_FEET,
    "extra.laz": UNSAID,
    "extrabytes.las": UNSAID,
    "fullwave.laz": Right("EPSG:32723"),
    "las-rs/32-1-472-150-76.laz": Right("EPSG:25832+5941", said=("30 of 5,658 points (0.53 %) left out",)),
    "las-rs/autzen.copc.laz": Right("EPSG:2991+5703", factors=(FOOT, US_FOOT)),
    "las-rs/autzen.las": OREGON_FEET,
    "las-rs/autzen.laz": OREGON_FEET,
    "las-rs/extrabytes.laz": UNSAID,
    "liblas/1.0_0.las": Right(UTM15, said=(NO_INTENSITY,)),
    "liblas/1.0_1.las": Right(UTM15, said=(NO_INTENSITY, LATE)),
    "liblas/1.1_0.las": Right(UTM15, said=(NO_INTENSITY,)),
    "liblas/1.1_1.las": Right(UTM15, said=(NO_INTENSITY, LATE)),
    "liblas/1.2-with-color.las": UNSAID,
    "liblas/1.2-with-color.laz": UNSAID,
    "liblas/1.2_0.las": Right(UTM15, said=(NO_INTENSITY,)),
    "liblas/1.2_1.las": Right(UTM15, said=(NO_INTENSITY, LATE)),
    "liblas/1.2_2.las": Right(UTM15, said=(NO_INTENSITY,)),
    "liblas/1.2_3.las": Right(UTM15, said=(NO_INTENSITY, LATE)),
    "liblas/TO_core_last_clip.las": UNSAID,
    "liblas/autzen.las": OREGON_FEET,
    "liblas/bad_points_1.1.las": Right(given="local", said=(NO_INTENSITY, NO_TIME)),
    "liblas/certainty3d-color-utm-feet-navd88.las": Right("EPSG:26945", factors=(US_FOOT, US_FOOT)),
    # Its keys say feet: a local CRS in feet is brought to metres
    "liblas/lots_of_vlr.las": Right(
        given="local", factors=(US_FOOT, US_FOOT), said=(OWN_KEYS,), refused=OWN_KEYS
    ),
    "liblas/srs.las": Right(UTM17),
    "liblas/srs_utm17.las": Right(given="local", said=(OWN_KEYS,), refused=OWN_KEYS),
    "liblas/srs_vertcs.las": Right("EPSG:32617+5703"),
    "plane.laz": Right(given="local", said=(OWN_KEYS,), refused=OWN_KEYS),
    "simple.copc.laz": OREGON,
    "simple.las": UNSAID,
    "simple.laz": UNSAID,
    "simple1_1.las": UNSAID,
    # Its writer forgot the scale of 0.001 in the box
    "simple1_3.las": Right(
        given="local", said=("999 of 999 points lie outside the bounding box in its header",)
    ),
    "simple_with_page.copc.laz": OREGON,
    "test1_4.las": NEW_MEXICO,
    "unregistered_extra_bytes.las": Right(given="local", said=(NO_INTENSITY, NO_TIME)),
    "vegetation_1_3.las": UNSAID,
    "pdal/autzen-utm.pcd": UNSAID,
    "pdal/mesh.ply": BARE,
    "pdal/mesh_fixed.ply": BARE,
    "pdal/simple_binary.ply": BARE,
    "pdal/simple_text.ply": BARE,
    "pdal/text_extradim.ply": BARE,
    "pdal/utm17_space.pcd": BARE,
    "pdal/utm17_tab.pcd": BARE,
}
#: Bytes of a binary cloud's point, and how its coordinates are stored at its beginning.
BINARY_CLOUDS = {"autzen-utm.pcd": (52, "<f8"), "simple_binary.ply": (12, "<f4")}
REFUSED = {
    "laszip/broken_size.laz": "LAZ items of version 6, expected at most 3: made by a newer tool. Convert it to LAS 1.4 with"
    " the tool that made it.",
    "laszip/broken_type.laz": "LAZ items of types 6, 22 do not go with compressor 1. Copy the file again, or leave it out.",
    # A height of 1.2 million kilometres
    "pdal/issue_2421.ply": "no usable points among 1 (1 absurd coordinates). Leave the file out.",
    "pdal/missingheader.pcd": "cut off inside the header (no line DATA). Copy the file again, or leave it out.",
    "pdal/no_vertex.ply": "vertices are not the first element (none). Write the points first.",
    "pdal/sized_dims.ply": "points without z (columns: x, y, j, i). Write x, y and z for each point.",
    "pdal/unsized_dims.ply": "points without z (columns: y, x, i, j). Write x, y and z for each point.",
    "pdal/utm17_comma.pcd": "points 0 to 10 cannot be read (1 values in a line of 3). Copy the file again, or leave it"
    " out.",
}
#: Formats that are not read yet.
OTHER_SUFFIXES = (".txt", ".json", ".geojson")

FILES = sorted(
    p.relative_to(HOSTILE).as_posix()
    for p in HOSTILE.rglob("*")
    if p.is_file() and ".linework" not in p.parts
)


@pytest.fixture
def no_output(tmp_path):
    yield tmp_path / "lines.gpkg"
    assert list(tmp_path.iterdir()) == []


def test_there_are_hostile_files():
    if not FILES:
        pytest.skip("the hostile files are not beside this checkout")
    assert set(RIGHT) | set(REFUSED) <= set(FILES)


@pytest.mark.parametrize("name", [n for n in FILES if n not in RIGHT])
def test_a_hostile_file_is_refused(linework, no_output, name):
    suffix = Path(name).suffix
    expected = REFUSED.get(name)
    if expected is None:
        assert suffix in OTHER_SUFFIXES, "no expectation for this file"
        expected = (
            f"suffix '{suffix}', expected .las, .laz, .ply, .pcd, .e57 or survey.toml. Convert it to .laz."
        )
    found = linework("extract", HOSTILE / name, "-o", no_output, "--quiet", "--crs", "local")
    assert (found.code, found.line) == (3, f"error: {HOSTILE / name}: {expected}")


@pytest.mark.parametrize("name", [n for n in FILES if RIGHT.get(n, Right()).given])
def test_a_hostile_file_without_a_crs_is_not_guessed_at(linework, no_output, name):
    found = linework("extract", HOSTILE / name, "-o", no_output, "--quiet")
    advice = "Give --crs EPSG:... or --crs local."
    assert (found.code, found.line) == (3, f"error: {HOSTILE / name}: {RIGHT[name].refused}. {advice}")


@pytest.mark.parametrize("name", [n for n in FILES if n in RIGHT])
def test_a_hostile_file_is_read_right(linework, tmp_path, name):
    right = RIGHT[name]
    option = ["--crs", right.given] if right.given else []
    found = linework("info", HOSTILE / name, "--json", "--quiet", "--work", tmp_path / "work", *option)
    assert found.code == 0, found.stderr
    document = json.loads(found.stdout)
    code = re.search(r"EPSG:[\d+]+", document["crs"]["name"])
    assert (code[0] if code else right.given or "") == right.crs
    assert_same_points(document, HOSTILE / name, right.factors)
    said = [text.removeprefix(f"{Path(name).name}: ") for text in document["warnings"]]
    expected = (*right.said, *(["feet converted to metres"] if right.factors != (1.0, 1.0) else []))
    assert len(said) == len(expected), said
    for part in expected:
        assert any(part in text for text in said), said


def points_of_another_reader(path):
    """Coordinates in the file's own units, and which of them are marked as noise."""
    if path.suffix in (".ply", ".pcd"):
        positions = positions_of_cloud(path)
        return positions, np.zeros(len(positions), dtype=bool)
    with laspy.open(path) as reader:
        las = reader.read()
    classes = np.asarray(las.classification)
    noise = (classes == 7) | np.asarray(las.withheld, dtype=bool)
    if las.header.point_format.id >= 6:
        noise |= classes == 18
    return np.column_stack([las.x, las.y, las.z]), noise


def positions_of_cloud(path):
    """Coordinates of a PLY or PCD file whose points begin with x, y, z and end with the file, or with its faces."""
    head, points = re.split(rb"(?:end_header|DATA \w+)\r?\n", path.read_bytes(), maxsplit=1)
    count = int(re.search(rb"(?:POINTS|element vertex) (\d+)", head)[1])
    if path.name not in BINARY_CLOUDS:
        return np.array([row.split()[:3] for row in points.splitlines()[:count]], dtype=float)
    size, stored = BINARY_CLOUDS[path.name]
    rows = np.frombuffer(
        points[: count * size], dtype={"names": ["xyz"], "formats": [f"3{stored}"], "itemsize": size}
    )
    return rows["xyz"].astype(float)


def assert_same_points(document, path, factors):
    """Compare with what another reader finds: number, extent, those left out."""
    positions, noise = points_of_another_reader(path)
    kept = ~noise
    horizontal, vertical = factors
    east, north, height = (positions[kept] * (horizontal, horizontal, vertical)).T
    assert document["points"] == kept.sum()
    assert document["files"][0]["points"] == len(positions)
    assert sum(document["points_rejected"].values()) == noise.sum()
    extent = document["extent_m"]
    ours = [extent["west"], extent["east"], extent["south"], extent["north"]]
    assert ours == pytest.approx([east.min(), east.max(), north.min(), north.max()], abs=1e-4, rel=0)
    heights = [document["height_m"]["lowest"], document["height_m"]["highest"]]
    assert heights == pytest.approx([height.min(), height.max()], abs=1e-3, rel=0)
