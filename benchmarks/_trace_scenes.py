"""Surveys on disk to pick on, and the places to pick: on lines, and away from all of them, with what is there."""

import contextlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import write_trajectory
from linework.methods.obb.search_area import NoLineReason
from linework.processes.executors import Serial
from linework.runs.opened.points import opened_survey, surface_of
from linework.runs.opened.work_folder import work_folder
from linework.runs.steps import RunSteps
from linework.simulation.roads.alignment import widening
from linework.simulation.scene.materials import Material
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig

KINDS = ("lane_marking", "road_boundary", "guardrail", "cable")
STATION_M = 0.5
#: Picks are this near to a line, or farther than `AWAY_M` from all lines. [m]
NEAR_M, AWAY_M = 0.3, 1.0
#: Within the search area: fewer points on the ground show no line. [m]
SEARCH_M, LEAST_POINTS = 0.5, 12
#: Seen over less than this share of its directions, a search area has a hole in it.
LEAST_SIDES, N_SIDES = 6, 8
ON_ROAD = {NoLineReason.ALL_ROAD, NoLineReason.NO_MARKING}
NO_DATA = {NoLineReason.HOLES, NoLineReason.TOO_FEW_POINTS, NoLineReason.OFF_THE_EDGE}


@dataclass(frozen=True)
class Away:
    """A place away from all lines, and the reasons that are right there."""

    place: np.ndarray
    reasons: set
    where: str


@contextlib.contextmanager
def opened_simulation(road, seed, length_m):
    """Give a simulated survey, opened, with its surface."""
    simulated = simulate_survey(road, seed, length_m)
    with tempfile.TemporaryDirectory(prefix="linework-trace-") as name:
        folder = Path(name)
        write_las(simulated.points, folder / "points.laz", crs=simulated.crs)
        write_trajectory(simulated.trajectory, folder / "trajectory.csv")
        (folder / "survey.toml").write_text(
            f'name = "{road} {seed}"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
        )
        steps = RunSteps()
        with opened_survey(open_survey([folder]), work_folder(folder, None), steps=steps) as opened:
            yield simulated, opened, surface_of(opened, RoadConfig(), Serial(), steps)


def places_on(truth, n, rng):
    """Places within `NEAR_M` of observed truth, evenly over the length of all lines."""
    stations, along = [], []
    for i in np.flatnonzero(np.isin(truth.kind, KINDS)):
        xy, seen = resampled(truth, i)
        step = np.gradient(xy, axis=0)
        stations.append(xy[seen])
        along.append((step / np.maximum(np.hypot(*step.T), 1e-9)[:, None])[seen])
    stations, along = np.concatenate(stations), np.concatenate(along)
    chosen = rng.choice(len(stations), n)
    left = np.column_stack([-along[chosen, 1], along[chosen, 0]])
    return stations[chosen] + rng.uniform(-NEAR_M, NEAR_M, (n, 1)) * left


def resampled(truth, i):
    """Stations (n, 2) of a truth line, and which of them were observed."""
    part = slice(truth.offsets[i], truth.offsets[i + 1])
    xy = truth[i].xyz[:, :2]
    t = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    at = np.arange(0.0, t[-1] + 1e-6, STATION_M)
    vertex = np.clip(np.round(np.interp(at, t, np.arange(len(t)))).astype(int), 0, len(t) - 1)
    return np.column_stack([np.interp(at, t, c) for c in xy.T]), truth.observed[part][vertex]


def places_away(simulated, n, rng):
    """Places more than `AWAY_M` from all lines: on the carriageway, beside it, and off the data."""
    every = np.concatenate([resampled(simulated.truth, i)[0] for i in range(len(simulated.truth))])
    lines = cKDTree(every)
    points = cKDTree(simulated.points.xyz[:, :2])
    road, origin = simulated.scenario.layout.road, np.asarray(simulated.scenario.origin_m)
    found = []
    while len(found) < n:
        where = rng.choice(["carriageway", "beside", "off the data"], p=[0.55, 0.35, 0.10])
        s = rng.uniform(0.0, simulated.scenario.length_m)
        q = _offset(road, where, rng)
        place = road.on_ground(s, q) + origin
        if lines.query(place[:2])[0] <= AWAY_M + STATION_M / 2:
            continue
        empty = points.query(place[:2])[0] > 5.0
        if (where == "off the data") != empty:
            continue
        near = simulated.points.xyz[points.query_ball_point(place[:2], SEARCH_M)] - place
        reasons = {NoLineReason.OFF_THE_EDGE} if empty else _reasons(road, s, q, near)
        found.append(Away(place[:2], reasons, where))
    return found


def _offset(road, where, rng):
    sign = rng.choice([-1, 1])
    width = road.side(sign).width_m
    if where == "carriageway":
        return sign * rng.uniform(0.0, width - AWAY_M)
    beyond = rng.uniform(1.0, 6.0) if where == "beside" else rng.uniform(30.0, 300.0)
    return sign * (width + beyond)


def _reasons(road, s, q, near):
    """Return what is right to say of a place, from what is there and from the points (n, 3) about it."""
    side = road.side(1 if q >= 0 else -1)
    beyond = abs(q) - side.width_m
    is_road = beyond <= 0.0 or beyond <= float(widening(side.mouths, np.array([s]), side.reach_m)[0])
    if not is_road and beyond < side.reach_m:
        i = min(int(np.searchsorted(side.land_d_m, beyond)) - 1, len(side.land_material) - 1)
        is_road = side.land_material[max(i, 0)] == Material.ASPHALT
    right = set(ON_ROAD) if is_road else {NoLineReason.NO_ROAD}
    ground = near[np.abs(near[:, 2]) < 0.15]
    sides = np.unique((np.arctan2(ground[:, 1], ground[:, 0]) / (2 * np.pi) * N_SIDES).astype(int) % N_SIDES)
    if len(ground) < LEAST_POINTS or len(sides) < LEAST_SIDES:
        right |= NO_DATA
    if len(ground) < 0.5 * len(near):
        # A car on the road, a trunk in the grass: no road is seen there
        right.add(NoLineReason.NO_ROAD)
    return right
