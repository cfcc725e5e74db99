"""Do two images belong together: made-up scenes of known depth, and real pairs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.scenes.places import REAL
from tests.scenes.road_views import BASE_M, road_view, views_folder

from linework.errors import InputError
from linework.files.images.pair_check import check_pairs
from linework.files.images.series import open_stereo
from linework.files.survey.open import open_survey
from linework.imaging.rectify import rectifier_of, row_fit
from linework.model.images import StereoSeries

RAMP = REAL / "stereo-ramp"


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> StereoSeries:
    """Eight pairs, a metre apart."""
    found = open_stereo(open_survey([views_folder(tmp_path_factory.mktemp("pairs") / "views")]))
    assert found is not None
    return found


def _shifted(series: StereoSeries, by: int, first: int = 0) -> StereoSeries:
    """Return the series with the right images of others from pair `first` on."""
    pairs = series.pairs
    chosen = [i for i in range(len(pairs)) if 0 <= i + (by if i >= first else 0) < len(pairs)]
    moved = [replace(pairs[i], right=pairs[i + (by if i >= first else 0)].right) for i in chosen]
    return replace(series, pairs=tuple(moved))


def test_rows_of_one_moment_are_the_same() -> None:
    fit = row_fit(road_view(0.0, 0.0), road_view(BASE_M, 0.0))
    assert fit.is_known and fit.error_px < 0.2 and fit.n_fitting > 0.9 * fit.n_matches


def test_an_offset_of_rows_is_measured() -> None:
    fit = row_fit(road_view(0.0, 0.0), road_view(BASE_M, 0.0, row_offset=-2.5))
    assert fit.offset_px == pytest.approx(2.5, abs=0.2)


def test_nothing_is_said_of_images_without_corners() -> None:
    grey = np.full((240, 320), 90, dtype=np.uint8)
    assert not row_fit(grey, grey).is_known


def test_pairs_of_one_moment_pass(series: StereoSeries) -> None:
    check = check_pairs(series, rectifier_of(series.rig))
    assert check.n_looked_at == 5 and check.error_px < 0.2
    assert check.doubtful == () and check.warnings == ()


@pytest.mark.parametrize(("by", "fitting"), [(1, "previous"), (-1, "next")])
def test_an_order_off_by_one_is_refused(series: StereoSeries, by: int, fitting: str) -> None:
    with pytest.raises(InputError, match=f"the {fitting} right image fits better"):
        check_pairs(_shifted(series, by), rectifier_of(series.rig), where="drive")


def test_an_order_off_by_one_from_some_pair_on_makes_the_rest_doubtful(series: StereoSeries) -> None:
    check = check_pairs(_shifted(series, 1, first=3), rectifier_of(series.rig))
    # The right image of pair 3 is in no pair: no neighbour fits better. 1 to 5 are looked at
    assert check.doubtful == (4, 5, 6) and "around 0.400, 0.500 s" in check.warnings[0]


def test_swapped_images_are_refused(series: StereoSeries) -> None:
    swapped = tuple(replace(p, left=p.right, right=p.left) for p in series.pairs)
    with pytest.raises(InputError, match="swapped"):
        check_pairs(replace(series, pairs=swapped), rectifier_of(series.rig))


def test_a_calibration_that_is_not_theirs_is_refused(series: StereoSeries) -> None:
    wrong = replace(series.rig, right=replace(series.rig.right, cy=65.0))
    with pytest.raises(InputError, match=r"5\.\d rows apart"):
        check_pairs(replace(series, rig=wrong), rectifier_of(wrong))


def test_unreadable_images_are_left_to_who_uses_them(series: StereoSeries) -> None:
    gone = tuple(replace(p, left=Path("gone.png")) for p in series.pairs)
    assert check_pairs(replace(series, pairs=gone), rectifier_of(series.rig)).n_looked_at == 0


@pytest.mark.skipif(not RAMP.is_dir(), reason="needs ../shared/data")
def test_the_real_ramp_is_paired_rightly_and_off_by_one_is_seen() -> None:
    series = open_stereo(open_survey([RAMP]))
    assert series is not None
    rectifier = rectifier_of(series.rig)
    assert 0.1 < check_pairs(series, rectifier).error_px < 0.6
    with pytest.raises(InputError, match="the previous right image fits better"):
        check_pairs(_shifted(series, 1), rectifier)
