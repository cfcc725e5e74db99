"""Matching of a line's template with the profile across the line, in one image of a pair."""

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
from linework.methods.picked_edge.fitted import (
    AS_GOOD,
    LEAST_MATCH_SIGMA_PX,
    MATCH_CONTRAST,
    NARROW_MATCH,
    WIDE_MATCH,
    MatchLimit,
)
from linework.methods.picked_edge.template import TEMPLATE_REACH_M, TEMPLATE_STEP_M, Template, renewed
from linework.methods.picked_edge.view import PairView

#: Most rows or columns averaged along the line: more costs time and shows no finer detail.
_MOST_ALONG = 16
#: Smallest depth of a place in front of the camera. [m]
_LEAST_DEPTH_M = 0.5
#: Smallest sine of the angle between a line and the direction across it in the image, 6 degrees: below, the profile
#: runs along the line.
_LEAST_SINE = 0.1
#: Half of the window on both sides, where pixels are wide. [pixels]
_WINDOW_PX = 4.0
#: Half width up to which a gate is narrow. [pixels]
_NARROW_PX = 4.0
#: Least distance of another match: the width of the stripe, or this for a bare edge [m], and pixels beside it.
_OTHER_EDGE_M, _OTHER_PX = 0.1, 2.0


@dataclass(frozen=True, slots=True)
class ExpectedPlace:
    """An expected place of a line.

    Parameters
    ----------
    frame
        (3, 3) rows: place [m, local world], unit direction along the line, unit direction to its left.
    curvature
        Curvature to the left. [1/m]
    """

    frame: FloatArray
    curvature: float

    def moved(self, across_m: float, up_m: float) -> FloatArray:
        """Return (3,) the place shifted to the left and up. [m, local world]"""  # noqa: D400
        return np.asarray(self.frame[0] + across_m * self.frame[2] + np.array([0.0, 0.0, up_m]))


@dataclass(frozen=True, slots=True)
class ImageScale:
    """Scale of one image at a place of a line.

    Parameters
    ----------
    pixel_m
        Extent of a pixel across the line. [m]
    along_m
        Extent of one row (or column) along it. [m]
    lift
        Apparent shift of the line to the left per metre of height. [m/m]
    """

    pixel_m: float
    along_m: float
    lift: float


@dataclass(frozen=True, slots=True)
class EdgeMatch:
    """A match of a line in one image.

    Parameters
    ----------
    across_m, sigma_m
        Distance of the line to the left of its expected place, and the standard deviation. [m]
    correlation
        Correlation of profile and template.
    is_alone
        Whether no other place in the gate matches about as well.
    s, grey
        (k,) places on the template [m] and the grey values there.
    result
        (7,) columns of `linework.kernels.images.line_matching`.
    """

    across_m: float
    sigma_m: float
    correlation: float
    is_alone: bool
    s: FloatArray
    grey: FloatArray
    result: FloatArray


def scale_at(view: PairView, side: int, place: ExpectedPlace) -> ImageScale | None:
    """Return the scale of an image at a place; None behind the camera, and where the line points at the camera."""
    if view.depth_m(place.frame[:1])[0] < _LEAST_DEPTH_M:
        return None
    j = view.jacobian(side, place.frame[0])
    along, across, up = j @ place.frame[1], j @ place.frame[2], j[:, 2]
    length, width = math.hypot(*along), math.hypot(*across)
    normal = np.array([-along[1], along[0]]) / length
    seen = float(normal @ across)
    if abs(seen) < _LEAST_SINE * width:
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
    """Return the match of a line in one image near a place, None where it is not found.

    Parameters
    ----------
    side
        0: the left image; 1: the right one.
    gate
        Expected distance to the left of the place, and the largest difference from it. [m]
    along_m
        Length along the line that is averaged. [m]
    """
    scale = scale_at(view, side, place)
    if scale is None:
        return None
    window = max(template.window_m, _WINDOW_PX * scale.pixel_m)
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
    apart = (template.width_m if template.is_stripe else _OTHER_EDGE_M) + _OTHER_PX * scale.pixel_m
    found = match_profile(
        profile, scale.pixel_m, template.total, TEMPLATE_STEP_M, window, (expected, gate[1]), apart
    )
    limit = NARROW_MATCH if gate[1] <= _NARROW_PX * scale.pixel_m else WIDE_MATCH
    contrast = _contrast(found, template)
    if not _is_match(found, limit) or not 1.0 / MATCH_CONTRAST < contrast < MATCH_CONTRAST:
        return None
    # The middle of the line must be inside the profile, not only its side
    across = found[SHIFT] + template.anchor_m
    k = round(across / scale.pixel_m) + half
    if not 0 <= k < len(profile) or math.isnan(profile[k]):
        return None
    sigma = (
        math.hypot(found[MATCH_SIGMA], LEAST_MATCH_SIGMA_PX * scale.pixel_m) * max(1.0, 1.0 / contrast) ** 2
    )
    s = (np.arange(-half, half + 1) * scale.pixel_m) - found[SHIFT]
    alone = bool(found[OTHER] < AS_GOOD * found[CORRELATION] or found[OTHER] < WIDE_MATCH.correlation)
    return EdgeMatch(float(across), sigma, float(found[CORRELATION]), alone, s, profile, found)


def _is_match(found: FloatArray, limit: MatchLimit) -> bool:
    """Return whether correlation and F ratio of a match reach their limits."""
    r = float(found[CORRELATION])
    return r >= limit.correlation and r * r * (found[SAMPLES] - 2.0) >= limit.f_ratio * (1.0 - r * r)


def _contrast(found: FloatArray, template: Template) -> float:
    """Return the ratio of contrast to mean of a match, as a multiple of the template's."""
    mean = template.mean
    seen = found[OFFSET] + found[GAIN] * mean
    return float(found[GAIN] * mean / seen) if seen > 0.0 else 0.0


def adapt_template(template: Template, match: EdgeMatch) -> Template:
    """Return the template updated by a match, with a small weight."""
    pixel = match.s[1] - match.s[0]
    near = np.isfinite(match.grey) & (np.abs(match.s) < TEMPLATE_REACH_M)
    s, grey = match.s[near], match.grey[near]
    seen = np.array([blurred(template.total, TEMPLATE_STEP_M, float(x), float(pixel))[0] for x in s])
    return renewed(template, s, (grey - match.result[OFFSET]) / match.result[GAIN], seen)
