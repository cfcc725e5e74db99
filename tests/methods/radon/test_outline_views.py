"""Views of outlines: where the points of a bar lie, with the noise of a scanner."""

import numpy as np
import pytest

from linework.methods.rails.outlines import SECTION_CELL_M, half_height_m, views_of


@pytest.mark.parametrize("outline", ["flat", "pipe", "box"])
def test_views_are_the_density_of_the_points_of_an_outline_with_noise(outline):
    """The first view is from the right, 5 degrees above; the next two are its mirror image and the mean of both."""
    n_rows, across, upward = 12, 0.009, 0.0036
    views = views_of(outline, n_rows, (across, upward))
    half, beams, angle = half_height_m(n_rows, upward), (np.arange(60) + 0.5) / 30 - 1.0, np.radians(5.0)
    points = {
        "flat": [(0.0, half * b, 1.0) for b in beams],
        "pipe": [(half * np.cos(t), half * np.sin(t), 1.0) for t in np.arcsin(beams) + angle],
        "box": [(half, half * b, np.cos(angle)) for b in beams]
        + [(half * b, half, np.sin(angle)) for b in beams],
    }[outline]
    z, u = (np.arange(n_rows) - 5.5)[:, None] * SECTION_CELL_M, np.arange(-100, 101) * 0.005
    density = sum(
        w * np.exp(-0.5 * (((z - height) / upward) ** 2 + ((u - place) / across) ** 2))
        for place, height, w in points
    )
    seen = [density] if outline == "flat" else [density, density[:, ::-1], 0.5 * (density + density[:, ::-1])]
    assert len(views) == (1 if outline == "flat" else 9)
    for view, expected in zip(views, seen, strict=False):
        shares = 0.95 * 2.0 * expected / expected.sum() + 0.05 / (n_rows * 100)
        assert np.allclose(view, np.log(shares), atol=1e-5)
