"""Do the images of a series belong together: a few pairs are looked at, and so are their neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.errors import InputError
from linework.files.images.read import read_image
from linework.imaging.rectify import LEAST_MATCHES, Rectifier, RowFit, row_fit
from linework.model.images import StereoSeries

#: Pairs looked at, over the whole series: 0.3 s each.
N_LOOKED_AT = 5
#: A neighbour fits better where so many times more corners fit: a van at rest fits its neighbours as well.
_BETTER = 1.2
#: Rows that differ by more than this are not the same line of the image: nothing can be matched along them. [px]
_MAX_ERROR_PX = 2.0
#: From here on matching suffers; good calibrations are at 0.1 to 0.6 pixels (measured on real drives). [px]
_TOLD_ERROR_PX = 1.0


@dataclass(frozen=True, slots=True)
class PairCheck:
    """Whether the pairs of a series are pairs.

    Parameters
    ----------
    n_looked_at
        Pairs that show enough to say so.
    error_px
        Median over these of the difference in rows of matched places; NaN where none shows enough.
    doubtful
        Numbers of pairs whose images are not of one moment.
    warnings
        One line each.
    """

    n_looked_at: int
    error_px: float
    doubtful: tuple[int, ...] = ()
    warnings: tuple[str, ...] = ()


def check_pairs(series: StereoSeries, rectifier: Rectifier, *, where: object = None) -> PairCheck:
    """Look at a few pairs: is the same place in the same row of both, and in no neighbour more so.

    Raises
    ------
    InputError
        The images of all pairs are not of one moment (one too early or too late), the cameras are swapped, or
        the calibration is not theirs; with numbers.

    Notes
    -----
    Looked at are pairs at equal steps. Where one of these is no pair, all those up to the next one that is are
    doubtful. Images that cannot be read are left out here; whoever uses them says so.
    """
    # Not the ends: they have one neighbour only
    inner = (1, len(series.pairs) - 2) if len(series.pairs) >= 3 else (0, len(series.pairs) - 1)
    places = np.unique(np.linspace(*inner, N_LOOKED_AT).round().astype(int)).tolist()
    fits = {i: {k: _fit(series, rectifier, i, k) for k in (0, -1, 1)} for i in places}
    known = {i: fit for i, fit in fits.items() if fit[0] is not None and fit[0].is_known}
    own = [fit[0] for fit in known.values() if fit[0] is not None]
    if not own:
        return PairCheck(0, float("nan"))
    _check_not_swapped(list(known.values()), where)
    if shift := _better_neighbour(list(known.values())):
        raise InputError(
            f"left and right images are not of one moment: in {len(known)} pairs looked at, the right image one "
            f"{'later' if shift > 0 else 'earlier'} fits better", where=where,
            advice="check the times of the images",
        )  # fmt: skip
    off = [i for i, fit in known.items() if _better_neighbour([fit])]
    good = [fit for i, fit in zip(known, own, strict=True) if i not in off]
    error = float(np.median([fit.error_px for fit in good]))
    if error > _MAX_ERROR_PX:
        raise InputError(
            f"the same places are {error:.1f} rows apart in left and right images (median of {len(good)} pairs, at "
            f"most {_MAX_ERROR_PX:g})", where=where, advice="check that the calibration is that of these images",
        )  # fmt: skip
    warnings = []
    if off:
        times = ", ".join(f"{series.pairs[i].time_s:.3f}" for i in off)
        warnings.append(
            f"left and right images are not of one moment around {times} s: a neighbour fits better"
        )
    if error > _TOLD_ERROR_PX:
        warnings.append(f"rows of left and right images differ by {error:.1f} pixels (median), a good calibration "
                        f"leaves less than {_TOLD_ERROR_PX:g}")  # fmt: skip
    return PairCheck(len(known), error, _around(series, off, list(known)), tuple(warnings))


def _fit(series: StereoSeries, rectifier: Rectifier, i: int, shift: int) -> RowFit | None:
    """Return how the left image of pair i fits the right image of pair i + shift; None where one cannot be read."""
    if not 0 <= i + shift < len(series.pairs):
        return None
    try:
        left = read_image(series.pairs[i].left, series.rig.left)
        right = read_image(series.pairs[i + shift].right, series.rig.right)
    except InputError:
        return None
    return row_fit(*rectifier.rectified(left, right))


def _better_neighbour(looked_at: Sequence[dict[int, RowFit | None]]) -> int:
    """Return -1 or 1 where the right images before or after fit better in all pairs together, else 0."""
    n_fitting = {k: sum(fit.n_fitting for fits in looked_at if (fit := fits[k])) for k in (0, -1, 1)}
    n_matches = {k: sum(fit.n_matches for fits in looked_at if (fit := fits[k])) for k in (0, -1, 1)}
    best = max(n_fitting, key=lambda k: n_fitting[k])
    # With a calibration that is not theirs no image fits any other
    is_fitting = n_fitting[best] >= max(LEAST_MATCHES, 0.5 * n_matches[best])
    return best if is_fitting and n_fitting[best] > _BETTER * n_fitting[0] else 0


def _check_not_swapped(looked_at: Sequence[dict[int, RowFit | None]], where: object) -> None:
    """Refuse pairs where more places are in the same row behind infinity than fit in any way."""
    n_swapped = sum(fit.n_swapped for fits in looked_at if (fit := fits[0]))
    most = max(sum(fit.n_fitting for fits in looked_at if (fit := fits[k])) for k in (0, -1, 1))
    if n_swapped >= LEAST_MATCHES and n_swapped > _BETTER * most:
        raise InputError(
            f"{n_swapped} places lie farther right in the right images than in the left, {most} do not: the images "
            "of the two cameras are swapped", where=where, advice="swap images in [cameras.left] and [cameras.right]",
        )  # fmt: skip


def _around(series: StereoSeries, off: Sequence[int], known: Sequence[int]) -> tuple[int, ...]:
    """Return the numbers of the pairs between those that fit: after the last before, up to the next."""
    good = [i for i in known if i not in off]
    doubtful: set[int] = set()
    for i in off:
        before = max((g for g in good if g < i), default=-1)
        after = min((g for g in good if g > i), default=len(series.pairs))
        doubtful.update(range(before + 1, after))
    return tuple(series.pairs[i].number for i in sorted(doubtful))
