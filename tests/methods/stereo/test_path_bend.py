"""The road's direction beside a place, as the van's path shows it."""

from __future__ import annotations

import numpy as np
import pytest

from linework.methods.picked_edge.state import path_heading


def _path() -> np.ndarray:
    """Return places every 3 m on a bend of 50 m radius that begins towards east."""
    turn = np.arange(0.0, 60.0, 3.0) / 50.0
    return np.column_stack([50.0 * np.sin(turn), 50.0 * (1.0 - np.cos(turn)), np.zeros(len(turn))])


@pytest.mark.parametrize("i", [5, 10, 14])
def test_heading_beside_the_path_is_that_of_the_bend(i: int) -> None:
    path = _path()
    turn = 3.0 * i / 50.0
    beside = path[i] + 2.0 * np.array([-np.sin(turn), np.cos(turn), 0.0])
    heading = path_heading(beside, path)
    assert heading == pytest.approx(turn, abs=np.radians(2.0))


def test_ahead_of_the_last_image_the_road_goes_on_as_the_path_ends() -> None:
    path = _path()
    heading = path_heading(path[-1] + [-8.0, 12.0, 0.0], path)
    # The last 6 m of path, whose middle is 3 m before its end
    assert heading == pytest.approx((57.0 - 3.0) / 50.0, abs=0.01)


def test_far_from_the_path_or_without_one_nothing_is_known() -> None:
    assert path_heading(np.array([0.0, -40.0, 0.0]), _path()) is None
    assert path_heading(np.array([1.0, 1.0, 0.0]), _path()[:1]) is None
