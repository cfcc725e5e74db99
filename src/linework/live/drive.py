"""A drive that is followed: what arrives is looked at, placed, joined into lines, kept and written, again and again."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from linework.errors import ConfigError, InputError, LineworkError, MachineError
from linework.files.images.series import rig_of
from linework.files.live.events import EventsFile
from linework.files.live.images import GrowingPairs, NewPairs
from linework.files.live.logs import GrowingLogs, NewReadings, SurveyClock
from linework.files.survey.toml import check_cameras
from linework.imaging.rectify import rectifier_of
from linework.live.kept import FAILED, FILE_M, LOOKED, NO_POSITION, SKIPPED, KeptDrive, Placed
from linework.live.keys import Operator, events_path, keys_of
from linework.live.notices import Notices, SkipNotices
from linework.live.queue import PairQueue
from linework.live.status import LiveStatus, live_summary
from linework.live.stretches import AHEAD_M, PlacedPair, Stretches
from linework.live.written import write_drive
from linework.methods.stereo.method import Stereo
from linework.model.images import ImagePair, StereoSeries
from linework.model.sightings import Sightings
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.navigation.chainage import Odometer, places_at
from linework.navigation.forward import LATE_S, ForwardFilter
from linework.navigation.poses import poses_at
from linework.runs.opened.pairs import POSE_HOLE_S, rectified_pair

T = TypeVar("T")
#: Time between two advances of the filter: poses are certain two seconds later in any case. [s]
_ADVANCE_S = 0.25
#: Time between two writes of the journal: what a cut of the power may lose. [s]
_SAVE_S = 0.5
#: Least time between two outputs [s], and how many times longer than writing one it is: a tenth of the time at most.
_WRITE_S, _WRITE_SHARE = 5.0, 10.0
#: Time without anything new from which a log, or the cameras, are reported to have stopped. [s]
_SILENT_S = 3.0
#: Poses that are kept for pairs and presses that come late: as long as an image is waited for, and as much again. [s]
_POSES_S = 30.0
#: Time over which the rate of pairs is counted. [s]
_RATE_S = 10.0


@dataclass(slots=True)
class _Looked:
    """A pair that was looked at, or skipped, and waits for its pose since a time of this machine [s]."""

    pair: ImagePair
    state: str
    sightings: Sightings | None
    since_s: float


@dataclass(slots=True)
class _Last:
    """When something was done last. [s, monotonic]."""

    advanced_s: float = -np.inf
    saved_s: float = -np.inf
    written_s: float = -np.inf
    write_took_s: float = 0.0
    saved_pairs: int = 0
    new_s: dict[str, float] = field(default_factory=dict)


class LiveDrive:
    """A survey that is followed.

    Parameters
    ----------
    survey
        With [cameras] and [navigation]; its files may be missing still.
    output
        File of the lines.
    kept
        What is kept of the drive.
    longest_lag_s
        A pair that is older than the newest by more is skipped. [s]
    report
        Called with one line for each trouble, and for its end.
    monotonic
        The clock of this machine. [s]

    Raises
    ------
    ConfigError
        The survey has no cameras, no list of images, no logs, or a calibration that is impossible.
    InputError
        A log or the file of events has other columns.
    """

    def __init__(
        self,
        survey: Survey,
        output: Path,
        kept: KeptDrive,
        *,
        longest_lag_s: float,
        report: Callable[[str], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        cameras = survey.settings.get("cameras")
        where = survey.settings_file or survey.root
        if not cameras:
            raise ConfigError("no [cameras]: there is nothing to look at while driving", where=where,
                              advice="add [cameras.left] and [cameras.right]; points are for linework extract")  # fmt: skip
        check_cameras(cameras, where)
        rig = rig_of(cameras, where)
        self.survey, self.output = survey, output
        self.notices = Notices(report)
        self._kept, self._monotonic = kept, monotonic
        self._series, self._rectifier = StereoSeries(rig, ()), rectifier_of(rig)
        self._method = Stereo()
        self._pairs, self._logs = GrowingPairs(survey), GrowingLogs(survey)
        if kept.kept.done or kept.kept.placed:
            self._logs.skip_to_last()
        self._filter = ForwardFilter(self._logs.vehicle)
        self._clock = SurveyClock()
        self.operator = Operator(
            keys_of(survey.settings), EventsFile(events_path(survey)), self._clock.time_s, monotonic
        )
        self._queue = PairQueue(longest_lag_s)
        self._looked: deque[_Looked] = deque()
        self._poses = Trajectory.empty()
        self._driven_m = np.zeros(0)
        before = max(kept.kept.placed, key=lambda placed: placed.pair.time_s, default=None)
        self._driven_until_s = -np.inf if before is None else before.pair.time_s
        self._odometer = (
            Odometer()
            if before is None
            else Odometer(before.chainage_m, at=(float(before.pose.xyz[0, 0]), float(before.pose.xyz[0, 1])))
        )
        self._stretches = Stretches(self._method, self._rectifier.rig, from_m=kept.kept.from_m)
        # Pairs of the open stretch are looked at again after a restart: their places are kept, what they show is not
        self._again = deque(
            p for p in kept.kept.placed if p.state == LOOKED and p.chainage_m >= kept.kept.from_m - AHEAD_M
        )
        # So are those whose places were not known yet
        self._unplaced: deque[ImagePair] = deque()
        self._is_turn_again = False
        self._skips = SkipNotices(self.notices)
        self._last = _Last()
        self._done_s: deque[float] = deque()
        self._lag_s = 0.0

    # One round

    def step(self, now_s: float) -> bool:
        """Do what is due; return whether there was anything to do.

        Parameters
        ----------
        now_s
            Time of this machine. [s, monotonic]
        """
        self._take_in(now_s)
        if now_s - self._last.advanced_s >= _ADVANCE_S:
            # Where all logs are silent, nothing comes late any more
            known_s = [at for name, at in self._last.new_s.items() if name in self._logs.files]
            is_silent = bool(known_s) and now_s - max(known_s) > _SILENT_S
            self._advance(now_s, late_s=0.0 if is_silent else LATE_S)
        looked = self._look(now_s)
        if now_s - self._last.saved_s >= _SAVE_S:
            self._save(now_s)
        self._close_stretches(now_s)
        if now_s - self._last.written_s >= max(_WRITE_S, _WRITE_SHARE * self._last.write_took_s):
            self.write(now_s)
        return looked

    def finish(self, now_s: float) -> None:
        """Write what is there; the last pairs are placed with what is known of the path."""
        self._skips.report(now_s)
        self._advance(now_s, late_s=0.0)
        self._save(now_s)
        self._close_stretches(now_s)
        self.write(now_s)

    @property
    def now_s(self) -> float:
        """The time of this machine. [s, monotonic]."""
        return self._monotonic()

    @property
    def places(self) -> dict[str, tuple[float, float, float, float, float]]:
        """East, north, up, heading [deg] and chainage of each press that has a place, by its identity."""
        return self._kept.kept.places

    def is_idle_for(self, now_s: float, seconds: float) -> bool:
        """Return whether nothing waits to be looked at, and nothing has arrived for a time [s]."""
        waits = len(self._queue) or self._unplaced or self._again
        return not waits and now_s - max(self._last.new_s.values(), default=now_s) >= seconds

    def _take_in(self, now_s: float) -> None:
        """Read what was appended to the lists and the logs."""
        self._last.new_s.setdefault("start", now_s)
        new = self._tried("lists of images", lambda: self._pairs.arrived(now_s), NewPairs(), now_s)
        readings = self._tried("logs", self._logs.readings, NewReadings(), now_s)
        kept = self._kept.kept
        fresh = [pair for pair in new.pairs if pair.number not in kept.done]
        if fresh:
            self._last.new_s["cameras"] = now_s
            self._unplaced.extend(pair for pair in fresh if pair.number in kept.unplaced)
            self._queue.add(pair for pair in fresh if pair.number not in kept.unplaced)
            self._clock.arrived(fresh[-1].time_s, now_s)
        for name, newest_s in readings.newest_s().items():
            self._last.new_s[name] = now_s
            self._clock.arrived(newest_s, now_s)
        self._filter.add(readings.gnss, readings.gyro, readings.wheels)
        for path in new.alone:
            self.notices.once(f"{path.name}: the image of the other camera has not come: left out", now_s)
        bad = [*readings.bad, *([("list of images", new.n_bad)] if new.n_bad else [])]
        for name, n in bad:
            self.notices.once(f"{name}: {n} lines left out, they cannot be read", now_s)
        self._report_silence(now_s)

    def _tried(self, what: str, read: Callable[[], T], nothing: T, now_s: float) -> T:
        """Return what was read; nothing where files cannot be used, which is reported once."""
        try:
            found = read()
        except LineworkError as error:
            self.notices.begin(what, str(error).rstrip("."), now_s)
            return nothing
        self.notices.end(what, f"{what}: can be used again", now_s)
        return found

    def _report_silence(self, now_s: float) -> None:
        """Report sources that have stopped, and those that run again."""
        for name, since_s in self._last.new_s.items():
            if name == "start":
                continue
            source = self._logs.files[name].name if name in self._logs.files else "cameras"
            if now_s - since_s > _SILENT_S:
                without = (
                    "no pair is looked at" if name == "cameras" else "positions are less certain, or missing"
                )
                self.notices.begin(
                    f"silent {name}", f"{source}: nothing new for {_SILENT_S:.0f} s: {without}", now_s
                )
            else:
                self.notices.end(f"silent {name}", f"{source}: runs again", now_s)

    def _advance(self, now_s: float, late_s: float) -> None:
        """Let the filter take in the new readings, and place the pairs and presses that can be placed."""
        self._last.advanced_s = now_s
        new = self._filter.advance(late_s)
        if len(new):
            # After a restart, the logs begin before the last place
            driven = np.full(len(new), self._kept.kept.chainage_m)
            for i in np.flatnonzero(new.time_s > self._driven_until_s).tolist():
                driven[i] = self._odometer.advance(float(new.xyz[i, 0]), float(new.xyz[i, 1]))
            kept = np.flatnonzero(self._poses.time_s > new.time_s[-1] - _POSES_S)
            parts = [self._poses.take(kept), new] if len(kept) else [new]
            self._poses = Trajectory.concatenate(parts)
            self._driven_m = np.concatenate([self._driven_m[kept], driven])
        self._place_pairs(now_s)
        self._place_presses()

    def _look(self, now_s: float) -> bool:
        """Look at the next pair; return whether there was one."""
        skipped = self._queue.skipped()
        for behind in skipped:
            self._kept.pair_done(behind, SKIPPED)
            self._looked.append(_Looked(behind, SKIPPED, None, now_s))
        self._skips.add(skipped, now_s)
        # After a restart every second look is for what the one before had looked at
        self._is_turn_again = not self._is_turn_again
        if self._is_turn_again and self._look_again(now_s):
            return True
        pair = self._queue.next(now_s)
        if pair is None:
            return self._look_again(now_s)
        try:
            found = self._method.look(rectified_pair(pair, self._series, self._rectifier))
        except InputError as error:
            if not self._queue.try_again(pair, now_s):
                self._kept.pair_done(pair, FAILED, error.problem)
                self.notices.once(f"{str(error).rstrip('.')}: left out", now_s)
            return False
        self._queue.done(pair)
        self._kept.pair_done(pair, LOOKED)
        self._looked.append(_Looked(pair, LOOKED, found, now_s))
        done_s = self._monotonic()
        self._done_s.append(done_s)
        while self._done_s[0] < done_s - _RATE_S:
            self._done_s.popleft()
        self._lag_s = max(self._queue.newest_s - pair.time_s, 0.0) + done_s - now_s
        return True

    def _look_again(self, now_s: float) -> bool:
        """Look again at a pair of the open stretch that an earlier start has looked at."""
        if self._unplaced:
            waiting = self._unplaced.popleft()
            with contextlib.suppress(InputError):
                found = self._method.look(rectified_pair(waiting, self._series, self._rectifier))
                self._looked.append(_Looked(waiting, LOOKED, found, now_s))
            return True
        if not self._again:
            return False
        placed = self._again.popleft()
        try:
            found = self._method.look(rectified_pair(placed.pair, self._series, self._rectifier))
        except InputError:
            return True
        self._add_to_stretch(placed, found)
        return True

    def _place_pairs(self, now_s: float) -> None:
        """Give the pairs that were looked at their poses."""
        known, waiting = self._poses.time_s, deque[_Looked]()
        for looked in self._looked:
            time_s = looked.pair.time_s
            if len(known) > 1 and known[0] <= time_s <= known[-1]:
                after = int(np.searchsorted(known, time_s))
                if known[after] - known[max(after - 1, 0)] <= POSE_HOLE_S:
                    self._place(looked)
                else:
                    self._without_position(looked)
            elif (len(known) and time_s < known[0]) or now_s - looked.since_s > _POSES_S:
                self._without_position(looked)
            else:
                waiting.append(looked)
        self._looked = waiting
        has_waited = bool(waiting) and now_s - waiting[0].since_s > 2.0 * _SILENT_S
        if has_waited:
            self.notices.begin(
                "position", "no position: the pairs wait for the logs, or for the van to move", now_s
            )
        elif known.size:
            self.notices.end("position", "the position is known again", now_s)

    def _place(self, looked: _Looked) -> None:
        time_s = np.array([looked.pair.time_s])
        chainage = float(np.interp(time_s[0], self._poses.time_s, self._driven_m))
        placed = Placed(looked.pair, poses_at(self._poses, time_s), chainage, looked.state)
        self._kept.pair_placed(placed)
        if looked.sightings is not None:
            self._add_to_stretch(placed, looked.sightings)

    def _add_to_stretch(self, placed: Placed, found: Sightings) -> None:
        pair = placed.pair
        self._stretches.add(PlacedPair(pair.number, pair.time_s, placed.pose, placed.chainage_m, found))

    def _without_position(self, looked: _Looked) -> None:
        if looked.state == LOOKED:
            self._kept.pair_done(looked.pair, NO_POSITION)

    def _place_presses(self) -> None:
        """Give the presses their places."""
        known, places = self._poses.time_s, self._kept.kept.places
        if len(known) < 2:
            return
        for press in self.operator.presses():
            if press.press not in places and known[0] <= press.time_s <= known[-1]:
                at = places_at(self._poses, np.array([press.time_s]))
                driven = float(np.interp(press.time_s, known, self._driven_m))
                east, north, up = at.xyz[0].tolist()
                self._kept.press_placed(press.press, (east, north, up, float(at.heading_deg[0]), driven))

    def _save(self, now_s: float) -> None:
        error = self._kept.journal.try_to_save()
        self._full_disk("journal", error, now_s)
        if error is None:
            self._last.saved_s, self._last.saved_pairs = now_s, self._kept.kept.counts[LOOKED]
        else:
            self._last.saved_s = max(self._last.saved_s, now_s - _SAVE_S)

    def _full_disk(self, what: str, error: MachineError | None, now_s: float) -> None:
        """Report that something cannot be written, and that it can be again."""
        if error is not None:
            self.notices.begin(f"disk {what}", f"{str(error).rstrip('.')}: it is tried again", now_s)
        else:
            self.notices.end(f"disk {what}", f"{what}: written again", now_s)

    def _close_stretches(self, now_s: float) -> None:
        """Join the lines of stretches whose pairs are complete, and begin another file where one is long enough."""
        if self._again or not self._stretches.is_complete:
            return
        from_m = self._stretches.from_m
        lines = self._stretches.completed()
        error = None
        try:
            self._kept.stretch_done(lines, from_m, self._stretches.from_m)
        except MachineError as found:
            error = found
        self._full_disk("stretch", error, now_s)
        if self._stretches.from_m >= self._kept.kept.n_files * FILE_M and self.write(now_s, closes=True):
            self._kept.next_file()

    def write(self, now_s: float, *, closes: bool = False) -> bool:
        """Write the lines, the photolog and the events so far; return whether the disk took them.

        Parameters
        ----------
        closes
            Whether the next file begins then: the open stretch is left to that.
        """
        begun_s, error = self._monotonic(), None
        try:
            write_drive(
                self._kept.kept, None if closes else self._stretches.lines(), self.operator.presses(), self.survey,
                self.output, camera_m=self._series.rig.left.position_m,
            )  # fmt: skip
        except MachineError as found:
            error = found
        self._full_disk("output", error, now_s)
        self._last.write_took_s = self._monotonic() - begun_s
        self._last.written_s = now_s
        return error is None

    # For the operator

    def status(self, now_s: float) -> LiveStatus:
        """Return the state of the drive; may be called from another thread.

        Parameters
        ----------
        now_s
            Time of this machine. [s, monotonic]
        """
        newest, survey_s = self._filter.newest, self._clock.time_s(now_s)
        if newest is not None and survey_s is not None and survey_s - newest[2] > _SILENT_S:
            newest = None  # it was there then; where it is now is not known
        rate = sum(at > now_s - _RATE_S for at in list(self._done_s)) / _RATE_S
        return LiveStatus(
            counts=dict(self._kept.kept.counts),
            saved_pairs=self._last.saved_pairs,
            waiting=len(self._queue),
            pairs_per_s=rate,
            lag_s=self._lag_s,
            newest_s=newest[2] if newest else None,
            position=tuple(newest[0].tolist()) if newest else None,
            sigma_m=newest[1] if newest else None,
            chainage_m=self._kept.kept.chainage_m,
            saved_s_ago=max(now_s - self._last.saved_s, 0.0) if np.isfinite(self._last.saved_s) else 0.0,
            notices=tuple((notice.text, notice.lasts) for notice in self.notices.shown()),
        )

    def summary(self) -> dict[str, Any]:
        """Return what was done, for the end."""
        return live_summary(self._kept.kept, len(self.operator.presses()))
