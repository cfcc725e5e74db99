"""The automatic path of He and Novak (1992), whole and as published: straight bright lines of one pair.

G. He, K. Novak: Automatic analysis of highway features from digital stereo-images, ISPRS XXIX B3, 119-124. What
`linework.methods.stereo.method` finds goes beyond it: bends, worn and faint lines, sub-pixel places, sigmas.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, BoolArray
from linework.methods.stereo.bright_lines import bright_pixels, centres_of_runs, chain_code, thinned
from linework.methods.stereo.lanes import (
    StraightLines,
    analytical_functions,
    grouped,
    matched,
    through_vanishing_point,
)
from linework.model.camera import RectifiedRig
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings

#: Standard deviation of a whole pixel's place. [pixels]
PIXEL_SIGMA_PX = 1.0 / np.sqrt(12.0)
#: The search window: cameras 1.4 to 2.5 m above the road see it here, up to so far ahead and to both sides. [m]
HEIGHT_M, AHEAD_M, ACROSS_M = 2.0, 40.0, 6.0


def see_as_published(pair: RectifiedPair) -> Sightings:
    """Return the straight bright lines of a pair, a place per row, in the vehicle frame."""
    left = lines_in(pair.left, search_window(pair.rig))
    right = lines_in(pair.right, search_window(pair.rig))
    # Straight lines of both images are intersected into object space
    found = []
    for number, (i, j) in enumerate(matched(left, right).tolist()):
        top = max(left.top_row[i], right.top_row[j])
        bottom = min(left.bottom_row[i], right.bottom_row[j])
        row = np.arange(bottom, top - 1.0, -1.0)
        col = left.k[i] * row + left.b[i]
        disparity = col - (right.k[j] * row + right.b[j])
        row, col, disparity = row[disparity > 0.5], col[disparity > 0.5], disparity[disparity > 0.5]
        n = len(row)
        sigma = np.full(n, PIXEL_SIGMA_PX)
        found.append(
            Sightings(
                xyz=pair.rig.intersect(col, row, disparity), pair=np.full(n, pair.number), line=np.full(n, number),
                col=col, row=row, disparity=disparity, sigma_px=sigma, sigma_disparity_px=np.sqrt(2.0) * sigma,
            )
        )  # fmt: skip
    return Sightings.concatenate(found)


def search_window(rig: RectifiedRig) -> BoolArray:
    """Return (rows, cols) where level cameras at the usual height see the carriageway."""
    row, col = np.mgrid[: rig.height, : rig.width]
    ahead = HEIGHT_M * rig.focal_px / np.maximum(row - rig.cy, 1e-9)
    across = (col - rig.cx) * ahead / rig.focal_px
    return np.asarray((ahead < AHEAD_M) & (np.abs(across) < ACROSS_M))


def lines_in(image: AnyArray, window: BoolArray | None = None) -> StraightLines:
    """Return the straight bright lines of one image, in a search window."""
    # 3.1 Bright pixels of each scan line; side by side, their centre stands for them
    bright = bright_pixels(image, window)
    centres = centres_of_runs(bright)
    # 3.2 One pixel wide
    thin = thinned(bright)
    # 3.3 From pixels to lines
    chains = chain_code(thin)
    # 3.4 Analytical functions; lines parallel in space meet in one point; pieces of one line together
    return grouped(through_vanishing_point(analytical_functions(chains, centres)))
