"""The stereo pairs of a survey as they arrive: lists of images that grow, paired by time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.errors import ConfigError
from linework.files.live.growing import GrowingTable
from linework.files.logs.tables import finite_number
from linework.files.outside import check_files_inside
from linework.imaging.pairing import pair_by_time
from linework.model.images import ImagePair
from linework.model.survey import Survey

_SIDES = ("left", "right")
#: Time for which an image waits for that of the other camera. [s]
PARTNER_S = 10.0


@dataclass(slots=True)
class _Listed:
    """An image that a list names: its row, when it was read [s, monotonic], and whether it has a partner."""

    number: int
    time_s: float
    path: Path
    arrived_s: float
    is_paired: bool = False


@dataclass(frozen=True, slots=True)
class NewPairs:
    """Pairs that arrived, in time order; images that waited in vain for their partner; and the number of bad lines."""

    pairs: tuple[ImagePair, ...] = ()
    alone: tuple[Path, ...] = ()
    n_bad: int = 0


class GrowingPairs:
    """The pairs of the lists that [cameras] names, each given once, whatever the order of the lines.

    Raises
    ------
    ConfigError
        A camera names its images by a pattern, not by a list.
    """

    def __init__(self, survey: Survey) -> None:
        cameras: Mapping[str, Any] = survey.settings["cameras"]
        self._where = survey.settings_file or survey.root
        self._allow_outside = survey.allow_outside or survey.settings_file is None
        self._tables: dict[str, GrowingTable] = {}
        self._offset_s = {side: float(cameras[side].get("time_offset_s", 0.0)) for side in _SIDES}
        for side in _SIDES:
            images = str(cameras[side]["images"])
            if not images.lower().endswith((".csv", ".txt")):
                raise ConfigError(
                    f"cameras.{side}.images is a pattern: while the folder is filled, images need a list",
                    where=self._where, advice='name a CSV file with the columns file,time_s: images = "left.csv"',
                )  # fmt: skip
            self._tables[side] = GrowingTable(survey.root / images, ("file", "time_s"))
        self._recent: dict[str, list[_Listed]] = {side: [] for side in _SIDES}

    def arrived(self, now_s: float) -> NewPairs:
        """Return the pairs that are listed since the last call.

        Parameters
        ----------
        now_s
            Time of this machine. [s, monotonic]

        Raises
        ------
        InputError, ConfigError
            A list has other columns, or names images outside the folder of the survey.
        """
        n_bad = sum(self._read(side, now_s) for side in _SIDES)
        left, right = (self._recent[side] for side in _SIDES)
        found = pair_by_time(*(np.array([image.time_s for image in side]) for side in (left, right)))
        pairs = []
        for i, j in zip(found.left.tolist(), found.right.tolist(), strict=True):
            if not (left[i].is_paired or right[j].is_paired):
                left[i].is_paired = right[j].is_paired = True
                pairs.append(ImagePair(left[i].number, left[i].time_s, left[i].path, right[j].path))
        return NewPairs(tuple(pairs), self._given_up(now_s), n_bad)

    def _read(self, side: str, now_s: float) -> int:
        """Take in the new lines of a list in time order; return how many hold something else."""
        table, recent = self._tables[side], self._recent[side]
        new = table.rows()
        if not len(new) and not new.n_bad:
            return 0
        known, n_bad, paths = {image.time_s for image in recent}, new.n_bad, []
        for number, file, text in zip(new.numbers, *(new.columns[name] for name in table.names), strict=True):
            listed_s = finite_number(text)
            time_s = None if listed_s is None else listed_s + self._offset_s[side]
            if not file or time_s is None or time_s in known:
                n_bad += 1
                continue
            known.add(time_s)
            paths.append(table.path.parent / file.replace("\\", "/"))
            recent.append(_Listed(number, time_s, paths[-1], now_s))
        if not self._allow_outside:
            check_files_inside(paths, f"cameras.{side}.images", self._where)
        recent.sort(key=lambda image: image.time_s)
        return n_bad

    def _given_up(self, now_s: float) -> tuple[Path, ...]:
        """Forget the images that were listed some time ago, and return those of them without a partner."""
        alone = []
        for side in _SIDES:
            old = [image for image in self._recent[side] if image.arrived_s < now_s - PARTNER_S]
            alone += [image.path for image in old if not image.is_paired]
            self._recent[side] = [i for i in self._recent[side] if i.arrived_s >= now_s - PARTNER_S]
        return tuple(alone)
