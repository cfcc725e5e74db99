"""One line from one pixel picked in an image of a survey."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray
from linework.errors import AbsentError, InputError, RefusedPickError, UsageError, argument
from linework.imaging.rectify import original_pixels, rectified_pixels
from linework.methods.picked_edge.method import (
    EDGE_KINDS,
    SIDES,
    EdgeStep,
    NoEdgeAtPixelError,
    PickedEdge,
    PosedPairs,
    follow_picked,
)
from linework.model.images import ImagePair
from linework.model.lines import LineSet
from linework.runs.opened.pairs import OpenedStereo

#: Pairs that are kept in memory: following back from the picked pair starts with those just read. [pairs]
_KEPT_PAIRS = 4


@dataclass(frozen=True, slots=True)
class TracedEdge:
    """A followed edge in the survey's CRS, the reasons why it ends, and the number of pairs that show it."""

    kind: str
    lines: LineSet
    stops: tuple[str, str]
    n_pairs: int
    warnings: tuple[str, ...] = ()


class ImageTracer:
    """Follows edges that are picked in the images of a survey."""

    def __init__(self, opened: OpenedStereo) -> None:
        self._opened = opened
        self._drive = PosedPairs(lru_cache(_KEPT_PAIRS)(opened.pair), opened.numbers.tolist(), opened.poses)

    def trace(
        self, image: Path, at_px: tuple[float, float], *, kind: str = ""
    ) -> Generator[EdgeStep, bool | None, TracedEdge]:
        """Follow the edge at a pixel (col, row) of an original image; yield the step of each pair.

        Parameters
        ----------
        image
            File of the survey, or the end of its path.
        kind
            Kind of line; "": stripes of paint are lane markings, other edges road boundaries.

        Raises
        ------
        UsageError
            The kind cannot be picked, or the pixel is outside of the image.
        InputError
            The image is not in the survey, or there is no edge at the pixel: why, and where the nearest one is.
        """
        return (yield from self.trace_pair(*self._found(image), at_px, kind=kind))

    def trace_pair(
        self, pair: ImagePair, side: int, at_px: tuple[float, float], *, kind: str = ""
    ) -> Generator[EdgeStep, bool | None, TracedEdge]:
        """Follow as `trace` does, from the left (0) or the right (1) image of a pair."""
        if kind not in ("", *EDGE_KINDS):
            raise UsageError(f"{kind} cannot be picked in images", where=argument("kind"),
                             advice=f"choose from {','.join(EDGE_KINDS)}")  # fmt: skip
        rig = self._opened.series.rig
        camera = (rig.left, rig.right)[side]
        col, row = at_px
        name = (pair.left, pair.right)[side].name
        if not (0 <= col <= camera.width - 1 and 0 <= row <= camera.height - 1):
            raise UsageError(f"pixel {col:g},{row:g} is outside of the image", where=name,
                             advice=f"columns are 0 to {camera.width - 1}, rows 0 to {camera.height - 1}")  # fmt: skip
        pixel = rectified_pixels(camera, self._opened.rectifier.rig, np.array([at_px]))[0]
        if not np.isfinite(pixel).all():
            raise InputError(f"the calibration does not reach {col:g},{row:g}", where=name,
                             advice="pick nearer to the middle of the image")  # fmt: skip
        try:
            steps = follow_picked(
                self._drive, (pair.number, float(pixel[0]), float(pixel[1])), side=SIDES[side], kind=kind
            )
            edge = yield from steps
        except NoEdgeAtPixelError as refused:
            raise self._in_original(refused, side, at_px, name) from refused
        return self._traced(edge)

    def pair(self, number: int) -> ImagePair:
        """Return the usable pair of a number.

        Raises
        ------
        AbsentError
            No usable pair has this number.
        """
        for pair in self._opened.pairs:
            if pair.number == number:
                return pair
        raise AbsentError(f"there is no pair {number}", where=self._opened.survey.name)

    def original(self, step: EdgeStep) -> tuple[FloatArray, FloatArray]:
        """Return the pixels (n, 2) [col, row] of a step in the left and the right original image."""
        rig, to = self._opened.series.rig, self._opened.rectifier.rig
        left, right = step.left_px, step.right_px
        return original_pixels(rig.left, to, left), original_pixels(rig.right, to, right)

    def _found(self, image: Path) -> tuple[ImagePair, int]:
        """Return the pair that an image belongs to, and its side: left (0) or right (1)."""
        parts = image.parts[1:] if image.is_absolute() else image.parts
        matches = [
            (pair, side)
            for pair in self._opened.pairs
            for side, path in enumerate((pair.left, pair.right))
            if path.parts[-len(parts) :] == parts or path.resolve() == image.resolve()
        ]
        if len(matches) == 1:
            return matches[0]
        where, n = self._opened.survey.name, len(self._opened.pairs)
        for path, problem in self._opened.failures:
            if Path(path).parts[-len(parts) :] == parts:
                raise InputError(f"cannot be used: {problem}", where=image, advice="pick in another image")
        if matches:
            pair, side = matches[0]
            example = "/".join((pair.left, pair.right)[side].parts[-2:])
            raise InputError(f"{image} could be {len(matches)} images", where=where,
                             advice=f"name its folder too, for example {example}")  # fmt: skip
        first = "/".join(self._opened.pairs[0].left.parts[-2:])
        raise InputError(f"{image} is in none of the {n} usable stereo pairs", where=where,
                         advice=f"see linework info; the first one is {first}")  # fmt: skip

    def _in_original(
        self, refused: NoEdgeAtPixelError, side: int, at_px: tuple[float, float], name: str
    ) -> RefusedPickError:
        """Return a refusal in pixels of the original image."""
        advice, there = "pick a pixel on a line", None
        if refused.works is not None:
            rig = self._opened.series.rig
            camera = (rig.left, rig.right)[side]
            col, row = original_pixels(camera, self._opened.rectifier.rig, np.array([refused.works], float))[
                0
            ]
            away = float(np.hypot(col - at_px[0], row - at_px[1]))
            advice = f"the nearest line is {away:.0f} pixels away, pick {col:.0f},{row:.0f}"
            there = float(col), float(row)
        at = f"at {at_px[0]:g},{at_px[1]:g}"
        return RefusedPickError(refused.reason, at, where=name, advice=advice, works=there)

    def _traced(self, edge: PickedEdge) -> TracedEdge:
        opened, numbers = self._opened, sorted(edge.pixels)
        names = {pair.number: pair.left.name for pair in opened.pairs}
        ends = (names[numbers[0]], names[numbers[-1]])
        source = ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"
        lines = edge.lines.with_columns(crs=opened.survey.crs, source=np.array([source]))
        stops = (str(edge.stops[0]), str(edge.stops[1]))
        return TracedEdge(edge.kind, lines, stops, len(numbers), edge.failures)


def pixel_of(text: str) -> FloatArray:
    """Return (2,) column and row of "COL,ROW".

    Raises
    ------
    UsageError
        The text is not a pixel.

    >>> pixel_of("612,240.5").tolist()
    [612.0, 240.5]
    """
    try:
        col, row = (float(part) for part in text.split(","))
    except ValueError:
        col = row = float("nan")
    if not (np.isfinite(col) and np.isfinite(row)):
        raise UsageError(
            f"{text!r} is not a pixel",
            where=argument("at_px"),
            advice="give column and row, for example 612,240",
        )
    return np.array([col, row])
