"""Where a line lies at one place along it: least-squares matching of its template in both images of a pair."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.images.line_matching import (
    CORRELATION,
    GAIN,
    MATCH_SIGMA,
    OFFSET,
    OTHER,
    SAMPLES,
    SHIFT,
    blurred,
    grey_profile_across,
    match_profile,
)
from linework.methods.picked_edge.template import TEMPLATE_REACH_M, TEMPLATE_STEP_M, Template, renewed
from linework.methods.picked_edge.view import PairView

#: Interpolation, and a pattern that is not quite the template, leave an error of this size. [pixels]
LEAST_MATCH_SIGMA_PX = 0.1
#: A match in a narrow gate has few places to choose from, one in a wide gate has many: so much of the profile must
#: be the template's, and so many times the rest's variance.
NARROW_MATCH, WIDE_MATCH = (0.65, 12.0), (0.75, 25.0)
#: Light and shade change all grey values by one factor; the contrast over the mean stays, but for lamps' glare and
#: black levels, within this factor. Less of it is paint that ends within the step, or is worn on one side.
MATCH_CONTRAST = 2.5
#: A second place as good as this share of the best one is as good.
AS_GOOD = 0.9
#: Rows and columns that are averaged along the line, at most: more shows no finer detail, and costs time.
_MOST_ALONG = 16


@dataclass(frozen=True, slots=True)
class ExpectedPlace:
    """Where a line is expected: frame (3, 3) of place [m], unit direction along and to the left; curvature [1/m]."""

    frame: FloatArray
    curvature: float

    def moved(self, across_m: float, up_m: float) -> FloatArray:
        """Return a place beside it. [m]"""  # noqa: D400
        return np.asarray(self.frame[0] + across_m * self.frame[2] + np.array([0.0, 0.0, up_m]))


@dataclass(frozen=True, slots=True)
class ImageScale:
    """How a place's surroundings look in one image.

    Parameters
    ----------
    pixel_m
        What a pixel covers across the line. [m]
    along_m
        What one row (or column) covers along it. [m]
    lift
        How far the line seems to move to its left when it is lifted. [m/m]
    """

    pixel_m: float
    along_m: float
    lift: float


@dataclass(frozen=True, slots=True)
class EdgeMatch:
    """What one image shows: the line `across_m` to the left of where it was expected, to `sigma_m`. [m]"""  # noqa: D400

    across_m: float
    sigma_m: float
    correlation: float
    is_alone: bool
    s: FloatArray
    grey: FloatArray
    result: FloatArray


def scale_at(view: PairView, side: int, place: ExpectedPlace) -> ImageScale | None:
    """Return how an image shows a place, None where it is behind the camera or the line is seen end on."""
    if view.depth_m(place.frame[:1])[0] < 0.5:
        return None
    j = view.jacobian(side, place.frame[0])
    along, across, up = j @ place.frame[1], j @ place.frame[2], j[:, 2]
    length, width = math.hypot(*along), math.hypot(*across)
    normal = np.array([-along[1], along[0]]) / length
    seen = float(normal @ across)
    # A line under 6 degrees from the direction across it has no sides in the image
    if abs(seen) < 0.1 * width:
        return None
    return ImageScale(1.0 / width, 1.0 / length, float(normal @ up) / seen)


def match_edge(
    view: PairView,
    side: int,
    place: ExpectedPlace,
    template: Template,
    gate: tuple[float, float],
    along_m: float,
) -> EdgeMatch | None:
    """Return where the line is in one image near a place, None where it is not found.

    Parameters
    ----------
    gate
        Where it is expected to the left of the place, and how far from there it may be. [m]
    along_m
        Length that is averaged. [m]
    """
    scale = scale_at(view, side, place)
    if scale is None:
        return None
    # Four pixels to either side, also where they are wider than the template
    window = max(template.window_m, 4.0 * scale.pixel_m)
    half = math.ceil((window + abs(gate[0]) + gate[1] + abs(template.anchor_m)) / scale.pixel_m)
    count = min(max(round(along_m / scale.along_m), 1), _MOST_ALONG)
    profile = grey_profile_across(
        view.images[side],
        view.to_pixel[side],
        place.frame,
        place.curvature,
        (along_m, count),
        scale.pixel_m,
        half,
    )
    expected = gate[0] - template.anchor_m
    apart = (template.width_m if template.is_stripe else 0.1) + 2.0 * scale.pixel_m
    found = match_profile(
        profile, scale.pixel_m, template.total, TEMPLATE_STEP_M, window, (expected, gate[1]), apart
    )
    least, ratio = NARROW_MATCH if gate[1] <= 4.0 * scale.pixel_m else WIDE_MATCH
    contrast = _contrast(found, template)
    if not _is_it(found, least, ratio) or not 1.0 / MATCH_CONTRAST < contrast < MATCH_CONTRAST:
        return None
    # The middle of the line must have been seen, not only its side
    across = found[SHIFT] + template.anchor_m
    k = round(across / scale.pixel_m) + half
    if not 0 <= k < len(profile) or math.isnan(profile[k]):
        return None
    sigma = (
        math.hypot(found[MATCH_SIGMA], LEAST_MATCH_SIGMA_PX * scale.pixel_m) * max(1.0, 1.0 / contrast) ** 2
    )
    s = (np.arange(-half, half + 1) * scale.pixel_m) - found[SHIFT]
    alone = bool(found[OTHER] < AS_GOOD * found[CORRELATION] or found[OTHER] < WIDE_MATCH[0])
    return EdgeMatch(float(across), sigma, float(found[CORRELATION]), alone, s, profile, found)


def _is_it(found: FloatArray, least: float, ratio: float) -> bool:
    r = float(found[CORRELATION])
    return r >= least and r * r * (found[SAMPLES] - 2.0) >= ratio * (1.0 - r * r)


def _contrast(found: FloatArray, template: Template) -> float:
    """Return the contrast of a match over its mean, as a multiple of the template's."""
    mean = template.mean
    seen = found[OFFSET] + found[GAIN] * mean
    return float(found[GAIN] * mean / seen) if seen > 0.0 else 0.0


def adapt_template(template: Template, match: EdgeMatch) -> Template:
    """Return the template drawn a little towards what a match showed."""
    pixel = match.s[1] - match.s[0]
    near = np.isfinite(match.grey) & (np.abs(match.s) < TEMPLATE_REACH_M)
    s, grey = match.s[near], match.grey[near]
    seen = np.array([blurred(template.total, TEMPLATE_STEP_M, float(x), float(pixel))[0] for x in s])
    return renewed(template, s, (grey - match.result[OFFSET]) / match.result[GAIN], seen)
