"""Two drives over one simulated road, in one lane each, with slow errors of their own."""

from dataclasses import dataclass, replace

import numpy as np

from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Pass
from linework.simulation.simulate import survey_of

#: Errors east, north and up of each drive, at their largest. [m]
OFF_M = np.array([[0.05, 0.06, -0.04], [-0.04, -0.05, 0.05]])
PERIOD_S = 15.0


@dataclass(frozen=True)
class TwoDrives:
    """Points and path as they were recorded, and the truth."""

    points: Points
    path: Trajectory
    truth: object

    def part(self, first, last):
        """Points and path of a time."""
        own = (self.points.time_s >= first) & (self.points.time_s < last)
        on_path = (self.path.time_s >= first) & (self.path.time_s < last)
        return self.points.take(own), self.path.take(np.flatnonzero(on_path))


def slow_error(time_s, begin_s, number):
    """Return (n, 3) the error of a drive. [m]"""
    return OFF_M[number] * np.cos(2.0 * np.pi * (time_s - begin_s) / PERIOD_S)[:, None]


def two_drives(road="straight", seed=3, length_m=60.0, points_per_m=1500.0):
    """Return the survey; the second drive goes against the first."""
    scenario = draw_scenario(road, seed, length_m, points_per_m=points_per_m)
    first = replace(scenario.passes[0], pose_error_m=(0.0, 0.0, 0.0))
    lanes = scenario.layout.lanes
    offset, direction = ([lane for lane in lanes if lane[1] != first.direction] or list(lanes))[-1]
    second = Pass(
        q_m=offset, direction=direction, speed_mps=first.speed_mps, wander_m=first.wander_m,
        pose_error_m=(0.0, 0.0, 0.0), start_time_s=first.start_time_s + 400.0,
    )  # fmt: skip
    survey = survey_of(replace(scenario, passes=(first, second)))
    points, path = survey.points, survey.trajectory
    middle = first.start_time_s + 200.0
    begins = (first.start_time_s, second.start_time_s)

    def off(time_s):
        errors = [slow_error(time_s, begin, i) for i, begin in enumerate(begins)]
        return np.where((time_s < middle)[:, None], *errors)

    points = Points(
        points.xyz + off(points.time_s), intensity=points.intensity, time_s=points.time_s, crs=survey.crs
    )
    path = Trajectory(
        path.time_s, path.xyz + off(path.time_s), path.attitude_deg, np.full((len(path), 3), 0.04)
    )
    return TwoDrives(points, path, survey.truth.with_columns(crs=survey.crs)), middle


def path_of(*legs, start_s=0.0, speed=10.0):
    """Return a trajectory along legs ((x, y), ...), one pose a second; a number instead of a leg is a pause [s]."""
    time, xyz, now = [], [], start_s
    for leg in legs:
        if isinstance(leg, float):
            now += leg
            continue
        leg = np.asarray(leg, dtype=float)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(leg, axis=0), axis=1))])
        at = np.arange(0.0, along[-1] + 1e-9, speed)
        xyz.append(np.column_stack([*(np.interp(at, along, c) for c in leg.T), np.zeros(len(at))]))
        time.append(now + at / speed)
        now = time[-1][-1] + 1.0
    return Trajectory(np.concatenate(time), np.concatenate(xyz))


def straight(offset_m, up_m=0.0, kind="lane_marking"):
    x = np.arange(0.0, 301.0)
    xyz = np.column_stack([x, np.full(len(x), offset_m), np.full(len(x), up_m)])
    return LineSet.from_lines(
        [xyz], kind=[kind], sigma_xy_m=np.full(len(x), 0.01), sigma_z_m=np.full(len(x), 0.01)
    )
