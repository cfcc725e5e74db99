"""Paint shows in intensities of any scale; where there are none, or all are one, it is said and nothing is made up.

B14 of the list of faults; `test_coordinates` tries the kinds that intensity has no part in.
"""

from __future__ import annotations

import numpy as np
import pytest

from linework.files.las.write import write_las
from linework.files.vectors.read_write import read_lines
from linework.model.points import Points
from linework.simulation.simulate import simulate_survey


@pytest.fixture(scope="module")
def street():
    """60 m of street with lane markings, its intensities up to 1."""
    made = simulate_survey("urban", 612, 60.0, points_per_m=1500.0)
    assert made.points.intensity is not None
    return made, made.points.intensity / made.points.intensity.max()


@pytest.fixture
def painted_m(linework, street, tmp_path):
    """Return a function that gives the length of lane markings found with these intensities, and what was said."""
    made, _ = street

    def run(intensity: np.ndarray) -> tuple[float, str]:
        path, output = tmp_path / "a.laz", tmp_path / "lines.gpkg"
        points = Points(made.points.xyz, intensity=intensity.astype(np.float32), time_s=made.points.time_s)
        write_las(points, path, crs=made.crs)
        found = linework(
            "extract", path, "-o", output, "--features", "lane_marking", "--quiet", "--overwrite", "--workers", "1"
        )  # fmt: skip
        assert found.code == 0, found.stderr
        return float(read_lines(output).length_m.sum()), found.stderr

    return run


@pytest.mark.parametrize(
    ("largest", "step"), [(255, 1), (4095, 16), (65535, 1)], ids=["8 bits", "12 bits, shifted", "16 bits"]
)
def test_b14_paint_is_found_in_intensities_of_any_scale(painted_m, street, largest, step):
    length_m, said = painted_m(np.round(street[1] * largest) * step)
    assert length_m > 60.0
    assert said == ""


@pytest.mark.parametrize("value", [0, 65535])
def test_b14_without_contrast_nothing_is_made_up(painted_m, street, value):
    length_m, said = painted_m(np.full(len(street[1]), value))
    assert length_m == 0.0
    assert said.endswith("lines.gpkg: nothing found; its layers are empty.\n")
    assert ("no intensity (0 for all points)" in said) == (value == 0)
