"""How right the ground is: against simulated meshes and airborne ground classes, beside the cloth simulation filter.

``python -m benchmarks.ground`` takes simulated roads, ``--later N`` the same roads of seeds N later; ``--roads
rural,forest --seeds 900-902`` takes other scenes instead, ``--data DIR`` adds
the classified surveys of a folder of real ones. Of cells with points: ``lost``, those whose lowest layer is within 10 cm of the true ground (30 cm on real data)
and that are not ground; ``wrong``, ground cells that are off by more than 0.5 m. Of all cells: ``flagged``, the share
of those off by more than 0.5 m that are not known. ``RMSE plants`` is that of ground cells with points of plants. True ground is what is seen
from above, so that roads below a bridge or a tunnel's land count as wrong. The cloth (``pip install cloth-simulation-filter``; resolution
0.5 m, threshold 0.3 m, as its paper suggests) gets the same points; its cells are those of its ground points.
"""

import argparse
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import LinearNDInterpolator

import linework
from benchmarks.accuracy import seeds_of
from linework.files.las.header import read_las_header
from linework.methods.classes.point_class import PointClass
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.scene.materials import GROUND, Material
from linework.simulation.scene.scene import build_scene
from linework.simulation.sensors.rigs import equipped
from linework.simulation.sensors.scanner import Caster
from linework.simulation.simulate import survey_of
from linework.surface.road import find_ground

#: Roads, seeds and scanners that nothing was tuned on, and whether the road is cut by holes in the data.
WORLDS = [
    ("bends", 41, "default", False),
    ("urban", 42, "default", False),
    ("motorway", 43, "default", False),
    ("straight", 44, "default", False),
    ("urban", 45, "one", True),
    ("bends", 46, "spinning32", False),
    ("straight", 47, "airborne", True),
    ("urban", 48, "airborne", False),
    ("bends", 49, "terrestrial", False),
]
#: Classified airborne surveys, and their classes of ground and water.
CLASSIFIED, GROUND_CLASSES = ("forest/*.laz", "amsterdam/*.laz", "powerline/*.laz"), (2, 9)
OFF_M = 0.5
NO_PLANTS = np.zeros((0, 3))


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ground")
    parser.add_argument("--data", type=Path, help="folder of real surveys")
    parser.add_argument("--length-m", type=float, default=150.0)
    parser.add_argument(
        "--later", type=int, default=0, help="added to every seed: roads that nobody has looked at"
    )
    parser.add_argument("--roads", default="", help="names of roads; default: those of the list")
    parser.add_argument("--seeds", default="900-901", help="of --roads: first-last, or a list")
    options = parser.parse_args(arguments)
    print(
        f"{'survey':24} {'filter':6} {'lost':>7} {'wrong':>8} {'RMSE road':>10} {'RMSE':>7} {'RMSE plants':>11}"
        f" {'flagged':>16} {'ns/point':>9}"
    )
    named = [(road, seed, "default", False) for road in filter(None, options.roads.split(","))
             for seed in seeds_of(options.seeds)]  # fmt: skip
    for road, first, scanner, holes in named or WORLDS:
        seed = first + options.later
        drawn = draw_scenario(road, seed, options.length_m, points_per_m=4000)
        survey = survey_of(equipped(drawn, scanner=scanner, points_per_m=4000, holes=holes))
        name = " ".join(
            [road, str(seed), *([scanner] if scanner != "default" else []), *(["holes"] if holes else [])]
        )
        plants = survey.points.xyz[survey.point_class == PointClass.VEGETATION]
        report(
            name,
            survey.points,
            survey.trajectory,
            lambda xy, s=survey: mesh_heights(s.scenario, xy),
            0.1,
            plants,
        )
    if options.data:
        for path in sorted(path for pattern in CLASSIFIED for path in options.data.glob(pattern)):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", linework.errors.LineworkWarning)
                points = linework.read_points(
                    path, crs=None if stated(path) else "local", carry=["classification"]
                )
            of_ground = points.xyz[np.isin(points.columns["classification"], GROUND_CLASSES)]
            report(path.name, points, None, lambda xy, xyz=of_ground: between(xyz, xy), 0.3)


def report(name, points, trajectory, truth, near_m, plants=NO_PLANTS):
    """Print a line for our filter, and one for the cloth where it is installed; plants: points (k, 3) of plants."""
    find_ground(points.take(slice(0, 1000)))
    start = time.process_time()
    ground = find_ground(points, trajectory)
    ours = time.process_time() - start
    rows, cols = np.divmod(np.arange(ground.grid.n_rows * ground.grid.n_cols), ground.grid.n_cols)
    xy = ground.grid.to_world(rows + 0.5, cols + 0.5)
    height, material = truth(xy)
    shape = ground.grid.shape
    height, material = height.reshape(shape), material.reshape(shape)
    under = np.isfinite(lowest_of(ground, plants))
    lowest = lowest_of(ground, points.xyz)
    with np.errstate(invalid="ignore"):
        earth = np.abs(lowest - height) <= near_m
    print_line(name, "ours", ground.ground_m + ground.z0_m, ground.is_ground, ground.is_known, height, material,
               earth, under, ours / len(points))  # fmt: skip
    found = cloth(points.xyz)
    if found is not None:
        chosen, seconds = found
        level = lowest_of(ground, points.xyz[chosen])
        is_ground = np.isfinite(level)
        print_line(
            "", "cloth", level, is_ground, is_ground, height, material, earth, under, seconds / len(points)
        )


def print_line(name, which, level, is_ground, is_known, height, material, earth, under, seconds):
    """Print the figures of one filter: heights, what is ground, and what is known, in every cell."""
    error = level - height
    with np.errstate(invalid="ignore"):
        off = np.abs(error) > OFF_M
    measured = is_ground & np.isfinite(error)
    road = measured & np.isin(material, [Material.ASPHALT, Material.FOOTWAY])
    lost = np.mean(~is_ground[earth]) if earth.any() else np.nan
    flagged = np.mean(~is_known[off]) if off.any() else np.nan
    print(
        f"{name:24} {which:6} {100 * lost:6.2f}% {100 * np.mean(off[measured]):7.3f}% {100 * rms(error[road]):7.1f} cm"
        f" {100 * rms(error[measured & ~off]):4.1f} cm {100 * rms(error[measured & under]):8.1f} cm {100 * flagged:6.1f}% of {off.sum():5} {1e9 * seconds:9.0f}",
        flush=True,
    )


def rms(values):
    return np.sqrt(np.mean(values**2)) if len(values) else np.nan


def lowest_of(ground, xyz):
    """Return the lowest height of points in each cell, NaN without any."""
    rows, cols = (np.floor(v).astype(np.int64) for v in ground.grid.to_cell(xyz[:, :2]))
    lowest = np.full(ground.grid.shape, np.inf)
    np.minimum.at(lowest, (rows.clip(0, lowest.shape[0] - 1), cols.clip(0, lowest.shape[1] - 1)), xyz[:, 2])
    return np.where(np.isinf(lowest), np.nan, lowest)


def stated(path):
    """Return whether a file says its CRS."""
    return bool(read_las_header(path).projection)


def mesh_heights(scenario, xy):
    """Return the height of the simulated ground at places, NaN where there is none, and its material."""
    scene = build_scene(scenario)
    kept = GROUND[scene.mesh.material]
    columns = ("triangles", "material", "target", "wire", "only_pass")
    mesh = replace(scene.mesh, **{name: getattr(scene.mesh, name)[kept] for name in columns})
    origin = np.asarray(scenario.origin_m)
    above = np.column_stack([xy - origin[:2], np.full(len(xy), 1000.0)])
    caster = Caster(replace(scene, mesh=mesh))
    rays, triangles, ranges = caster.cast(
        above, np.tile([0.0, 0.0, -1.0], (len(xy), 1)), 3000.0, 0, np.random.default_rng(0)
    )
    height, material = np.full(len(xy), np.nan), np.full(len(xy), -1)
    height[rays] = 1000.0 - ranges + origin[2]
    material[rays] = mesh.material[triangles]
    return height, material


def between(xyz, xy):
    """Return the heights between classified ground points, and no material."""
    origin = xyz.mean(axis=0)
    heights = LinearNDInterpolator(xyz[:, :2] - origin[:2], xyz[:, 2])(xy - origin[:2])
    return heights, np.full(len(xy), -1)


def cloth(xyz):
    """Return which points the cloth takes for ground and its processor time; None where it is not installed."""
    try:
        import CSF
    except ImportError:
        return None
    filter_ = CSF.CSF()
    filter_.params.bSloopSmooth = False
    filter_.params.cloth_resolution = 0.5
    filter_.params.class_threshold = 0.3
    start = time.process_time()
    filter_.setPointCloud(xyz - xyz.mean(axis=0))
    ground, others = CSF.VecInt(), CSF.VecInt()
    filter_.do_filtering(ground, others, False)
    return np.array(ground), time.process_time() - start


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
