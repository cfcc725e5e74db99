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
LOOKALIKES = (("lookalikes", 6), ("repainted", 2))
#: Kind, seed and scanner of the scenes on two levels.
LEVELS = (("overpass", 1, "default"), ("overpass", 3, "airborne"), ("tunnel", 1, "default"))
#: Points up to this far over the axis are shown. [m]
LOW_M, LOW_WITH_ROOFS_M = 0.8, 15.0


def run() -> int:
    """Write docs/pictures/scenes_roads.png, scenes_places.png, scenes_lookalikes.png and scenes_levels.png."""
    roads = Figure(figsize=(13, 11), layout="constrained")
    for row, (kind, seed) in zip(roads.subplots(len(ROADS), 2), ROADS, strict=True):
        shown(row, simulate_survey(kind, seed, 50.0, points_per_m=6000), f"{kind}, seed {seed}")
    saved(roads, "scenes_roads.png")
    places = Figure(figsize=(13, 19), layout="constrained")
    for row, (kind, seed) in zip(places.subplots(len(PLACES), 2), PLACES, strict=True):
        length = 90.0 if kind == "roundabout" else 50.0
        shown(row, simulate_survey(kind, seed, length, points_per_m=6000), f"{kind}, seed {seed}")
    saved(places, "scenes_places.png")
    alike = Figure(figsize=(13, 2.3 * len(LOOKALIKES)), layout="constrained")
    for ax, (kind, seed) in zip(alike.subplots(len(LOOKALIKES), 1), LOOKALIKES, strict=True):
        shown_marks(ax, simulate_survey(kind, seed, 64.0, points_per_m=9000), f"{kind}, seed {seed}")
    saved(alike, "scenes_lookalikes.png")
    levels = Figure(figsize=(13, 2.6 * len(LEVELS)), layout="constrained")
    rows = levels.subplots(len(LEVELS), 2, width_ratios=(2, 1))
    for row, (kind, seed, scanner) in zip(rows, LEVELS, strict=True):
        density = 3000 if scanner == "default" else None
        survey = simulate_survey(kind, seed, 60.0, points_per_m=density, scanner=scanner)
        shown_heights(row, survey, f"{kind}, seed {seed}, {scanner}")
    saved(levels, "scenes_levels.png")
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


def shown_marks(ax: Axes, survey: SimulatedSurvey, title: str) -> None:
    """Draw the brightness of a road along its axis, and its true paint."""
    road = survey.scenario.layout.road
    origin = np.asarray(survey.scenario.origin_m)
    s, q = road.alignment.locate(survey.points.xyz[:, :2] - origin[:2])
    on_road = np.flatnonzero((np.abs(q) < road.left.width_m) & (s > 0.0) & (s < survey.scenario.length_m))
    intensity = survey.points.intensity[on_road]
    least, greatest = np.percentile(intensity, (2.0, 99.0))
    ax.scatter(s[on_road], q[on_road], c=intensity, s=0.6, lw=0, cmap="gray", vmin=least, vmax=greatest)
    truth = survey.truth
    for kind, a, b in zip(truth.kind, truth.offsets[:-1], truth.offsets[1:], strict=True):
        if kind in ("lane_marking", "road_marking_other"):
            along, across = road.alignment.locate(truth.xyz[a:b, :2] - origin[:2])
            ax.plot(along, across, color=COLOURS[str(kind)], lw=0.7)
    ax.set(title=f"{title}: intensity along the road", xlim=(0, survey.scenario.length_m), aspect="equal")


def shown_heights(axes: np.ndarray, survey: SimulatedSurvey, title: str) -> None:
    """Draw a survey from the side, and a slice of 12 m across its middle; true lines red."""
    alignment = survey.scenario.layout.road.alignment
    origin = np.asarray(survey.scenario.origin_m)
    for xyz, colour, size in ((survey.points.xyz, "0.4", 0.3), (survey.truth.xyz, "tab:red", 1.0)):
        local = xyz - origin
        s, q = alignment.locate(local[:, :2])
        height = local[:, 2] - alignment.height(s)
        slice_ = np.abs(s - 0.5 * survey.scenario.length_m) < 6.0
        axes[0].scatter(s, height, color=colour, s=size, lw=0)
        axes[1].scatter(q[slice_], height[slice_], color=colour, s=size, lw=0)
    axes[0].set(title=f"{title}: from the side", aspect="equal", ylim=(-3, 12))
    axes[1].set(title="across the middle", aspect="equal", ylim=(-3, 12), xlim=(-18, 18))


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
