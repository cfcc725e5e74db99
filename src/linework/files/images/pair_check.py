"""Check that the left and right images of a series belong together, on a few of its pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.errors import InputError
from linework.files.images.read import read_image
from linework.imaging.rectify import LEAST_MATCHES, Rectifier, RowFit, row_fit
from linework.model.images import StereoSeries

#: Pairs checked, spread over the series; 0.3 s each.
N_LOOKED_AT = 5
#: Ratio of fitting corners above which a neighbouring image fits better; while the van stands, all fit equally well.
_BETTER = 1.2
#: Largest row difference [px]: beyond it, rows are not epipolar lines and cannot be matched.
_MAX_ERROR_PX = 2.0
#: Row difference [px] above which a warning is given, because matching suffers; good calibrations have 0.1 to 0.6
#: (measured on real drives).
_WARN_ERROR_PX = 1.0


@dataclass(frozen=True, slots=True)
class PairCheck:
    """Result of the check of a series.

    Parameters
    ----------
    n_looked_at
        Number of checked pairs with enough matches.
    error_px
        Median row difference of matched corners over these pairs [px]; NaN if there are none.
    doubtful
        Numbers of pairs whose images were not taken at the same time.
    warnings
        Warnings, one line each.
    """

    n_looked_at: int
    error_px: float
    doubtful: tuple[int, ...] = ()
    warnings: tuple[str, ...] = ()


def check_pairs(series: StereoSeries, rectifier: Rectifier, *, where: object = None) -> PairCheck:
    """Check, on a few pairs, that corners lie in the same row of both images and match no neighbouring image better.

    Raises
    ------
    InputError
        All right images were taken earlier or later than their left images, the cameras are swapped, or the calibration
        belongs to other cameras. The message gives the figures.

    Notes
    -----
    Checked pairs are equally spaced. Where one fails, all pairs between the nearest good ones are doubtful. Images that
    cannot be read are skipped here and reported when they are used.
    """
    fits = {i: {k: _fit(series, rectifier, i, k) for k in (0, -1, 1)} for i in _places(series)}
    known = {i: fit for i, fit in fits.items() if fit[0] is not None and fit[0].is_known}
    own = [fit[0] for fit in known.values() if fit[0] is not None]
    if not own:
        return PairCheck(0, float("nan"))
    _check_not_swapped(list(known.values()), where)
    if shift := _better_neighbour(list(known.values())):
        raise InputError(
            f"left and right images were not taken at the same time: in {len(known)} checked pairs the "
            f"{'next' if shift > 0 else 'previous'} right image fits better", where=where,
            advice="check the times of the images",
        )  # fmt: skip
    off = [i for i, fit in known.items() if _better_neighbour([fit])]
    good = [fit for i, fit in zip(known, own, strict=True) if i not in off]
    error = float(np.median([fit.error_px for fit in good]))
    if error > _MAX_ERROR_PX:
        raise InputError(
            f"matched corners are {error:.1f} rows apart in left and right images (median of {len(good)} pairs, at "
            f"most {_MAX_ERROR_PX:g})", where=where, advice="check that the calibration belongs to these images",
        )  # fmt: skip
    warnings = []
    if off:
        times = ", ".join(f"{series.pairs[i].time_s:.3f}" for i in off)
        warnings.append(
            f"left and right images were not taken at the same time around {times} s: a neighbouring image fits better"
        )
    if error > _WARN_ERROR_PX:
        warnings.append(f"rows of left and right images differ by {error:.1f} pixels (median); with a good calibration "
                        f"it is less than {_WARN_ERROR_PX:g}")  # fmt: skip
    return PairCheck(len(known), error, _around(series, off, list(known)), tuple(warnings))


def images_checked(series: StereoSeries) -> list[Path]:
    """Return the images that `check_pairs` looks at."""
    pairs, places = series.pairs, _places(series)
    right = sorted({k for i in places for k in (i - 1, i, i + 1) if 0 <= k < len(pairs)})
    return [*(pairs[i].left for i in places), *(pairs[i].right for i in right)]


def _places(series: StereoSeries) -> list[int]:
    """Return the places in the series of the pairs that are checked."""
    # Without the first and last pair, which have only one neighbour
    inner = (1, len(series.pairs) - 2) if len(series.pairs) >= 3 else (0, len(series.pairs) - 1)
    found: list[int] = np.unique(np.linspace(*inner, N_LOOKED_AT).round().astype(int)).tolist()
    return found


def _fit(series: StereoSeries, rectifier: Rectifier, i: int, shift: int) -> RowFit | None:
    """Return the fit of the left image of pair i to the right image of pair i + shift; None if unreadable."""
    if not 0 <= i + shift < len(series.pairs):
        return None
    try:
        left = read_image(series.pairs[i].left, series.rig.left)
        right = read_image(series.pairs[i + shift].right, series.rig.right)
    except InputError:
        return None
    return row_fit(*rectifier.rectified(left, right))


def _better_neighbour(looked_at: Sequence[dict[int, RowFit | None]]) -> int:
    """Return -1 or 1 if, over all pairs together, the previous or next right images fit better, else 0."""
    n_fitting = {k: sum(fit.n_fitting for fits in looked_at if (fit := fits[k])) for k in (0, -1, 1)}
    n_matches = {k: sum(fit.n_matches for fits in looked_at if (fit := fits[k])) for k in (0, -1, 1)}
    best = max(n_fitting, key=lambda k: n_fitting[k])
    # With a wrong calibration no image fits any other
    is_fitting = n_fitting[best] >= max(LEAST_MATCHES, 0.5 * n_matches[best])
    return best if is_fitting and n_fitting[best] > _BETTER * n_fitting[0] else 0


def _check_not_swapped(looked_at: Sequence[dict[int, RowFit | None]], where: object) -> None:
    """Raise InputError if more matches have a negative disparity than fit otherwise: the cameras are swapped."""
    n_swapped = sum(fit.n_swapped for fits in looked_at if (fit := fits[0]))
    most = max(sum(fit.n_fitting for fits in looked_at if (fit := fits[k])) for k in (0, -1, 1))
    if n_swapped >= LEAST_MATCHES and n_swapped > _BETTER * most:
        raise InputError(
            f"{n_swapped} points lie farther right in the right images than in the left, {most} do not: the images "
            "of the two cameras are swapped", where=where, advice="swap images in [cameras.left] and [cameras.right]",
        )  # fmt: skip


def _around(series: StereoSeries, off: Sequence[int], known: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of the failed pairs, and of all pairs between them and the nearest good ones."""
    good = [i for i in known if i not in off]
    doubtful: set[int] = set()
    for i in off:
        before = max((g for g in good if g < i), default=-1)
        after = min((g for g in good if g > i), default=len(series.pairs))
        doubtful.update(range(before + 1, after))
    return tuple(series.pairs[i].number for i in sorted(doubtful))
