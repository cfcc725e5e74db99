"""What a survey costs follows from its points, not from the area that they are spread over."""

from __future__ import annotations

import re
import shutil
from collections import namedtuple

import numpy as np
import pytest
from tests.conftest import CRS

import linework as api
from linework.errors import InputError
from linework.files.las.write import write_las
from linework.files.store.cell_tiles import SurfaceTiles
from linework.model.points import Points
from linework.runs.opened import surface_cost

PLACE = np.array([500_000.0, 5_700_000.0, 100.0])


def road(n: int = 8_000, length_m: float = 60.0, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    rng = np.random.default_rng(3)
    return rng.uniform([0, -4, 0], [length_m, 4, 0.02], (n, 3)) + PLACE + shift


def spread(n: int, width_m: float) -> np.ndarray:
    return np.random.default_rng(5).uniform(0, [width_m, width_m, 0.1], (n, 3)) + PLACE


def cloud(xyz: np.ndarray) -> Points:
    return Points(xyz, intensity=np.full(len(xyz), 500, np.float32), time_s=3e8 + np.arange(len(xyz)) * 1e-3)


@pytest.fixture
def peak_bytes(monkeypatch):
    """The bytes of the surface while it is made, at their most: before what is no longer needed is removed."""
    found: list[int] = []
    keep_only = SurfaceTiles.keep_only

    def measured(self, *names):
        found.append(sum(path.stat().st_size for path in self.folder.iterdir()))
        keep_only(self, *names)

    monkeypatch.setattr(SurfaceTiles, "keep_only", measured)
    return found


@pytest.fixture
def extracted(linework, tmp_path):
    """Return a function that looks for kerbs in points, as the command does."""

    def run(xyz: np.ndarray):
        path = tmp_path / "survey" / "a.laz"
        path.unlink(missing_ok=True)
        write_las(cloud(xyz), path, crs=CRS)
        output, work = tmp_path / "out" / "lines.gpkg", tmp_path / "work"
        return linework(
            "extract", path, "-o", output, "--features", "kerb_top", "--workers", "1", "--work", work, "--overwrite", "--quiet"
        )  # fmt: skip

    return run


def test_points_spread_over_a_district_are_refused_with_numbers(extracted, tmp_path):
    """250 kB of LAZ that wrote 21 GB: now the ground is not begun, and the work folder holds the points."""
    found = extracted(spread(20_000, 60_000.0))
    assert found.code == 3, found.stderr
    assert re.fullmatch(
        r"error: points: 20,000 points over 60 x 60 km are too far apart for lines: their ground would take [\d,]+ tiles,"
        r" [\d,]+ files and up to [\d.]+ GB of disk\. Check the scale and the CRS of the files with linework info, or"
        r" extract a part of the survey\.",
        found.line,
    )
    assert sum(path.stat().st_size for path in (tmp_path / "work").rglob("*")) < 5_000_000
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").iterdir())


def test_the_library_refuses_them_too():
    with pytest.raises(InputError, match="20,000 points over 60 x 60 km are too far apart for lines"):
        api.extract(cloud(spread(20_000, 60_000.0)), kinds=["kerb_top"])


def test_one_point_far_away_costs_nothing(extracted, peak_bytes):
    """One of 400 points is no stray by its share: it stays, at the price of a tile without anything in it."""
    xyz = road(400)
    assert extracted(xyz).code == 0
    for away_m in (1e5, 2e6):
        far = xyz.copy()
        far[7, :2] += away_m
        assert extracted(far).code == 0
    alone, *others = peak_bytes
    assert max(others) < alone + 30_000


def test_two_places_far_apart_cost_as_much_as_both(extracted, peak_bytes):
    for shift in ((0.0, 600.0, 0.0), (0.0, 500_160.0, 0.0)):
        assert extracted(np.concatenate([road(), road(shift=shift)])).code == 0
    near, far = peak_bytes
    assert far < 1.2 * near


def test_few_points_in_a_wide_area_take_little(extracted, peak_bytes):
    """Each of 30 points lies in a tile of 147,456 cells; its planes would be 3 MB."""
    assert extracted(spread(30, 20_000.0)).code == 0
    assert peak_bytes[0] < 30 * 30_000


def test_a_disk_without_room_is_said_before_the_ground_is_begun(extracted, monkeypatch, tmp_path):
    usage = namedtuple("usage", "total used free")
    real = shutil.disk_usage

    def little(folder):
        return usage(10**12, 10**12, 300_000) if "surface-" in str(folder) else real(folder)

    monkeypatch.setattr(surface_cost.shutil, "disk_usage", little)
    found = extracted(road())
    assert found.code == 5, found.stderr
    assert re.search(
        r"the ground below 8,000 points over [\d.]+ x [\d.]+ km needs \d+ tiles, \d+ files and up to [\d.]+ GB of disk,"
        r" 0\.0003 GB are free\. Free some space, or name a folder on another disk with --work DIR\.$",
        found.line,
    )
    assert not list((tmp_path / "work").rglob("*.e*n*.arrays"))
