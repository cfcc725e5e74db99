"""Make the pictures of docs/methods from simulated surveys: ``python docs/make_pictures/rails.py``."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from PIL import Image as Picture

from linework.evaluation.report.scores_figure import plot_png
from linework.imaging.raster import grid_for, in_height_band
from linework.methods.radon.method import RadonConfig
from linework.methods.radon.seeds import SeedLines, SeedSegments, find_seed_lines, split_into_segments
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import Bins, bin_near, find_starts
from linework.methods.rails.rail_lines import rail_lines
from linework.methods.rails.rails import FittedRail, fit_rail
from linework.model.grid import Image
from linework.model.lines import LineSet
from linework.simulation.simulate import SimulatedSurvey, simulate_survey
from linework.surface.config import RoadConfig
from linework.surface.road import find_ground, height_above_ground, height_above_road

PICTURES = Path(__file__).parents[1] / "pictures"
CONFIG = RadonConfig()
#: Half the length of road that is looked at from its end. [m]
SLICE_M = 1.5


@dataclass(frozen=True, slots=True)
class Steps:
    """What every step of the guardrail part made of a survey."""

    survey: SimulatedSurvey
    height_m: np.ndarray
    binary: Image
    bins: Bins
    seeds: SeedLines
    segments: SeedSegments
    starts: np.ndarray
    chains: list[np.ndarray]
    rails: list[FittedRail]
    lines: LineSet


def steps_of(survey: SimulatedSurvey) -> Steps:
    """Run the guardrail part step by step."""
    points = survey.points
    surface = find_ground(points, survey.trajectory, RoadConfig())
    above_road = height_above_road(surface, points.xyz)
    height = np.minimum(above_road, height_above_ground(surface, points.xyz))
    grid = grid_for(points, CONFIG.cell_m)
    binary = in_height_band(points.xyz, height, grid, CONFIG.min_height_m, CONFIG.max_height_m)
    seeds = find_seed_lines(binary, CONFIG.seeds)
    segments = split_into_segments(seeds, binary, CONFIG.seeds)
    bins = bin_near(points.xyz, height, binary)
    starts = find_starts(segments, bins, CONFIG.circles)
    band = (-1.0, CONFIG.max_height_m)
    chains = chains_from_starts(starts, bins, band, CONFIG.profile.min_length_m, CONFIG.circles)
    rails = [fit_rail(chain, bins, CONFIG.circles, CONFIG.profile) for chain in chains]
    lines = rail_lines(rails, bins, surface, CONFIG.circles, CONFIG.profile)
    return Steps(survey, above_road, binary, bins, seeds, segments, starts, chains, rails, lines)


def local_to(steps: Steps, place: np.ndarray, heading: float) -> np.ndarray:
    """Return all points of the survey as along, left of and above a place."""
    d = steps.survey.points.xyz - place
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack([d[:, 0] * cos + d[:, 1] * sin, d[:, 1] * cos - d[:, 0] * sin, d[:, 2]])


def most_overgrown(steps: Steps) -> tuple[np.ndarray, float]:
    """Return the place and heading of the vertex of a guardrail with most points close behind its sheet."""
    best, place, heading = -1, np.zeros(3), 0.0
    rails = steps.lines["guardrail"]
    for i in range(len(rails)):
        line = rails[i].xyz
        for k in range(6, len(line) - 6, 4):
            toward = line[k + 1, :2] - line[k - 1, :2]
            angle = float(np.arctan2(toward[1], toward[0]))
            s, u, z = local_to(steps, line[k], angle).T
            n = int(
                np.sum((np.abs(s) < SLICE_M) & (np.abs(u) > 0.10) & (np.abs(u) < 0.35) & (np.abs(z) < 0.3))
            )
            if n > best:
                best, place, heading = n, line[k], angle
    return place, heading


def draw_section(ax: Axes, steps: Steps) -> None:
    """Draw a slice across a rail: points, circle, sheet and top edge."""
    place, heading = most_overgrown(steps)
    s, u, z = local_to(steps, place, heading).T
    near = (np.abs(s) <= SLICE_M) & (np.abs(u) < 1.3) & (z > -1.4) & (z < 1.0)
    radius, sheet = CONFIG.circles.radius_m, CONFIG.circles.sheet_m
    held = near & (np.abs(u) <= radius) & (z <= 0.03) & (z >= -sheet)
    ax.plot(u[near & ~held], z[near & ~held], ".", ms=2.5, color="#9a9a94", label="points, 3 m of road")
    ax.plot(u[held], z[held], ".", ms=3.0, color="#1b7837", label="held by the circle: the sheet")
    ax.add_patch(Rectangle((-radius, -sheet), 2 * radius, sheet + 0.03, fill=False, ec="#2b5fc4", lw=1.2))
    ax.plot([], [], color="#2b5fc4", lw=1.2, label=f"circle of {radius:g} m over {sheet:g} m, from its side")
    ax.axhline(0.0, xmin=0.38, xmax=0.62, color="#d6301f", lw=1.2, label="top edge")
    ax.plot(0, 0, "o", ms=7, mfc="none", mec="#d6301f", mew=1.6, label="the line")
    truth = steps.survey.truth["guardrail"].xyz
    nearest = truth[np.argmin(np.hypot(*(truth[:, :2] - place[:2]).T))] - place
    across = nearest[1] * np.cos(heading) - nearest[0] * np.sin(heading)
    ax.plot(across, nearest[2], "k+", ms=11, mew=1.4, label="truth")
    ax.set_xlabel("across the rail [m]")
    ax.set_ylabel("above the top edge [m]")
    ax.set_aspect("equal")


def draw_plan(ax: Axes, steps: Steps, middle: np.ndarray, half_m: float) -> None:
    """Draw a bend in plan: binary image, seed segments, followed circles, lines."""
    grid = steps.binary.grid
    extent = (0.0, grid.n_cols * grid.cell_width_m, -grid.n_rows * grid.cell_height_m, 0.0)
    corner = np.array([grid.east_m, grid.north_m])
    ax.imshow(np.where(steps.binary.values, 0.78, 1.0), cmap="gray", vmin=0, vmax=1, extent=extent)
    ends = np.stack([steps.segments.start_xy, steps.segments.end_xy], axis=1) - corner
    ax.add_collection(LineCollection(list(ends), colors="#e08214", linewidths=0.7, alpha=0.7))
    ax.plot([], [], color="#e08214", lw=0.8, label="segments of seed lines")
    places = steps.starts[:, :2] + steps.bins.origin[:2] - corner
    ax.plot(*places.T, "x", ms=4, color="#7b3294", label="starts")
    small = half_m < 5
    for chain in steps.chains:
        xy = chain[:, :2] + steps.bins.origin[:2] - corner
        if small:
            for node in xy[np.all(np.abs(xy - middle + corner) < half_m, axis=1)]:
                ax.add_patch(Circle(tuple(node), CONFIG.circles.radius_m, fill=False, ec="#2b5fc4", lw=1.0))
        else:
            ax.plot(*xy.T, ".", ms=2.2, color="#2b5fc4")
    ax.plot([], [], "o", ms=5, mfc="none", mec="#2b5fc4", label="circles, followed")
    rails = steps.lines["guardrail"]
    for i in range(len(rails)):
        ax.plot(*(rails[i].xyz[:, :2] - corner).T, color="#d6301f", lw=1.1)
    ax.plot([], [], color="#d6301f", lw=1.1, label="guardrails")
    ax.set_xlim(*(middle[0] - corner[0] + np.array([-half_m, half_m])))
    ax.set_ylim(*(middle[1] - corner[1] + np.array([-half_m, half_m])))
    ax.set_xlabel("[m]")
    ax.set_aspect("equal")


def sharpest(steps: Steps) -> np.ndarray:
    """Return the place [m, world] where a guardrail bends most."""
    rails = steps.lines["guardrail"]
    turns, places = [], []
    for i in range(len(rails)):
        line = rails[i].xyz[:, :2]
        heading = np.unwrap(np.arctan2(*np.diff(line, axis=0).T[::-1]))
        k = np.arange(10, len(heading) - 10)
        turns.append(np.abs(heading[k + 10] - heading[k - 10]))
        places.append(line[k])
    return np.concatenate(places)[np.argmax(np.concatenate(turns))]


def save(figure: Figure, name: str) -> None:
    """Write a picture of 128 colours, which keeps it under 200 kB."""
    picture = Picture.open(io.BytesIO(plot_png(figure))).convert("RGB")
    picture.quantize(128, method=Picture.Quantize.MAXCOVERAGE, dither=Picture.Dither.NONE).save(
        PICTURES / name, optimize=True
    )


def main() -> None:
    """Write docs/pictures/rail_section.png and docs/pictures/rail_plan.png."""
    steps = steps_of(simulate_survey("bends", 32, 120.0, points_per_m=5000))
    figure = Figure(figsize=(8.8, 3.9), layout="constrained")
    draw_section(figure.subplots(), steps)
    figure.legend(loc="outside right upper", frameon=False, fontsize=9)
    save(figure, "rail_section.png")
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_plan(left, steps, sharpest(steps), 18.0)
    draw_plan(right, steps, sharpest(steps), 2.5)
    left.legend(loc="upper right", fontsize=9, framealpha=1.0)
    save(figure, "rail_plan.png")


if __name__ == "__main__":
    main()
