"""A survey with its stereo pairs and the pose of the vehicle at each of them."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.errors import InputError, MachineError, OutputExistsError
from linework.files.images.pair_check import PairCheck, check_pairs, images_checked
from linework.files.images.read import read_pair
from linework.files.output.publish import write_bytes
from linework.files.output.record import hash_file
from linework.imaging.rectify import Rectifier, rectifier_of
from linework.model.images import ImagePair, Poses, RectifiedPair, StereoSeries
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.poses import poses_at
from linework.processes.identity import identity_of
from linework.runs.opened.made import STORES, claim
from linework.runs.resume import source_hash

#: Longest time between two poses that are interpolated: a van that brakes at 3 m/s2 is then half a metre from the
#: interpolated position. [s]
POSE_HOLE_S = 1.0


@dataclass(frozen=True, slots=True)
class OpenedStereo:
    """The stereo pairs of a survey that have a pose.

    Parameters
    ----------
    series
        All pairs and the cameras.
    pairs
        Those with a pose, in time order.
    poses
        Pose i belongs to ``pairs[i]``.
    trajectory
        Path of the vehicle's origin.
    failures
        (left image, problem) of pairs that cannot be used, and of images without a partner.
    warnings
        One line each.
    """

    survey: Survey
    series: StereoSeries
    rectifier: Rectifier
    pairs: tuple[ImagePair, ...]
    poses: Poses
    trajectory: Trajectory
    failures: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def numbers(self) -> IntArray:
        """(n,) int64: numbers of the pairs."""
        return np.array([pair.number for pair in self.pairs], dtype=np.int64)

    def pair(self, number: int) -> RectifiedPair:
        """Read a pair and rectify it.

        Raises
        ------
        InputError
            One of its images cannot be read.
        """
        found = next((pair for pair in self.series.pairs if pair.number == number), None)
        if found is None:
            raise InputError(f"there is no pair {number}", where=self.survey.name)
        return rectified_pair(found, self.series, self.rectifier)

    def checked(self, work: Path) -> OpenedStereo:
        """Return the survey without pairs whose images do not belong together (see `check_pairs`).

        Parameters
        ----------
        work
            The work folder: what was found is kept there, as long as images, cameras and times stay the same.

        Raises
        ------
        InputError
            None belongs together.
        """
        where = self.survey.settings_file or self.survey.root
        check = _kept_check(work, self.series, lambda: check_pairs(self.series, self.rectifier, where=where))
        doubtful = set(check.doubtful)
        kept = [i for i, pair in enumerate(self.pairs) if pair.number not in doubtful]
        left_out = [pair for pair in self.pairs if pair.number in doubtful]
        problem = "its left and right images are not of one moment"
        return replace(
            self,
            pairs=tuple(self.pairs[i] for i in kept),
            poses=self.poses.take(kept),
            failures=(*self.failures, *((str(p.left), f"{p.left.name}: {problem}") for p in left_out)),
            warnings=(*self.warnings, *check.warnings),
        )

    def hashes(self) -> Mapping[Path, str]:
        """Return the SHA-256 of every image that can be read."""
        found = {}
        for pair in self.pairs:
            for path in (pair.left, pair.right):
                try:
                    found[path] = hash_file(path)
                except (InputError, OSError):
                    continue  # reported when the pair is looked at
        return found


def _kept_check(work: Path, series: StereoSeries, check: Callable[[], PairCheck]) -> PairCheck:
    """Return the check of a series as it was kept in the work folder, or make and keep it: it takes a second.

    Where nothing can be kept, it is made each time.
    """
    name = f"{STORES}/pairs-{_check_key(series)}.json"
    path = work / name
    with contextlib.suppress(OSError, ValueError, TypeError):
        kept = json.loads(path.read_bytes())
        return PairCheck(
            int(kept["n_looked_at"]),
            float(kept["error_px"]),
            tuple(kept["doubtful"]),
            tuple(kept["warnings"]),
        )
    found = check()
    with contextlib.suppress(MachineError, OutputExistsError):
        claim(work, name)
        write_bytes(json.dumps(asdict(found)).encode(), path, overwrite=True)
    return found


def _check_key(series: StereoSeries) -> str:
    """Return what the check depends on, hashed: the images looked at, cameras, times, and the code."""
    total = hashlib.sha256(source_hash("imaging", "files/images").encode())
    total.update(f"{identity_of(series.rig)} {series.pairs!r}".encode())
    for path in images_checked(series):
        # One that cannot be read is reported when it is used
        with contextlib.suppress(InputError, OSError):
            total.update(hash_file(path).encode())
    return total.hexdigest()[:16]


def rectified_pair(pair: ImagePair, series: StereoSeries, rectifier: Rectifier) -> RectifiedPair:
    """Read the images of a pair and rectify them.

    Raises
    ------
    InputError
        One of them cannot be read.
    """
    left, right = rectifier.rectified(*read_pair(pair, series.rig))
    return RectifiedPair(left, right, rectifier.rig, pair.number, pair.time_s)


def place_pairs(survey: Survey, series: StereoSeries, trajectory: Trajectory | None) -> OpenedStereo:
    """Return the pairs of a survey with their poses.

    Parameters
    ----------
    trajectory
        Path of the vehicle's origin, or None.

    Raises
    ------
    InputError
        Without a trajectory, without attitudes, or no pair lies within its times.
    """
    where = survey.trajectory_file or survey.name
    if trajectory is None:
        raise InputError("images but no trajectory: it is not known where they were taken", where=where,
                         advice="name one ([trajectory] file), or make one with linework locate")  # fmt: skip
    if trajectory.attitude_deg is None:
        raise InputError("has no attitude, which images need", where=where,
                         advice="add roll_deg, pitch_deg, heading_deg, or make it with linework locate")  # fmt: skip
    times = np.array([pair.time_s for pair in series.pairs])
    problems = _problems(times, trajectory.time_s)
    if all(problems):
        first, last = trajectory.time_s[[0, -1]]
        raise InputError(
            f"images from {times.min():.2f} to {times.max():.2f} s, trajectory from {first:.2f} to {last:.2f} s:"
            " no image has a pose", where=where, advice="check the epochs ([time] epoch)",
        )  # fmt: skip
    pairs = tuple(pair for pair, problem in zip(series.pairs, problems, strict=True) if not problem)
    return OpenedStereo(
        survey=survey,
        series=series,
        rectifier=rectifier_of(series.rig),
        pairs=pairs,
        poses=poses_at(trajectory, np.array([pair.time_s for pair in pairs])),
        trajectory=trajectory,
        failures=(
            *(
                (str(pair.left), f"{pair.left.name}: {problem}")
                for pair, problem in zip(series.pairs, problems, strict=True)
                if problem
            ),
            *(
                (str(path), f"{path.name}: in no pair, the other image is missing")
                for path in series.unpaired
            ),
            *((str(path), f"{path.name}: {reason}") for path, reason in series.left_out),
        ),
        warnings=series.warnings,
    )


def _problems(times: FloatArray, known: FloatArray) -> list[str]:
    """Return why the pose at each time is not known, "" if it is."""
    after = np.searchsorted(known, times, side="left")
    found = []
    for time, i in zip(times.tolist(), after.tolist(), strict=True):
        if i == len(known) or (i == 0 and time < known[0]):
            span = f"{known[0]:.2f} to {known[-1]:.2f} s"
            found.append(f"taken at {time:.2f} s, outside of the trajectory ({span})")
        elif i > 0 and known[i] != time and known[i] - known[i - 1] > POSE_HOLE_S:
            hole = f"{known[i - 1]:.2f} to {known[i]:.2f} s"
            found.append(f"taken at {time:.2f} s, in a hole of the trajectory ({hole})")
        else:
            found.append("")
    return found
