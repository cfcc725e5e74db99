"""Picked places: the line that can be tracked from one, or why there is none and the nearest place with one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.obb.search_area import RADIUS_M, NoLineReason, SearchArea
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet

#: Largest distance of a place that is proposed instead. [m]
PROPOSE_M = 5.0
#: Shortest row of boxes that is a line: drain covers and patches are shorter. [m]
LEAST_PICKED_LINE_M = 2.0
#: Shortest row of bright boxes that is paint on a road for certain. [m]
LONG_PAINT_M = 10.0
#: Fewest points of a floor: three on each of its sides, and some strays.
LEAST_FLOOR_POINTS = 10
#: A place is judged from positions of the vehicle's path that are farther from it than the nearest one by at most this
#: [m]; number of them.
PATH_M, N_SIGHTS = 12.0, 9
#: Width behind a boundary without road, unless a marking shows one. [m]
BEHIND_M = 25.0
#: Distance to the left of a boundary at which there is road, beyond any gutter. [m]
ROAD_LEFT_M = 0.5
#: Widest gutter or patch in front of a kerb. [m]
PICK_GUTTER_M = 1.5
#: Boxes within this of a line, side by side with it, are the same feature. [m]
SAME_BOXES_M = 0.10


@dataclass(frozen=True, slots=True)
class PickSurroundings:
    """The lines around a place, tracked through boxes.

    Parameters
    ----------
    boxes
        The boxes found within about 20 m of the place.
    markings, boundaries
        (k,) int64 for each line of 2 m and more: its boxes; boundaries have the carriageway on their left.
    path
        (m, 2) float64 [m, from the survey's local origin]: the vehicle's path; (0, 2) if unknown.
    """

    boxes: BoxSet
    markings: list[IntArray]
    boundaries: list[IntArray]
    path: FloatArray

    @classmethod
    def of(
        cls, boxes: BoxSet, path: FloatArray | None = None, config: TrackConfig | None = None
    ) -> PickSurroundings:
        """Return the lines tracked through boxes, with the vehicle's path (m, 2 or 3) [m, local]."""
        config = config or TrackConfig()
        markings = _lines_through(boxes, np.flatnonzero(boxes.form == BoxForm.STRIPE), config)
        boundaries = _lines_through(boxes, np.flatnonzero(boxes.form >= BoxForm.KERB), config)
        return cls(boxes, markings, boundaries, np.zeros((0, 2)) if path is None else np.asarray(path)[:, :2])

    def nearest(self, place: FloatArray, wanted: str = "") -> tuple[int, float]:
        """Return the box of a trackable line nearest to a place (2,), and its distance [m]; -1, inf without one.

        Parameters
        ----------
        wanted
            "lane_marking", "road_boundary", or "" for both.
        """
        lines = list(self.markings) if wanted != "road_boundary" else []
        if wanted != "lane_marking":
            # Only those within reach are checked further
            near = [
                i for i, line in enumerate(self.boundaries) if self._nearest_of([line], place)[1] <= PROPOSE_M
            ]
            lines += [self.boundaries[i] for i in near if not self._is_behind(i)]
        box, distance_m = self._nearest_of(lines, place)
        return (box, distance_m) if distance_m <= PROPOSE_M else (-1, float("inf"))

    def bounds_road(self, place: FloatArray) -> bool:
        """Return whether the boundary nearest to a place (2,) ends a carriageway, not behind another boundary."""
        distance = [self._nearest_of([line], place)[1] for line in self.boundaries]
        return not distance or not self._is_behind(int(np.argmin(distance)))

    def on_carriageway(self, place: FloatArray) -> bool:
        """Return whether a place (2,) is on the carriageway's side of the boundaries.

        Along the lines of sight from several positions of the vehicle's path, the boundary last crossed before the
        place decides; without a path, the nearest boundary.
        """
        lines = [self.boxes.centre[line, :2] for line in self.boundaries]
        return self._in_front(np.asarray(place), lines, [0.0] * len(lines))

    def _nearest_of(self, lines: list[IntArray], place: FloatArray) -> tuple[int, float]:
        """Return the nearest box of lines and the distance [m] of its piece of line; -1 and inf without lines."""
        if not lines:
            return -1, float("inf")
        b, line = self.boxes, np.concatenate(lines)
        step = np.asarray(place) - b.centre[line, :2]
        along = np.clip(np.sum(step * b.u[line], axis=1), -b.half_u_m[line], b.half_u_m[line])
        distance = np.hypot(*(step - along[:, None] * b.u[line]).T)
        k = int(np.argmin(distance))
        return int(line[k]), float(distance[k])

    def _is_behind(self, i: int) -> bool:
        """Return whether boundary i stands behind another one: a wall at the back of a footway.

        Edges without a kerb do not hide a kerb close behind them: gutters and patches of asphalt lie in front of one.
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
        if len(self.path) == 0:
            return not _is_beyond_nearest(a, b, place, (least_m, within_m))
        beyond = _is_beyond_last(a, b, self._sights(place), place, (least_m, within_m))
        return bool(np.mean(beyond) <= 0.5)

    def _sights(self, place: FloatArray) -> FloatArray:
        """Return the positions (n, 2) of the path from which a place is judged: the nearest, and some around it."""
        distance = np.hypot(*(self.path - place).T)
        near = np.flatnonzero(distance <= distance.min() + PATH_M)
        return self.path[near[np.linspace(0, len(near) - 1, min(N_SIGHTS, len(near))).astype(np.int64)]]


def refusal_reason(
    xyz: FloatArray, place: FloatArray, found: PickSurroundings, *, wanted: str = "", is_road: bool = True
) -> NoLineReason | None:
    """Return why no line can be tracked from a place (2,) [m, local], or None if one can.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, from the survey's local origin]: points around the place, to 8 m and more.
    wanted
        "lane_marking", "road_boundary", or "" for either.
    is_road
        Whether the survey's surface has road at the place.
    """
    if found.nearest(place, wanted)[1] <= RADIUS_M:
        return None
    area = SearchArea.of(xyz, place)
    off_road = not (is_road and area.is_level() and found.on_carriageway(place))
    # An object beside a road hides half of its own search area: that is not a hole in the road
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
    """Return the nearest place (3,) [m, local] from which a line can be tracked, within `PROPOSE_M`, or None."""
    box, _ = found.nearest(place, wanted)
    return None if box < 0 else np.asarray(found.boxes.centre[box])


def _lines_through(boxes: BoxSet, index: IntArray, config: TrackConfig) -> list[IntArray]:
    """Return the boxes of each line that is long enough, in the direction of most of its boxes."""
    part = boxes.take(index)
    tracks = track_lines(part, config, width_m=SAME_BOXES_M)
    lines = []
    for i in range(len(tracks)):
        box, sense = tracks.line(i)
        if part.along(box)[-1] >= LEAST_PICKED_LINE_M:
            lines.append(index[box if sense.sum() >= 0 else box[::-1]])
    return lines


def _is_beyond_last(
    a: FloatArray, b: FloatArray, sights: FloatArray, place: FloatArray, limits_m: tuple[FloatArray, float]
) -> BoolArray:
    """Return for each position (s, 2) whether the place is right of the piece a-b (n, 2) last crossed before it.

    False where none is crossed, and where its distance from the piece is not within the limits.
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
    """Return whether the place is right of the nearest piece a-b (n, 2), at a distance within the limits."""
    step = b - a
    length = np.maximum(np.sum(step * step, axis=1), 1e-12)
    share = np.clip(np.sum((place - a) * step, axis=1) / length, 0.0, 1.0)
    distance = np.hypot(*(a + share[:, None] * step - place).T)
    k = int(np.argmin(distance))
    return bool(limits_m[0][k] < distance[k] <= limits_m[1] and _cross(step[k], place - a[k]) < 0.0)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the cross products of vectors in plan (..., 2)."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
