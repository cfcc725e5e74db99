"""The stereo method on a page: lane markings in stereo pairs, joined into long lines.

G. He, K. Novak (1992): Automatic analysis of highway features from digital stereo-images, ISPRS XXIX B3, 119-124.
docs/methods/stereo.md names what goes beyond the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from linework.arrays import BoolArray, FloatArray, offsets_of
from linework.methods.protocol import Recording, StepResult, SurveyContext
from linework.methods.stereo.pieces import coverage_test, fused_boxes, pieces_of
from linework.methods.stereo.road_plane import fit_pair_road
from linework.methods.stereo.sighted import sightings_of
from linework.methods.stereo.stripes import StripeConfig, find_stripe_lines
from linework.methods.tracking import marking_lines
from linework.methods.tracking.arrangement import is_double, roles
from linework.methods.tracking.guides import by_length, drop_unlikely_pieces, join_along
from linework.methods.tracking.neighbours import LineAxis, axes_of_path
from linework.methods.tracking.track import TrackConfig, Tracks, track_lines
from linework.model.images import RectifiedPair
from linework.model.lines import LineSet
from linework.model.settings import Settings, group
from linework.model.sightings import Sightings
from linework.model.tile import local_origin

STEREO_KINDS = ("lane_marking", "lane_marking_dash")
#: Places this near a line, side by side with it, are on the same paint. [m]
SAME_PAINT_PLACES_M = 0.10
#: Least mean score of the places of a line, as paint that mostly single pairs show is not there; the same for a long
#: line, as chance makes short ones; and the sum of scores from which a line is long. [1]
LEAST_STEREO_SCORE, LEAST_OF_LONG, LONG = 0.45, 0.38, 20.0
#: Least score of a place, as a share of the median score of its line: far pairs smear the ends of dashes. [1]
WEAK = 0.5
#: A line of paint has one width: places that differ from it by more than this share [1] and the scatter of edges [m]
#: are on an arrow, a crossing or something else that is bright.
OTHER_WIDTH, EDGES_M = 0.5, 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class StereoConfig(Settings):
    """Settings of the stereo method, each step's own in a group."""

    stripes: StripeConfig = group(StripeConfig)
    track: TrackConfig = group(TrackConfig)


@dataclass(frozen=True, slots=True)
class Stereo:
    """Lane markings in stereo pairs."""

    recording: ClassVar[Recording] = "pairs"
    evidence: ClassVar[type[Sightings]] = Sightings
    carry: ClassVar[tuple[str, ...]] = ()
    #: A pair is looked at by itself, and all of it.
    buffer_m: ClassVar[float] = 0.0
    least_height_m: ClassVar[float] = -math.inf
    config: StereoConfig = field(default_factory=StereoConfig)
    kinds: tuple[str, ...] = STEREO_KINDS
    name: str = "stereo"

    def look(self, piece: RectifiedPair) -> Sightings:
        """Return the places on lane markings that a pair shows, in the vehicle frame at its time."""
        *_, (_, found) = self.steps(piece)
        sightings: Sightings = found
        return sightings

    def steps(self, pair: RectifiedPair) -> Iterator[StepResult]:
        """Yield name and result of each step that leads from a stereo pair to places on lines.

        Parameters
        ----------
        pair
            Rectified, see `linework.imaging.rectify.Rectifier`.

        Yields
        ------
        name, result
            ``road`` (`RoadShape`, None where the pair shows no road, which ends the steps), ``matched lines``
            (`StripeLines`: bright stripes of each row, linked from near to far and matched in the right image) and
            ``sightings`` (`Sightings`: those that are paint on the road, intersected, in the vehicle frame). Lines
            are made of the sightings of all pairs, by `join`.

        References
        ----------
        G. He, K. Novak (1992): Automatic analysis of highway features from digital stereo-images, sections 3.1
        to 3.3.
        """
        c = self.config
        # The road's surface, from the pair itself
        road = fit_pair_road(pair)
        yield "road", road
        if road is None:
            yield "sightings", Sightings.empty()
            return
        # Bright lines in both images, row by row, followed from near to far, and matched along the rows
        lines = find_stripe_lines(pair, road, c.stripes)
        yield "matched lines", lines
        # Those that are paint on the road, intersected
        yield "sightings", sightings_of(pair, road, lines, c.stripes)

    def join(self, found: Sightings, survey: SurveyContext) -> LineSet:
        """Return the lines through the sightings of all pairs, in world coordinates.

        Parameters
        ----------
        found
            Of all pairs, in any order of the pairs.
        survey
            With the poses of the pairs and their geometry.
        """
        if len(found) == 0:
            return LineSet.empty()
        poses, rig, numbers = survey.poses, survey.rig, survey.pair_numbers
        assert poses is not None and rig is not None, "sightings are joined by the poses of their pairs"
        origin = np.array(local_origin(*poses.xyz.min(axis=0).tolist()))
        pose = found.pair if numbers is None else np.searchsorted(numbers, found.pair)
        # Pieces of lines of all pairs in the world; sightings of one place are averaged, weighted by covariance
        pieces = pieces_of(found, poses, rig, np.asarray(pose), origin)
        boxes = fused_boxes(pieces, poses, rig, origin)
        boxes = boxes.take(np.lexsort((boxes.centre[:, 1], boxes.centre[:, 0])))
        is_visible = coverage_test(pieces, poses, rig, origin)
        # Places that continue each other are joined into lines, over gaps; dashed ones by their rhythm
        path = axes_of_path(poses.xyz - origin) if len(poses) > 1 else []
        tracks = drop_unlikely_pieces(
            track_lines(boxes, self.config.track, width_m=SAME_PAINT_PLACES_M, least_boxes=1), boxes.score
        )
        whole, *_ = marking_lines.marking_lines(boxes, tracks.with_boxes(3), is_visible)
        guides = [*(LineAxis.of(m.line.t_m, m.line.xyz) for m in whole), *path]
        tracks = join_along(boxes, tracks, by_length(guides), self.config.track.longest_gap_m)
        tracks = _without_weak(_of_one_width(tracks, 2.0 * boxes.half_v_m), boxes.score).with_boxes(3)
        markings, *_ = marking_lines.marking_lines(boxes, tracks, is_visible)
        markings = [m for m in markings if _is_sure(boxes.score[m.boxes])]
        # Edge, lane and centre lines by how they lie to one another
        axes = [LineAxis.of(m.line.t_m, m.line.xyz) for m in markings]
        double = is_double(axes)
        names = roles(axes, [], path, double)
        lines = LineSet.concatenate([
            marking_lines.marking_line_set(markings, "lane_marking").with_columns(
                double=double, role=np.array(names, dtype=np.str_)
            ),
            marking_lines.dash_lines(markings, names),
        ])  # fmt: skip
        lines = lines.take(np.isin(lines.kind, self.kinds))
        return lines.with_columns(
            xyz=lines.xyz + origin, method=np.array([self.name] * len(lines), dtype=np.str_)
        )


def _without_weak(tracks: Tracks, score: FloatArray) -> Tracks:
    """Return the tracks without places that far fewer pairs show than others of the line, as beyond ends of dashes."""
    return _kept(tracks, score[tracks.box] >= WEAK * _typical(tracks, score))


def _of_one_width(tracks: Tracks, width_m: FloatArray) -> Tracks:
    """Return the tracks without places that are much wider or narrower than others of the line."""
    typical = _typical(tracks, width_m)
    return _kept(tracks, np.abs(width_m[tracks.box] - typical) <= OTHER_WIDTH * typical + EDGES_M)


def _typical(tracks: Tracks, value: FloatArray) -> FloatArray:
    """Return for each place of the tracks (n,) the median value of the places of its line."""
    medians = [float(np.median(value[tracks.line(i)[0]])) for i in range(len(tracks))]
    return np.repeat(np.array(medians), np.diff(tracks.offsets))


def _kept(tracks: Tracks, kept: BoolArray) -> Tracks:
    """Return the tracks with the chosen places (n,) only."""
    owner = np.repeat(np.arange(len(tracks)), np.diff(tracks.offsets))
    n = np.bincount(owner[kept], minlength=len(tracks))
    return Tracks(tracks.box[kept], tracks.sense[kept], offsets_of(n))


def _is_sure(score: FloatArray) -> bool:
    """Return whether enough pairs show the places of a line, by their scores."""
    mean = float(np.mean(score))
    return mean >= LEAST_STEREO_SCORE or (mean >= LEAST_OF_LONG and float(np.sum(score)) >= LONG)
