"""Points outside the box in their file's header are counted, whatever batches they come in."""

from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.laser_files import LOW, SIZE_M, drive_file

from linework.files.las.header import read_las_header
from linework.files.las.tally import HeaderBox


@pytest.fixture
def header(tmp_path):
    return read_las_header(drive_file(tmp_path / "a.las"))


def said(header, xyz, *, batch=100, factors=(1.0, 1.0)):
    box = HeaderBox(header, factors)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for start in range(0, len(xyz), batch):
        part = xyz[start : start + batch]
        low, high = np.minimum(low, part.min(axis=0)), np.maximum(high, part.max(axis=0))
        box.add(part, low, high)
    return box.warnings(len(xyz))


def inside(n=1000):
    return np.random.default_rng(1).uniform(0.1, 0.9, (n, 3)) * SIZE_M + LOW


def test_points_inside(header):
    assert said(header, inside()) == ()


@pytest.mark.parametrize("batch", [1, 7, 100, 5000])
@pytest.mark.parametrize("axis", range(3))
def test_points_outside_are_counted(header, batch, axis):
    xyz = inside()
    xyz[[3, 500, 501, 999], axis] += [50.0, -50.0, 500.0, 0.0]
    assert said(header, xyz, batch=batch) == ("3 of 1,000 points lie outside the bounding box in its header",)


def test_a_step_of_the_file_is_no_difference(header):
    edge = np.array([header.low, header.high])
    assert said(header, edge + np.array([[-0.0009], [0.0009]])) == ()
    assert said(header, edge + np.array([[-0.0021], [0.0021]])) != ()


def test_a_file_in_feet(header):
    feet = replace(
        header, low=tuple(v / 0.3048 for v in header.low), high=tuple(v / 0.3048 for v in header.high)
    )
    assert said(feet, inside(), factors=(0.3048, 0.3048)) == ()
    assert said(feet, inside(), factors=(1.0, 1.0)) == (
        "1,000 of 1,000 points lie outside the bounding box in its header",
    )


def test_a_header_without_a_box_says_nothing(header):
    assert said(replace(header, low=None, high=None), inside() * 1e6) == ()
