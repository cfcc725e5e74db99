"""Why lines were missed, and on what false ones lie: metres by cause, from the truth and the methods' own stages.

Missed and false stretches are taken every half metre. Each is given the first cause that fits, in the order of the
lists below: from what happened last (found, and thrown away) to what happened first (never seen).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray
from linework.evaluation.match import MAX_ANGLE_DEG
from linework.model.boxes import BoxForm, BoxSet
from linework.model.ground import Ground
from linework.model.lines import LineSet
from linework.model.points import Points

#: Distance of stretches along a line, and of the places on other lines that they are compared with. [m]
EVERY_M, DENSE_M = 0.5, 0.1
#: A line this near its truth was found there, if not well enough. [m]
OFF_M = 0.3
#: A box this near a line is a piece of it: boxes are right to about 2 cm, and tracks smooth them. [m]
BOX_M = 0.15
#: Paint and edges of another thing reach this far from its line: arrows 0.4 m, a kerb stone with its gutter 0.5 m.
THING_M = 0.5
#: A second edge beside a boundary (back of a gutter, foot of a verge) lies within this of it. [m]
SECOND_M = 2.0
#: Boxes that make a line: shorter pieces are left out by the method. [m]
SHORT_M = 1.5
#: Points this near the line of a cable lie on it [m], and this far they are clutter [m].
ON_CABLE_M, CLUTTER_M = 0.3, 1.5
#: Half the width of paint, with the scatter of the points [m]; points on 1.5 m that are too few to show a line.
ON_PAINT_M, FEW_POINTS = 0.15, 5
#: Windows along lines and along shorter paint in which it is compared with the road, half of each [m]; half the width of the narrowest line, less
#: the edge [m]; the road beside lines up to 0.3 m wide, from and to [m]; fewest points of each.
WINDOW_M, SHORT_WINDOW_M, ON_STRIPE_M, BESIDE_STRIPE_M, FEWEST_COMPARED = 2.0, 0.75, 0.04, (0.16, 0.46), 4
#: Offsets that are tried, as far as a reference may be off [m]; t-value below which paint does not stand out from its road.
STRIPE_OFFSETS_M, LEAST_STRIPE_T = (-0.06, -0.03, 0.0, 0.03, 0.06), 4.0
#: A cable needs points of this many scan lines to be more than what one beam hit.
FEW_SCAN_LINES = 3
_PAINT = ("lane_marking", "lane_marking_dash", "road_marking_other")
#: What `keep_consistent` drops, by kind.
THROWN_AWAY = {
    "lane_marking": "tracked, thrown away behind a boundary",
    "lane_marking_dash": "tracked, thrown away behind a boundary",
    "road_marking_other": "tracked, thrown away as a piece of a line or unsure",
}
_STANDING = ("guardrail", "barrier", "fence")


@dataclass(frozen=True)
class Places:
    """Places along lines or boxes: where, in which direction, and whether the sensors saw them."""

    xyz: FloatArray
    along: FloatArray
    observed: BoolArray

    def __len__(self) -> int:
        return len(self.xyz)

    def take(self, chosen: BoolArray) -> Places:
        return Places(self.xyz[chosen], self.along[chosen], self.observed[chosen])


@dataclass(frozen=True)
class Stages:
    """What the methods had in hand on the way: boxes, lines before they were judged, the ground, the points."""

    boxes: BoxSet
    tracked: LineSet
    ground: Ground
    points: Points
    scan_line_s: float
    #: The path of the vehicle, (n, 3) [m, world]; empty where there is none.
    path: FloatArray

    def of_forms(self, *forms: BoxForm) -> Places:
        chosen = np.isin(self.boxes.form, forms)
        u = self.boxes.u[chosen]
        along = np.column_stack([u, np.zeros(len(u))])
        return Places(self.boxes.centre[chosen], along, np.ones(len(u), dtype=np.bool_))


@dataclass(frozen=True)
class Cause:
    """So many metres of a kind, missed or false, for one reason."""

    kind: str
    failure: str
    cause: str
    metres: float


def places_of(lines: LineSet, every_m: float) -> Places:
    """Places in the middle of equal parts of each line."""
    xyz, along, observed = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0, dtype=np.bool_)]
    for i in range(len(lines)):
        part = slice(lines.offsets[i], lines.offsets[i + 1])
        line = lines.xyz[part]
        step = np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1)
        if len(line) < 2 or step.sum() <= 0.0:
            continue
        chainage = np.concatenate([[0.0], np.cumsum(step)])
        n = max(1, round(chainage[-1] / every_m))
        at = (np.arange(n) + 0.5) * chainage[-1] / n
        segment = np.clip(np.searchsorted(chainage, at, side="right") - 1, 0, len(step) - 1)
        way = np.diff(line, axis=0)[segment]
        xyz.append(np.column_stack([np.interp(at, chainage, column) for column in line.T]))
        along.append(way / np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None])
        seen = lines.observed[part]
        observed.append(seen[segment] & seen[segment + 1])
    return Places(np.concatenate(xyz), np.concatenate(along), np.concatenate(observed))


def is_near(
    places: Places, others: Places, within_m: float, *, n_dims: int = 2, any_direction: bool = False
) -> BoolArray:
    """Whether each place has another within a distance, by default of the same direction."""
    near = np.zeros(len(places), dtype=np.bool_)
    if not len(places) or not len(others):
        return near
    tree = cKDTree(others.xyz[:, :n_dims])
    # The places on a line are up to DENSE_M / 2 from the point of it that is nearest
    reach_m = float(np.hypot(within_m, 0.5 * DENSE_M))
    for i, found in enumerate(tree.query_ball_point(places.xyz[:, :n_dims], reach_m)):
        if found:
            cosine = np.abs(others.along[found, :2] @ places.along[i, :2])
            near[i] = any_direction or bool((cosine >= np.cos(np.radians(MAX_ANGLE_DEG))).any())
    return near


def of_kinds(lines: LineSet, *kinds: str) -> Places:
    return places_of(lines.take(np.isin(lines.kind, kinds)), DENSE_M)


def first_cause(causes: Sequence[tuple[str, BoolArray]], otherwise: str) -> list[str]:
    """Return for each place the first cause that holds."""
    if not causes:
        return []
    names = np.array([*[name for name, _ in causes], otherwise])
    held = np.stack([mask for _, mask in causes] + [np.ones_like(causes[0][1])])
    return names[np.argmax(held, axis=0)].tolist()


def failures(
    found: LineSet, truth: LineSet, stages: Stages, kinds: Sequence[str], tolerance_m: float
) -> list[Cause]:
    """Return the metres of every kind that were missed or are false, by cause."""
    causes: list[Cause] = []
    for kind in kinds:
        n_dims = 3 if kind == "cable" else 2
        own_truth, own_found = (lines.take(lines.kind == kind) for lines in (truth, found))
        true_places, found_places = places_of(own_truth, EVERY_M), places_of(own_found, EVERY_M)
        near = is_near(true_places, of_kinds(found, kind), tolerance_m, n_dims=n_dims)
        missed = true_places.take(true_places.observed & ~near)
        near = is_near(found_places, of_kinds(truth, kind), tolerance_m, n_dims=n_dims)
        false = found_places.take(~near)
        for failure, places, why in (
            ("missed", missed, missed_causes(kind, missed, found, truth, stages)),
            ("false", false, false_causes(kind, false, truth, stages)),
        ):
            assert len(why) == len(places)
            causes += [Cause(kind, failure, cause, EVERY_M * n) for cause, n in Counter(why).items()]
    return causes


def missed_causes(kind: str, missed: Places, found: LineSet, truth: LineSet, stages: Stages) -> list[str]:
    """Why true stretches of a kind were not found: a cause for each."""
    if not len(missed):
        return []
    n_dims = 3 if kind == "cable" else 2
    causes = [("found, but off", is_near(missed, of_kinds(found, kind), OFF_M, n_dims=n_dims))]
    if kind == "lane_marking_dash":
        causes.append(
            ("its line found, the dash not", is_near(missed, of_kinds(found, "lane_marking"), OFF_M))
        )
    # A dash is part of a lane marking, so that only other paint is another thing
    others = (
        ("lane_marking", "road_marking_other") if kind in _PAINT else _STANDING if kind in _STANDING else ()
    )
    causes += [
        (f"taken for {other}", is_near(missed, of_kinds(found, other), OFF_M))
        for other in others
        if other != kind
    ]
    if kind in _PAINT:
        short = places_of(truth.take((truth.kind == kind) & (lengths_m(truth) < SHORT_M)), DENSE_M)
        before = of_kinds(stages.tracked, kind)
        stripe, other = stages.of_forms(BoxForm.STRIPE), stages.of_forms(BoxForm.OTHER_PAINT)
        kerbs = of_kinds(stages.tracked.take(stages.tracked.form == "kerb"), "road_boundary")
        seen = is_near(missed, stripe, BOX_M)
        window_m = WINDOW_M if kind == "lane_marking" else SHORT_WINDOW_M
        t = stripe_ts(missed, stages, window_m)
        causes += [
            (THROWN_AWAY[kind], is_near(missed, before, OFF_M)),
            ("seen, thrown away beside a kerb", seen & is_near(missed, kerbs, THING_M)),
            ("seen, too short", seen & is_near(missed, short, DENSE_M)),
            ("seen, not linked", seen),
            ("seen as wide paint", is_near(missed, other, OFF_M, any_direction=True)),
            ("off what was taken for road", ~on_road(missed, stages.ground)),
            ("few points on it", (n_points_on(missed, stages, ON_PAINT_M) < FEW_POINTS) | np.isnan(t)),
            ("no brighter than the road beside it", t < LEAST_STRIPE_T),
        ]
        return first_cause(causes, "not seen as paint")
    if kind in ("road_boundary", "kerb_top"):
        boxes = stages.of_forms(BoxForm.KERB, BoxForm.EDGE, BoxForm.BARRIER)
        causes += [
            (
                "tracked, thrown away as bounding nothing",
                is_near(missed, of_kinds(stages.tracked, kind), OFF_M),
            ),
            ("seen, not linked", is_near(missed, boxes, OFF_M)),
            ("far from what was taken for road", ~near_road(missed, stages.ground)),
        ]
        return first_cause(causes, "not seen as an edge")
    if kind == "cable":
        causes.append(("few points on it", n_points_on(missed, stages, ON_CABLE_M) < FEW_POINTS))
        return first_cause(causes, "not found")
    causes.append(("far from what was taken for road", ~near_road(missed, stages.ground)))
    return first_cause(causes, "not found")


def false_causes(kind: str, false: Places, truth: LineSet, stages: Stages) -> list[str]:
    """On what false stretches of a kind lie: a cause for each."""
    if not len(false):
        return []
    n_dims = 3 if kind == "cable" else 2
    causes = [("beside its own truth, off", is_near(false, of_kinds(truth, kind), OFF_M, n_dims=n_dims))]
    if kind == "cable":
        return first_cause([*causes, *cable_causes(false, truth, stages)], "elsewhere")
    other_paint = [k for k in ("lane_marking", "road_marking_other") if k != kind]
    if kind in _PAINT:
        across = is_near(false, of_kinds(truth, "road_marking_other"), THING_M, any_direction=True)
        causes += [
            *[(f"on {other}", is_near(false, of_kinds(truth, other), OFF_M)) for other in other_paint],
            ("on an arrow, a bar or hatching", across),
            ("on a kerb or an edge", is_near(false, of_kinds(truth, "road_boundary", "kerb_top"), THING_M)),
        ]
    else:
        causes.append(("on paint", is_near(false, of_kinds(truth, *_PAINT), OFF_M)))
        if kind in ("road_boundary", "kerb_top"):
            edges = of_kinds(truth, "road_boundary", "kerb_top")
            causes.append(("on the other edge of a kerb", is_near(false, edges, OFF_M)))
    causes += [
        (f"on a {other}", is_near(false, of_kinds(truth, other), THING_M))
        for other in _STANDING
        if other != kind
    ]
    if kind in ("road_boundary", "kerb_top"):
        causes.append(("second edge beside a boundary", is_near(false, edges, SECOND_M)))
    causes += [
        ("beyond the edge of the carriageway", is_beyond_edge(false, truth, stages.path)),
        ("where no ground was measured", ~measured_ground(false, stages.ground)),
    ]
    return first_cause(causes, "elsewhere")


def cable_causes(false: Places, truth: LineSet, stages: Stages) -> list[tuple[str, BoolArray]]:
    """Causes of false cables: other wires beside it, a single scan line, clutter about it, no ground below."""
    tree = cKDTree(stages.points.xyz)
    few, clutter = np.zeros(len(false), dtype=np.bool_), np.zeros(len(false), dtype=np.bool_)
    time_s = stages.points.time_s
    for i, place in enumerate(false.xyz):
        about = np.array(tree.query_ball_point(place, CLUTTER_M), dtype=np.int64)
        away = stages.points.xyz[about] - place
        off = np.linalg.norm(away - np.outer(away @ false.along[i], false.along[i]), axis=1)
        on = about[off <= ON_CABLE_M]
        clutter[i] = len(about) > 2 * len(on)
        if time_s is not None and stages.scan_line_s > 0.0:
            few[i] = len(np.unique(np.floor(time_s[on] / stages.scan_line_s))) < FEW_SCAN_LINES
    beside = is_near(false, of_kinds(truth, "cable"), SECOND_M, n_dims=3)
    return [
        ("beside a wire", beside),
        ("over unknown ground", ~measured_ground(false, stages.ground)),
        ("in vegetation or clutter", clutter),
        ("on one or two scan lines", few),
    ]


def n_points_on(places: Places, stages: Stages, within_m: float) -> FloatArray:
    """Number of points within a distance of each stretch of 1.5 m."""
    tree = cKDTree(stages.points.xyz)
    found = tree.query_ball_point(places.xyz, 0.5 * SHORT_M)
    counts = []
    for i, near in enumerate(found):
        away = stages.points.xyz[near] - places.xyz[i]
        off = np.linalg.norm(away - np.outer(away @ places.along[i], places.along[i]), axis=1)
        counts.append(float((off <= within_m).sum()))
    return np.array(counts)


def stripe_ts(places: Places, stages: Stages, window_m: float) -> FloatArray:
    """How far the points on each place stand out from the road on both sides of it: direction known, offset nearly.

    NaN where there are too few points to compare.
    """
    t = np.full(len(places), np.nan)
    intensity = stages.points.intensity
    if intensity is None or not len(places):
        return t
    xyz = stages.points.xyz
    tree = cKDTree(xyz[:, :2])
    reach_m = float(np.hypot(window_m, BESIDE_STRIPE_M[1] + max(STRIPE_OFFSETS_M)))
    for i, near in enumerate(tree.query_ball_point(places.xyz[:, :2], reach_m)):
        away = xyz[near] - places.xyz[i]
        along = places.along[i, :2] / max(float(np.linalg.norm(places.along[i, :2])), 1e-12)
        inside = (np.abs(away[:, :2] @ along) <= window_m) & (np.abs(away[:, 2]) <= ON_PAINT_M)
        across = (away[:, 1] * along[0] - away[:, 0] * along[1])[inside]
        brightness = intensity[near][inside].astype(np.float64)
        t[i] = np.fmax.reduce([stripe_t(brightness, across - off) for off in STRIPE_OFFSETS_M])
    return t


def stripe_t(brightness: FloatArray, across: FloatArray) -> float:
    """Difference of the points (n,) on a line and those on its brighter side, over its standard deviation; NaN for few."""
    from_m, to_m = BESIDE_STRIPE_M
    on = brightness[np.abs(across) <= ON_STRIPE_M]
    sides = [brightness[(s * across >= from_m) & (s * across <= to_m)] for s in (1.0, -1.0)]
    if min(len(on), *map(len, sides)) < FEWEST_COMPARED:
        return np.nan
    return min(
        float((on.mean() - side.mean()) / max(np.sqrt(on.var() / len(on) + side.var() / len(side)), 1e-9))
        for side in sides
    )


def is_beyond_edge(places: Places, truth: LineSet, path: FloatArray) -> BoolArray:
    """Whether a true boundary of the road lies between each place and the path of the vehicle."""
    bounds = truth.take(truth.kind == "road_boundary")
    if not len(path) or not len(bounds) or not len(places):
        return np.zeros(len(places), dtype=np.bool_)
    _, nearest = cKDTree(path[:, :2]).query(places.xyz[:, :2])
    sights = shapely.linestrings(np.stack([places.xyz[:, :2], path[nearest, :2]], axis=1))
    edges = shapely.multilinestrings(
        [
            shapely.linestrings(bounds.xyz[a:b, :2])
            for a, b in zip(bounds.offsets[:-1], bounds.offsets[1:], strict=True)
        ]
    )
    shapely.prepare(edges)
    return np.asarray(shapely.intersects(edges, sights), dtype=np.bool_)


def lengths_m(lines: LineSet) -> FloatArray:
    """Length in plan of each line, (n,) [m]."""
    lengths = []
    for a, b in zip(lines.offsets[:-1], lines.offsets[1:], strict=True):
        lengths.append(float(np.linalg.norm(np.diff(lines.xyz[a:b, :2], axis=0), axis=1).sum()))
    return np.array(lengths)


def on_road(places: Places, ground: Ground) -> BoolArray:
    return _at(places, ground, ground.is_road, 0)


def near_road(places: Places, ground: Ground) -> BoolArray:
    """Whether road was measured within two cells: a boundary lies at its edge."""
    return _at(places, ground, ground.is_road, 2)


def measured_ground(places: Places, ground: Ground) -> BoolArray:
    """Whether road or ground was measured within two cells."""
    return _at(places, ground, ground.is_road | ground.is_ground, 2)


def _at(places: Places, ground: Ground, cells: BoolArray, reach: int) -> BoolArray:
    grid = ground.grid
    column = np.floor((places.xyz[:, 0] - grid.east_m) / grid.cell_width_m).astype(np.int64)
    row = np.floor((grid.north_m - places.xyz[:, 1]) / grid.cell_width_m).astype(np.int64)
    held = np.zeros(len(places), dtype=np.bool_)
    for i in range(-reach, reach + 1):
        for j in range(-reach, reach + 1):
            r, c = row + i, column + j
            inside = (r >= 0) & (r < cells.shape[0]) & (c >= 0) & (c < cells.shape[1])
            held[inside] |= cells[r[inside], c[inside]]
    return held
