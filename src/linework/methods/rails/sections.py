"""What stands in a cross-section: beams one above another, each explained by the outline that fits its points best.

A W-beam is a band of points 0.31 m high with nothing above and below it, a thrie beam one of 0.51 m, a cable barrier three
or four thin ones; beams are folded. What height alone does not tell (a pipe, a square tube, a board) is told by where
across the points lie: the outlines compete, and the one with the least distances explains the band. What lies on no outline
(hedges, cars) remains unexplained, and has no form.

Separate from `forms`, which goes along a line: this explains one section, without knowing of lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.kernels.radon import sections as kernels
from linework.kernels.radon.bands import (
    BAND_SHARE,
    DENSE_POINTS,
    GAP_CELLS,
    bands_of_rows,
    middles_of_rows,
    number_near,
)
from linework.methods.rails import fitted
from linework.methods.rails.circles import RAIL_BAND_M, Bins, CircleConfig
from linework.methods.rails.outlines import (
    SECTION_CELL_M,
    OutlineFit,
    bars_of,
    fold_of,
    is_folded,
    least_thin,
    on_outline_m,
    plate_of,
)

#: Half width of a section: the foot of a concrete barrier stands up to 0.25 m before its top edge. [m]
HALF_SECTION_M = 0.30
#: Range of a section below and above the followed edge: from a fence's top to its foot, and from its lowest board, 0.4 m
#: high, to its top. [m]
DEPTHS_M = (-1.75, 1.35)
#: Above the ground, below this, is what grows there. [m]
OVER_GRASS_M = 0.15
#: Half of the distance of a folded beam's crests (0.194 m): seen from above, a crest hides no more below it. [m]
FOLD_M = 0.097
#: What is in view of a crest is higher than this; a rope is not. [m]
LEAST_CREST_M = 0.065
#: Height of what is seen of a top from above: its noise. [m]
TOP_HEIGHT_M = 0.03
#: Heights of bands, each the size of the thing and 1 cm of noise at either edge, or the share of it that is in view. [m]
#: W-beam: 0.31 (EN 1317 A and B, AASHTO M 180), of which 0.21 and their noise are in view where its upper lip and what is below the lower
#: crest, 0.194 m under the upper one, are hidden. Thrie beam: 0.506 (MASH RTM08a).
W_BEAM_M, THRIE_BEAM_M = (0.215, 0.40), (0.42, 0.60)
#: Ropes of 19 mm, seen as wide as a beam of a few centimetres, with its noise; tubes of handrails, 5 cm, and half a cell;
#: pipes, square tubes and boards, 0.06 to 0.20. [m]
ROPE_M, HANDRAIL_M, BAR_M = 0.085, 0.075, (0.05, 0.215)
#: Two W-beams, one above the other, leave at least so much between them, less their noise: spacers and bolts need it. [m]
BETWEEN_BEAMS_M = 0.06
#: Ropes hang closer to each other than the tubes of a handrail or the pipes of a bridge rail. [m]
ROPE_PITCH_M = 0.25
#: The highest rope of cable barriers hangs 0.73 to 1.07 m above the ground (EN 1317-2 and MASH TL-4 systems), and the ground
#: beside them dips; rows of points above that are a scanner's rings on a wall. [m]
HIGHEST_ROPE_M = 1.20
#: Beams of rails hang on their posts: they end this high above the grass, or the depths under the lowest one are clear,
#: and above the ground's own noise. [m]
HANGS_M, CLEAR_UNDER_M, OVER_GROUND_M = 0.05, (0.01, 0.04), 0.05
#: Half width of what is under a beam: half of a beam's depth, and noise. [m]
_MOST_UNDER_M = 0.10
#: A fence of mesh is between this high, so that a scanner on a roof sees over it; and ends this near the ground: a kerb,
#: grass and the plinth that it stands on or behind hide its foot, and stand there as a band of their own. [m]
FENCE_M, FENCE_FOOT_M = (0.60, 1.60), 0.40
#: Its highest 3 cm hold points of its own plane alone; a wall 0.1 m thick has half of them on its top, seen 17 degrees
#: from above, a fifth seen 4 degrees from above. [share]
MOST_TOP_SHARE = 0.2
#: A concrete barrier is at least this high over grass; its upper face ends below the edge's own noise, and above its lower
#: slope; the foot is as high as the toe of a New Jersey profile and the slope above; it stands before the top edge by 0.19
#: to 0.25 m less what grass hides (MASH, BS 6579-7). [m]
CONCRETE_M, UNDER_TOP_M, FOOT_HEIGHT_M, FOOT_BEFORE_M = 0.45, (0.03, 0.15), 0.12, (0.06, 0.30)
#: Least that a face slopes above a foot that a verge hides: half of an F-shape's 0.055 m; on a kerb walls are upright. [m]
SLOPE_BEFORE_M = 0.03
MOST_FOOT_M = 0.33  # a New Jersey's, which raises a cell of ground by half of that at most


@dataclass(frozen=True, slots=True)
class Band:
    """A beam in a cross-section.

    Parameters
    ----------
    low_m, high_m
        Its edges, above the followed edge. [m]
    outline
        "flat", "box" or "pipe": what explains its points best.
    axis_m
        Middle of that outline, or the top edge of concrete, to the left of the line. [m]
    explained
        Share of the points of the band that lie on it.
    top_share, below_share
        Shares of the points of its highest 3 cm, and of those from 6 cm down, that lie off the plane of its face.
    fold_m
        Standard deviation of where its rows lie across, see `fold_of`. [m]
    fits
        What each outline that was tried explains.
    """

    low_m: float
    high_m: float
    outline: str
    axis_m: float
    explained: float
    top_share: float
    fits: tuple[OutlineFit, ...] = ()
    below_share: float = 0.0
    fold_m: float = 0.0

    @property
    def height_m(self) -> float:
        """Height of the beam. [m]."""
        return self.high_m - self.low_m


@dataclass(frozen=True, slots=True)
class SectionForm:
    """What a cross-section shows.

    Parameters
    ----------
    kind, form
        Kind and form of the line; form "" where nothing explains the section.
    bands
        Its beams, the highest first.
    hangs
        Whether the lowest is clear of the grass.
    is_level
        Whether it was looked at along the road, the followed edge changing from one beam to another there.
    """

    kind: str
    form: str
    bands: tuple[Band, ...]
    hangs: bool
    is_level: bool = False

    @property
    def is_bars(self) -> bool:
        """Whether its beams are of the height of bars, explained or not: their outlines show what they are."""
        other = self.form in ("cable_barrier", "tubes")
        return bool(self.bands) and not other and _are_bars(self.bands)

    @property
    def lines(self) -> tuple[Band, ...]:
        """The beams that are lines of their own: every pipe, of all else the highest."""
        return self.bands if self.form == "tube" else self.bands[:1]

    @property
    def explained(self) -> float:
        """Share of the points of its beams that lie on their outlines."""
        return min((band.explained for band in self.bands), default=0.0)

    def mirrored(self) -> SectionForm:
        """Return the section as from the other end of the line."""
        bands = (
            replace(b, axis_m=-b.axis_m, fits=tuple(replace(f, axis_m=-f.axis_m) for f in b.fits))
            for b in self.bands
        )
        return replace(self, bands=tuple(bands))


NOTHING = SectionForm("", "", (), hangs=False)


def sections_at(nodes: FloatArray, windows: IntArray, bins: Bins, circles: CircleConfig) -> FloatArray:
    """Return the points of the cross-sections of windows along a line, (k, heights, widths).

    Parameters
    ----------
    nodes
        (n, 4) x, y [m], heading [rad] and top z [m], from the origin of the bins.
    windows
        (k, 2) int64: first node of each window, and the one after its last; neither ever falls from one to the next.
    """
    counts: FloatArray = kernels.count_outlines(
        bins.points, bins.starts, bins.n_x, bins.n_y, bins.cell_m, np.ascontiguousarray(nodes),
        np.ascontiguousarray(windows), circles.spacing_m / 2, HALF_SECTION_M, DEPTHS_M, SECTION_CELL_M, bins.work,
    )  # fmt: skip
    return counts


def form_of_section(
    counts: FloatArray, above_ground_m: float, noise_m: float = 0.0, above_beside_m: tuple[float, float] | None = None
) -> SectionForm:  # fmt: skip
    """Return what explains a cross-section.

    Parameters
    ----------
    counts
        (heights, widths) points of one or more stations of a line, as `sections_at` returns them.
    above_ground_m
        Height of the followed edge above the ground. [m]
    noise_m
        Standard deviation of the survey's points there; up to 2 cm make no difference. [m]
    above_beside_m
        The same to the right and to the left: concrete's foot is taken for ground, verges hide that of a fence. [m]

    A board of 12 cm, and nothing else:

    >>> counts = np.zeros((310, 40))
    >>> counts[163:175, 19:21] = 30.0
    >>> section = form_of_section(counts, 0.8)
    >>> [(band.outline, round(band.height_m, 2)) for band in section.bands], section.form
    ([('flat', 0.12)], '')
    """
    seen: dict[tuple[float, float], Band] = {}
    form = _form_over(counts, above_ground_m, noise_m, seen)
    if form.form or above_beside_m is None or len(form.bands) != 1:
        return form
    for side, beside_m in zip((-1.0, 1.0), above_beside_m, strict=True):
        is_raised = above_ground_m < beside_m <= above_ground_m + 0.5 * MOST_FOOT_M
        beside = _form_over(counts, beside_m, noise_m, seen, foot=side) if is_raised else form
        if beside.kind == "barrier":
            return beside
    nearest_m = float(np.fmin(*above_beside_m))
    over_verge = _form_over(counts, nearest_m, noise_m, seen) if nearest_m < above_ground_m else form
    return over_verge if over_verge.form == "mesh" else form


def _form_over(
    counts: FloatArray, above_ground_m: float, noise_m: float, seen: dict[tuple[float, float], Band], foot: float = 0.0
) -> SectionForm:  # fmt: skip
    """Return what explains a cross-section over the ground; `foot` is the side, 1 for the left, whose ground that is.

    `seen` keeps its bands by their edges: over whatever ground, they are the same.
    """
    z, u = _centres(*counts.shape)
    edges = _bands(bands_of_rows(counts, _rows(z, OVER_GRASS_M - above_ground_m).start), z)
    if not edges:  # points at many heights, none of which is dense: leaves and stalks; or few points
        return NOTHING
    if edges[0][1] > min(DEPTHS_M[1], RAIL_BAND_M[1] - above_ground_m) - GAP_CELLS * SECTION_CELL_M:
        # A wall goes on above what is looked at: what ends with that has no upper edge
        return NOTHING
    on_m = on_outline_m(noise_m)
    seen |= {edge: _explained(counts, z, u, edge, on_m) for edge in edges if edge not in seen}
    bands = tuple(seen[edge] for edge in edges)
    edge_m = _edge_of_concrete(counts, bands[0], above_ground_m, on_m, foot) if len(bands) == 1 else None
    if edge_m is not None:
        faced = _faced(_under_lid(counts, z, bands[0]), u, on_m)
        face = replace(bands[0], axis_m=edge_m, explained=faced)
        return SectionForm("barrier", "concrete", (face,), hangs=False)
    return _form(bands, above_ground_m, noise_m, hangs=_hangs(counts, bands[-1], above_ground_m))


def _hangs(counts: FloatArray, lowest: Band, above_ground_m: float) -> bool:
    """Return whether it is clear under the lowest band: its points end there, above the grass or the ground."""
    if above_ground_m + lowest.low_m >= OVER_GRASS_M + HANGS_M:
        return True
    z, u = _centres(*counts.shape)
    least, most = lowest.low_m - CLEAR_UNDER_M[1], lowest.low_m - CLEAR_UNDER_M[0]
    under = counts[_rows(z, max(least, OVER_GROUND_M - above_ground_m), most)]
    own = counts[_rows(z, lowest.low_m, lowest.high_m)]
    if not len(under):
        return False
    in_under, in_own = (
        number_near(part, u, np.full(len(part), lowest.axis_m), _MOST_UNDER_M)[0] / len(part)
        for part in (under, own)
    )
    return bool(in_under < BAND_SHARE * in_own)


@lru_cache
def _centres(n_z: int, n_u: int) -> tuple[FloatArray, FloatArray]:
    """Return the middles (n_z,) and (n_u,) of cells in height and across. [m]."""
    rows, columns = (np.arange(n, dtype=np.float64) + 0.5 for n in (n_z, n_u))
    return DEPTHS_M[0] + rows * SECTION_CELL_M, columns * SECTION_CELL_M - HALF_SECTION_M


def _rows(z: FloatArray, above_m: float, below_m: float = np.inf) -> slice:
    """Return which of the rising heights (n,) lie between two others. [m]."""
    return slice(int(np.searchsorted(z, above_m, side="right")), int(np.searchsorted(z, below_m)))


def _bands(rows: IntArray, z: FloatArray) -> list[tuple[float, float]]:
    """Return lower and upper edges of bands of rows (k, 2), of beams each, the highest first. [m]."""
    bands: list[tuple[float, float]] = []
    for first, stop in rows[::-1].tolist():
        low, high = float(z[first] - 0.5 * SECTION_CELL_M), float(z[stop - 1] + 0.5 * SECTION_CELL_M)
        sizes = [high - low, bands[-1][1] - bands[-1][0]] if bands else [0.0]
        apart = bands[-1][0] - high if bands else np.inf
        # Crests of one beam hide what is between them; two whole beams stand one above the other
        are_two = all(W_BEAM_M[0] <= v <= W_BEAM_M[1] for v in sizes) and apart >= BETWEEN_BEAMS_M
        if min(sizes) > LEAST_CREST_M and apart <= FOLD_M and not are_two:
            bands[-1] = low, bands[-1][1]
        else:
            bands.append((low, high))
    return bands


def _explained(
    counts: FloatArray, z: FloatArray, u: FloatArray, edges: tuple[float, float], on_m: float
) -> Band:
    """Return a band with the outline that explains it best: of a band of the height of a bar a plate, a pipe or a tube."""
    low, high = edges
    rows = _rows(z, low, high)
    own, size = counts[rows], high - low
    height = z[rows] - 0.5 * (low + high)
    is_bar = BAR_M[0] <= size <= BAR_M[1]
    fits = bars_of(own, height, u, on_m) if is_bar else (plate_of(own.sum(axis=0), u),)
    upper = own[_rows(height, 0.5 * size - TOP_HEIGHT_M)]
    lower = own[_rows(height, -np.inf, 0.5 * size - 2.0 * TOP_HEIGHT_M)]
    at_top, below = (_share_off(part, u, fits[0].axis_m, on_m) for part in (upper, lower))
    chosen = min(fits, key=lambda fit: fit.cost)
    fold_m = fold_of(own, u)
    return Band(low, high, chosen.outline, chosen.axis_m, chosen.explained, at_top, fits, below, fold_m)


def _share_off(counts: FloatArray, u: FloatArray, axis_m: float, on_m: float) -> float:
    """Return the share of the points (heights, widths) that lie farther than `on_m` from an upright plane. [m]."""
    near, total = number_near(counts, u, np.full(len(counts), axis_m), on_m)
    return float((total - near) / max(total, 1.0))


def _edge_of_concrete(
    counts: FloatArray, band: Band, above_ground_m: float, on_m: float, foot: float
) -> float | None:
    """Return where across the top edge of a concrete barrier is [m], None where the band is not the face of one.

    That is one surface from the top edge to a foot before it, and a lid behind. The foot may be lower than the band,
    which ends where grass may grow: half of the rows that it is looked for in are above that. `foot` is the only side
    that it may stand on, 0 for either.
    """
    z, u = _centres(*counts.shape)
    foot_m = above_ground_m + band.low_m
    if foot_m > FENCE_FOOT_M or band.height_m < CONCRETE_M or band.top_share < MOST_TOP_SHARE:
        return None
    if _faced(_under_lid(counts, z, band), u, on_m) < fitted.LEAST_FACED:
        return None
    upper = middles_of_rows(counts[_rows(z, band.high_m - UNDER_TOP_M[1], band.high_m - UNDER_TOP_M[0])], u)
    lowest = OVER_GROUND_M - above_ground_m if foot_m < OVER_GRASS_M + CLEAR_UNDER_M[1] else band.low_m
    lower = middles_of_rows(counts[_rows(z, lowest, band.low_m + FOOT_HEIGHT_M)], u)
    if np.isnan(upper).all() or np.isnan(lower).all():
        return None
    edge = float(np.nanmedian(upper))
    before = float(np.nanmedian(lower)) - edge
    toe = counts[_rows(z, lowest, min(band.low_m, lowest) + FOOT_HEIGHT_M)]
    slopes = abs(before) >= SLOPE_BEFORE_M and toe.sum() >= DENSE_POINTS
    if slopes and _faced(toe, u, on_m) >= fitted.LEAST_FACED:
        # One surface down to there, which grass is not
        before = float(np.nanmedian(middles_of_rows(toe, u))) - edge
    is_on_side = before * foot >= 0.0 and -edge * np.sign(before) >= -on_m
    return edge if is_on_side and FOOT_BEFORE_M[0] <= abs(before) <= FOOT_BEFORE_M[1] else None


def _under_lid(counts: FloatArray, z: FloatArray, band: Band) -> FloatArray:
    """Return the points (rows, widths) of a band from 6 cm below its upper edge down: under a lid."""
    return counts[_rows(z, band.low_m, band.high_m - 2.0 * TOP_HEIGHT_M)]


def _faced(counts: FloatArray, u: FloatArray, on_m: float) -> float:
    """Return the share of the points that lie near the middle of those at their height: on one surface."""
    near, total = number_near(counts, u, middles_of_rows(counts, u), on_m)
    return float(near / max(total, 1.0))


def _form(bands: tuple[Band, ...], above_ground_m: float, noise_m: float, *, hangs: bool) -> SectionForm:
    """Return the form of which these beams, the highest first, are the section."""
    sure = tuple(band for band in bands if band.explained >= fitted.LEAST_EXPLAINED)
    if not bands or len(sure) < len(bands):
        return SectionForm("", "", bands, hangs=hangs)
    heights, n = [band.height_m for band in bands], len(bands)
    pitch = max((a.high_m - b.high_m for a, b in pairwise(bands)), default=0.0)
    foot = above_ground_m + bands[-1].low_m
    is_alone = all(above_ground_m + band.high_m <= FENCE_FOOT_M for band in bands[1:])
    hidden = foot if foot < OVER_GRASS_M + CLEAR_UNDER_M[1] else 0.0
    is_high = heights[0] + hidden >= FENCE_M[0] and heights[0] <= FENCE_M[1]
    is_low = is_alone and foot <= FENCE_FOOT_M and is_high
    is_mesh = is_low and bands[0].explained >= least_thin(noise_m) and bands[0].top_share < MOST_TOP_SHARE
    # A car or a wall may hide all of a fence but its upper half metre, which is flat
    are_beams = hangs and all(is_folded(band.fold_m) for band in bands)
    are_ropes = n > 1 and max(heights) <= ROPE_M and above_ground_m + bands[0].high_m <= HIGHEST_ROPE_M
    kind, form = "", ""
    if are_beams and W_BEAM_M[0] <= min(heights) and max(heights) <= W_BEAM_M[1]:
        kind, form = "guardrail", "w_beam"
    elif are_beams and n == 1 and THRIE_BEAM_M[0] <= heights[0] <= THRIE_BEAM_M[1]:
        kind, form = "guardrail", "thrie_beam"
    elif are_ropes and pitch <= ROPE_PITCH_M:
        kind, form = "guardrail", "cable_barrier"
    elif n > 1 and max(heights) <= HANDRAIL_M:
        kind, form = "fence", "tubes"
    elif _are_bars(bands):
        return form_of_bars(bands, [band.fits for band in bands], hangs=hangs)
    elif is_mesh:
        kind, form = "fence", "mesh"
    return SectionForm(kind, form, bands, hangs=hangs)


def _are_bars(bands: tuple[Band, ...]) -> bool:
    return all(BAR_M[0] <= band.height_m <= BAR_M[1] for band in bands)


def form_of_bars(
    bands: tuple[Band, ...], seen: Sequence[tuple[OutlineFit, ...]], *, hangs: bool
) -> SectionForm:
    """Return which outline explains bars, all by the same one: boards, pipes or square tubes.

    Parameters
    ----------
    bands
        The bars of a section.
    seen
        How outlines explain these and others of the same rail; only outlines that all of them tried are chosen.
    hangs
        Whether the lowest is clear of the grass, as pipes and tubes of rails are: what lies on the ground is a stone,
        a root or the edge of a bank.
    """
    costs = [{fit.outline: fit.cost for fit in fits} for fits in seen]
    shared = set.intersection(*(set(cost) for cost in costs))
    outline = min(sorted(shared), key=lambda name: sum(cost[name] for cost in costs))
    own = [next(fit for fit in band.fits if fit.outline == outline) for band in bands]
    bars = tuple(
        replace(band, outline=outline, axis_m=fit.axis_m, explained=fit.explained)
        for band, fit in zip(bands, own, strict=True)
    )
    if min(band.explained for band in bars) < fitted.LEAST_EXPLAINED:
        return SectionForm("", "", bars, hangs=hangs)
    kind, form = "guardrail", "box_beam" if outline == "box" and len(bars) == 1 else "tube"
    if outline == "flat":
        # A board alone may be anything
        kind, form = ("fence", "boards") if len(bars) > 1 else ("", "")
    elif not hangs:
        kind, form = "", ""
    return SectionForm(kind, form, bars, hangs=hangs)
