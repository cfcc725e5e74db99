"""What is at a picked place: a line that can be tracked, or why there is none and where the nearest one is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.obb.search_area import RADIUS_M, NoLineReason, SearchArea
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet

#: A line this near is proposed instead. [m]
PROPOSE_M = 5.0
#: A row of boxes that is shorter may be anything: a drain cover, a patch. [m]
LEAST_PICKED_LINE_M = 2.0
#: Nothing but paint on a road is bright in a row as long as this. [m]
LONG_PAINT_M = 10.0
#: Points that make a floor: three on each of its sides, and some strays.
LEAST_FLOOR_POINTS = 10
#: The van's way is looked from where it is farther from a place than at its nearest by no more than this. [m]
WAY_M, N_SIGHTS = 12.0, 9
#: Beyond a boundary there is no road as far as this, if no marking says that there is. [m]
BEHIND_M = 25.0
#: A boundary has road to its left, this far from it: beyond any gutter. [m]
ROAD_LEFT_M = 0.5
#: A gutter or a patch before a kerb is no wider than this. [m]
PICK_GUTTER_M = 1.5
#: Boxes this near a line, side by side with it, are the same feature. [m]
SAME_BOXES_M = 0.10


@dataclass(frozen=True, slots=True)
class PickSurroundings:
    """The lines about a place, as far as boxes show them.

    Parameters
    ----------
    boxes
        What the detectors found within 20 m or so of the place.
    markings, boundaries
        (k,) indices of the boxes of each line, 2 m long at least; boundaries have the carriageway on their
        left.
    way
        (m, 2) float64 [m, from the survey's local origin]: the van's way, or of no length.
    """

    boxes: BoxSet
    markings: list[IntArray]
    boundaries: list[IntArray]
    way: FloatArray

    @classmethod
    def of(
        cls, boxes: BoxSet, way: FloatArray | None = None, config: TrackConfig | None = None
    ) -> PickSurroundings:
        """Track the lines through the boxes."""
        config = config or TrackConfig()
        markings = _lines_through(boxes, np.flatnonzero(boxes.form == BoxForm.STRIPE), config)
        boundaries = _lines_through(boxes, np.flatnonzero(boxes.form >= BoxForm.KERB), config)
        return cls(boxes, markings, boundaries, np.zeros((0, 2)) if way is None else np.asarray(way)[:, :2])

    def nearest(self, place: FloatArray, wanted: str = "") -> tuple[int, float]:
        """Return the nearest box of a line that can be tracked, and its distance [m]; -1 and inf: none near.

        Parameters
        ----------
        wanted
            "lane_marking", "road_boundary", or "" for both.
        """
        lines = list(self.markings) if wanted != "road_boundary" else []
        if wanted != "lane_marking":
            # Those out of reach need no closer look
            near = [
                i for i, line in enumerate(self.boundaries) if self._nearest_of([line], place)[1] <= PROPOSE_M
            ]
            lines += [self.boundaries[i] for i in near if not self._is_behind(i)]
        box, distance_m = self._nearest_of(lines, place)
        return (box, distance_m) if distance_m <= PROPOSE_M else (-1, float("inf"))

    def bounds_road(self, place: FloatArray) -> bool:
        """Return whether the boundary at a place ends a carriageway, and does not stand behind another one."""
        distance = [self._nearest_of([line], place)[1] for line in self.boundaries]
        return not distance or not self._is_behind(int(np.argmin(distance)))

    def on_carriageway(self, place: FloatArray) -> bool:
        """Return whether a place is on the carriageway's side of the boundaries, as far as these tell.

        Seen from several places on the van's way: the boundary last crossed before the place decides. Without
        a way, the nearest boundary.
        """
        lines = [self.boxes.centre[line, :2] for line in self.boundaries]
        return self._in_front(np.asarray(place), lines, [0.0] * len(lines))

    def _nearest_of(self, lines: list[IntArray], place: FloatArray) -> tuple[int, float]:
        """Return the nearest box of some lines and the distance of the piece of line it stands for. [m]"""  # noqa: D400
        if not lines:
            return -1, float("inf")
        b, line = self.boxes, np.concatenate(lines)
        step = np.asarray(place) - b.centre[line, :2]
        along = np.clip(np.sum(step * b.u[line], axis=1), -b.half_u_m[line], b.half_u_m[line])
        distance = np.hypot(*(step - along[:, None] * b.u[line]).T)
        k = int(np.argmin(distance))
        return int(line[k]), float(distance[k])

    def _is_behind(self, i: int) -> bool:
        """Return whether a boundary stands behind another one: a wall at the back of a footway.

        Edges without a kerb hide no kerb that is near: gutters and patches of asphalt lie in front of one.
        """
        b = self.boxes
        others = [k for k in range(len(self.boundaries)) if k != i]
        lines = [b.centre[self.boundaries[k], :2] for k in others]
        from_m = [PICK_GUTTER_M if self._is_kerb(i) and not self._is_kerb(k) else 0.0 for k in others]
        some = self.boundaries[i][:: max(len(self.boundaries[i]) // 4, 1)]
        beside = b.centre[some, :2] + ROAD_LEFT_M * np.column_stack([-b.u[some, 1], b.u[some, 0]])
        return sum(self._in_front(place, lines, from_m) for place in beside) < 0.5 * len(beside)

    def _is_kerb(self, i: int) -> bool:
        return bool(np.mean(self.boxes.form[self.boundaries[i]] == BoxForm.KERB) > 0.5)

    def _in_front(self, place: FloatArray, lines: list[FloatArray], from_m: list[float]) -> bool:
        """Return whether a place is in front of boundaries (n, 2), on the side of the carriageway.

        from_m: places no farther behind a boundary than this are not hidden by it.
        """
        if not lines:
            return True
        a = np.concatenate([line[:-1] for line in lines])
        b = np.concatenate([line[1:] for line in lines])
        # A long marking that is nearer than the boundary is that of another carriageway
        long = [line for line in self.markings if self.boxes.along(line)[-1] >= LONG_PAINT_M]
        within_m = min(BEHIND_M, self._nearest_of(long, place)[1])
        least_m = np.repeat(from_m, [len(line) - 1 for line in lines])
        if len(self.way) == 0:
            return not _is_beyond_nearest(a, b, place, (least_m, within_m))
        beyond = _is_beyond_last(a, b, self._sights(place), place, (least_m, within_m))
        return bool(np.mean(beyond) <= 0.5)

    def _sights(self, place: FloatArray) -> FloatArray:
        """Return places (n, 2) on the van's way from which to look at a place: the nearest, and some about it."""
        distance = np.hypot(*(self.way - place).T)
        near = np.flatnonzero(distance <= distance.min() + WAY_M)
        return self.way[near[np.linspace(0, len(near) - 1, min(N_SIGHTS, len(near))).astype(np.int64)]]


def refusal_reason(
    xyz: FloatArray, place: FloatArray, found: PickSurroundings, *, wanted: str = "", is_road: bool = True
) -> NoLineReason | None:
    """Return why no line can be tracked from a place, or None where one can.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, from the survey's local origin]: points about the place, 8 m and more.
    wanted
        "lane_marking", "road_boundary", or "" for either.
    is_road
        Whether the survey's surface has road at the place.
    """
    if found.nearest(place, wanted)[1] <= RADIUS_M:
        return None
    area = SearchArea.of(xyz, place)
    off_road = not (is_road and area.is_level() and found.on_carriageway(place))
    # What stands beside a road hides half of its own search area: that is no hole in the road
    if off_road and len(area.xyz) >= LEAST_FLOOR_POINTS:
        return NoLineReason.NO_ROAD
    lost = area.lost_data()
    if lost is not None:
        return lost
    if off_road:
        return NoLineReason.NO_ROAD
    return NoLineReason.NO_MARKING if wanted == "lane_marking" else NoLineReason.ALL_ROAD


def nearest_trackable_place(
    place: FloatArray, found: PickSurroundings, wanted: str = ""
) -> FloatArray | None:
    """Return the nearest place (3,) from which a line can be tracked, within `PROPOSE_M`, or None."""
    box, _ = found.nearest(place, wanted)
    return None if box < 0 else np.asarray(found.boxes.centre[box])


def _lines_through(boxes: BoxSet, index: IntArray, config: TrackConfig) -> list[IntArray]:
    """Return the boxes of each line that is long enough, in the direction of most of them."""
    part = boxes.take(index)
    tracks = track_lines(part, config, width_m=SAME_BOXES_M)
    lines = []
    for i in range(len(tracks)):
        box, way = tracks.line(i)
        if part.along(box)[-1] >= LEAST_PICKED_LINE_M:
            lines.append(index[box if way.sum() >= 0 else box[::-1]])
    return lines


def _is_beyond_last(
    a: FloatArray, b: FloatArray, sights: FloatArray, place: FloatArray, limits_m: tuple[FloatArray, float]
) -> BoolArray:
    """Return for each sight (s, 2) whether the place is right of the piece a-b (n, 2) last crossed before it.

    False where none is crossed, and nearer or farther beyond than the limits, square to the piece.
    """
    start = sights[:, None]
    side = _cross(b - a, place - a)
    to_a, to_b = _cross(place - start, a - start), _cross(place - start, b - start)
    crossed = (_cross(b - a, start - a) * side < 0.0) & (to_a * to_b < 0.0)
    share = np.abs(to_a) / np.maximum(np.abs(to_a) + np.abs(to_b), 1e-12)
    at = a + share[..., None] * (b - a) - place
    left_m = np.where(crossed, np.hypot(at[..., 0], at[..., 1]), np.inf)
    last = np.argmin(left_m, axis=1)
    beyond_m = -side / np.maximum(np.hypot(*(b - a).T), 1e-12)
    is_beyond = (beyond_m > limits_m[0]) & (beyond_m <= limits_m[1])
    return np.asarray(crossed.any(axis=1) & is_beyond[last])


def _is_beyond_nearest(
    a: FloatArray, b: FloatArray, place: FloatArray, limits_m: tuple[FloatArray, float]
) -> bool:
    """Return whether the place is right of the nearest piece a-b (n, 2), and within the limits from it."""
    step = b - a
    length = np.maximum(np.sum(step * step, axis=1), 1e-12)
    share = np.clip(np.sum((place - a) * step, axis=1) / length, 0.0, 1.0)
    distance = np.hypot(*(a + share[:, None] * step - place).T)
    k = int(np.argmin(distance))
    return bool(limits_m[0][k] < distance[k] <= limits_m[1] and _cross(step[k], place - a[k]) < 0.0)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
