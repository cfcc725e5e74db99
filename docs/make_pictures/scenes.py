"""Make the pictures of scenes in docs/simulation.md: ``python docs/make_pictures/scenes.py``."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from linework.evaluation.report.scores_figure import plot_png
from linework.simulation.simulate import SimulatedSurvey, simulate_survey

PICTURES = Path(__file__).parents[1] / "pictures"
#: Kind and seed of each scene shown.
ROADS = (("rural", 2), ("rural", 5), ("gore", 1), ("village", 2))
PLACES = (("junction", 2), ("roundabout", 1), ("forest", 1), ("roofs", 1))
COLOURS = {
    "lane_marking": "tab:red",
    "road_marking_other": "tab:orange",
    "road_boundary": "blue",
    "kerb_top": "limegreen",
}
#: Points up to this far over the axis are shown. [m]
LOW_M, LOW_WITH_ROOFS_M = 0.8, 15.0


def run() -> int:
    """Write docs/pictures/scenes_roads.png and scenes_places.png."""
    roads = Figure(figsize=(13, 11), layout="constrained")
    for row, (kind, seed) in zip(roads.subplots(len(ROADS), 2), ROADS, strict=True):
        shown(row, simulate_survey(kind, seed, 50.0, points_per_m=6000), f"{kind}, seed {seed}")
    saved(roads, "scenes_roads.png")
    places = Figure(figsize=(13, 19), layout="constrained")
    for row, (kind, seed) in zip(places.subplots(len(PLACES), 2), PLACES, strict=True):
        length = 90.0 if kind == "roundabout" else 50.0
        shown(row, simulate_survey(kind, seed, length, points_per_m=6000), f"{kind}, seed {seed}")
    saved(places, "scenes_places.png")
    return 0


def saved(figure: Figure, name: str) -> None:
    """Write a figure in few colours."""
    picture = Image.open(io.BytesIO(plot_png(figure))).convert("RGB")
    picture.quantize(256, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)


def shown(axes: np.ndarray, survey: SimulatedSurvey, title: str) -> None:
    """Draw a survey in plan, turned so that its first metres lead to the right: intensity, and height over the axis."""
    alignment = survey.scenario.layout.road.alignment
    origin = np.asarray(survey.scenario.origin_m)
    local = survey.points.xyz - origin
    s, q = alignment.locate(local[:, :2])
    height = local[:, 2] - alignment.height(s)
    most = LOW_WITH_ROOFS_M if survey.scenario.kind == "roofs" else LOW_M
    low = np.flatnonzero((height < most) & (height > -1.5) & (np.abs(q) < 16.0))
    xy = turned(survey, local[low])
    intensity, height = survey.points.intensity[low], height[low]
    for ax, value, name, colours in zip(
        axes, (intensity, height), ("intensity", "height"), ("gray", "cividis"), strict=True
    ):
        least, greatest = np.percentile(value, (2.0, 99.0))
        if name == "height" and most == LOW_M:
            least, greatest = -0.35, 0.25
        ax.scatter(*xy.T, c=value, s=0.5, lw=0, cmap=colours, vmin=least, vmax=greatest)
        drawn_truth(ax, survey)
        ax.set(title=f"{title}: {name}", aspect="equal")


def drawn_truth(ax: Axes, survey: SimulatedSurvey) -> None:
    """Draw the true lines on the ground."""
    truth = survey.truth
    for kind, a, b in zip(truth.kind, truth.offsets[:-1], truth.offsets[1:], strict=True):
        if kind in COLOURS:
            line = turned(survey, truth.xyz[a:b] - np.asarray(survey.scenario.origin_m))
            ax.plot(*line.T, color=COLOURS[str(kind)], lw=0.9)


def turned(survey: SimulatedSurvey, local: np.ndarray) -> np.ndarray:
    """Return plan positions with the road's first direction to the right."""
    heading = survey.scenario.layout.road.alignment.heading_rad
    cos, sin = np.cos(heading), np.sin(heading)
    return local[:, :2] @ np.array([[cos, -sin], [sin, cos]])


if __name__ == "__main__":
    raise SystemExit(run())
