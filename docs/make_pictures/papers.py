"""Make the pictures of docs/papers.md, the papers' figures from our data: ``python docs/make_pictures/papers.py``.

The survey of the stereo figures is simulated in a temporary folder, which takes a minute.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import linework
from linework.evaluation.report.scores_figure import plot_png
from linework.methods.protocol import tile_of, whole_tile
from linework.published import obb_2023, radon_2002
from linework.published.intensity_histogram import intensity_histogram
from linework.published.methods import Radon2002, discs_of
from linework.published.stereo_1992 import images_of_steps, search_window
from linework.runs.opened.recordings import opened_recordings
from linework.simulation.simulate import SimulatedSurvey, simulate_survey

PICTURES = Path(__file__).parents[1] / "pictures"


def panels(n: int, *, width: float = 12.0, height: float = 3.2) -> tuple[Figure, list[Any]]:
    """Return a figure with n panels side by side."""
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    return figure, list(figure.subplots(1, n))


def radon_figures(survey: SimulatedSurvey) -> Figure:
    """Return figures 3 to 7 of the radon paper, of the image with the strongest candidate line."""
    tile = whole_tile(tile_of(survey.points, survey.trajectory))
    shown: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for name, result in Radon2002().steps(tile):
        found[name] = result
        strongest = shown["peaks"].strength_m.max() if "peaks" in shown else 0.0
        if (
            name == "segments"
            and len(found["peaks"].strength_m)
            and found["peaks"].strength_m.max() > strongest
        ):
            shown = dict(found)
    images, binary, (radon, _, x) = shown["images"], shown["binary image"], shown["Radon image"]
    config = radon_2002.Radon2002Config()
    around = radon_2002.dilated(
        radon, round(config.theta_element_deg / config.step_deg), round(config.rho_element_m / config.cell_m)
    )
    side = config.image_m
    figure, axes = panels(5, width=15.0)
    axes[0].imshow(np.log1p(images.density), origin="lower", extent=(0, side, 0, side), cmap="magma")
    axes[1].imshow(
        images.maximum, origin="lower", extent=(0, side, 0, side), vmin=0.0, vmax=6.0, cmap="turbo"
    )
    axes[2].imshow(binary, origin="lower", extent=(0, side, 0, side), cmap="gray_r")
    for line in shown["segments"]:
        axes[2].plot(*(line - shown["corner"]).T, color="#d62728", lw=1.0)
    axes[2].set(xlim=(0, side), ylim=(0, side))
    extent = (0.0, 180.0, float(x[0]), float(x[-1]))
    axes[3].imshow(radon.T, origin="lower", aspect="auto", extent=extent, cmap="viridis")
    axes[4].imshow(around.T, origin="lower", aspect="auto", extent=extent, cmap="viridis")
    peaks = shown["peaks"]
    axes[4].scatter(np.degrees(peaks.theta_rad), peaks.rho_m, s=18, facecolors="none", edgecolors="#ffffff")
    titles = (
        "density (3)",
        "maximum height (4)",
        "binary image, lines (5)",
        "Radon image (6)",
        "dilated, peaks (7)",
    )
    for ax, title in zip(axes, titles, strict=True):
        ax.set_title(title, fontsize=10)
        ax.tick_params(labelsize=7)
    return figure


def obb_figures(survey: SimulatedSurvey) -> Figure:
    """Return figures 6, 8 and 12 of the obb paper: floor and edge, intensities, and boxes that collide."""
    config = obb_2023.Obb2023Config()
    about = discs_of(survey.points.xyz, survey.points.intensity, config.radius_m)
    kerb, mark = place_on(survey, "road_boundary", about), place_on(survey, "lane_marking", about)
    figure, axes = panels(4, width=14.0, height=3.6)
    xyz, _ = about(kerb)
    local = xyz - np.append(kerb, xyz[:, 2].min())
    upright = obb_2023.is_upright(local, config)
    is_floor = obb_2023.floor_plane(local, config)
    ends = obb_2023.edge_of_floor(local, is_floor, np.zeros(2), config.radius_m)
    axes[0].scatter(*local[:, :2].T, c=np.where(upright, "#2ca02c", "#999999"), s=6)
    axes[0].set_title("normals over 85° (6a)", fontsize=10)
    axes[1].scatter(*local[:, :2].T, c=np.where(is_floor, "#1f77b4", "#cccccc"), s=6)
    axes[1].plot(*ends[:, :2].T, color="#d62728", lw=2.0)
    axes[1].set_title("floor plane and its edge (6b, 6c)", fontsize=10)
    _, intensity = about(mark)
    found = intensity_histogram(intensity)
    axes[2].bar(found.edges[:-1], found.counts, np.diff(found.edges), align="edge", color="#777777")
    if found.proposed is not None:
        axes[2].axvspan(found.proposed[0], found.edges[-1], color="#ffbf00", alpha=0.35)
    axes[2].set_title("intensities, proposed range (7, 8)", fontsize=10)
    ranged = obb_2023.with_range(about, mark, config)
    line = obb_2023.follow(
        about, obb_2023.box_at(about, mark, "lane_marking", ranged), "lane_marking", ranged
    )
    middle = len(line.boxes) // 2
    shown = line.boxes[max(middle - 3, 0) : middle + 4]
    near = np.concatenate([about(box.centre[:2])[0] for box in shown])
    bright = np.concatenate([about(box.centre[:2])[1] for box in shown])
    axes[3].scatter(*(near[:, :2] - mark).T, c=bright, s=2, cmap="gray")
    for box in shown:
        outline = box.corners[[0, 2, 6, 4, 0], :2] - mark
        axes[3].plot(*outline.T, color="#1f77ff", lw=1.2)
    axes[3].plot(
        *(np.array([box.centre for box in shown])[:, :2] - mark).T, color="#d62728", marker=".", lw=1.0
    )
    axes[3].set_title("boxes that collide, centres joined (12)", fontsize=10)
    for ax in (axes[0], axes[1], axes[3]):
        ax.set_aspect("equal")
    for ax in axes:
        ax.tick_params(labelsize=7)
    return figure


def place_on(survey: SimulatedSurvey, kind: str, about: obb_2023.PointsAbout) -> np.ndarray:
    """Return the place on a true line from which the longest line is followed."""
    best, longest = None, 0
    config = obb_2023.Obb2023Config()
    for line in survey.truth[kind]:
        for place in line.xyz[10:-10:20, :2]:
            try:
                ranged = config if kind == "road_boundary" else obb_2023.with_range(about, place, config)
                found = obb_2023.follow(
                    about, obb_2023.box_at(about, place, kind, ranged), kind, ranged, max_boxes=30
                )
            except obb_2023.NoBoxError:
                continue
            if len(found.boxes) > longest:
                best, longest = place, len(found.boxes)
    assert best is not None
    return best


def stereo_figures() -> Figure:
    """Return the steps of the stereo paper on one left image."""
    with tempfile.TemporaryDirectory() as folder:
        survey = linework.simulate(Path(folder) / "survey", like="stereo-1992", length_m=40.0, seed=33)
        with opened_recordings(survey, Path(folder) / "work", laser=False) as recordings:
            stereo = recordings.stereo
            assert stereo is not None
            pair = stereo.pair(int(stereo.numbers[2]))
            images = images_of_steps(pair.left, search_window(pair.rig))
    figure, axes = panels(5, width=15.0, height=2.4)
    for ax, (name, image) in zip(axes, images.items(), strict=True):
        ax.imshow(image, cmap="gray", vmin=0, vmax=255)
        ax.set_title(name.replace("_", " "), fontsize=10)
        ax.set_axis_off()
    return figure


def run() -> int:
    """Write docs/pictures/papers_radon.png, papers_obb.png and papers_stereo.png."""
    street = simulate_survey("urban", 7, 80.0, points_per_m=9000)
    made = {
        "papers_radon.png": radon_figures(simulate_survey("motorway", 7, 120.0, points_per_m=2400)),
        "papers_obb.png": obb_figures(street),
        "papers_stereo.png": stereo_figures(),
    }
    for name, figure in made.items():
        (PICTURES / name).write_bytes(plot_png(figure))
    return 0


if __name__ == "__main__":
    raise SystemExit(run())
