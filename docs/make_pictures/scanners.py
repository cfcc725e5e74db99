"""Make the pictures of scanners in docs/simulation.md: ``python docs/make_pictures/scanners.py``."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from linework.evaluation.report.scores_figure import plot_png
from linework.simulation.simulate import SimulatedSurvey, simulate_survey

PICTURES = Path(__file__).parents[1] / "pictures"
#: The stretch of street that is shown, from and to: chainages, offsets. [m]
STRETCH_M, ACROSS_M = (21.0, 35.0), (-7.0, 7.0)
STREET = {"kind": "urban", "seed": 3, "length_m": 60.0}
SCANNERS = ("one", "tilted", "spinning16", "spinning64", "airborne", "terrestrial")
#: Seeds of the surveys under hard conditions.
HARD_SEEDS = (1, 2, 3, 7, 8)


def run() -> int:
    """Write docs/pictures/scanners_lines.png and scanners_hard.png."""
    saved(drawn_lines(), "scanners_lines.png")
    saved(drawn_conditions(), "scanners_hard.png")
    return 0


def saved(figure: Figure, name: str) -> None:
    """Write a figure in few colours."""
    picture = Image.open(io.BytesIO(plot_png(figure))).convert("RGB")
    picture.quantize(48, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)


def on_the_street(survey: SimulatedSurvey) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the points below 0.5 m in the stretch shown, and their chainages and offsets."""
    road, local = survey.scenario.layout.road, survey.points.xyz - np.asarray(survey.scenario.origin_m)
    s, q = road.alignment.locate(local[:, :2])
    inside = (s > STRETCH_M[0]) & (s < STRETCH_M[1]) & (q > ACROSS_M[0]) & (q < ACROSS_M[1])
    low = local[:, 2] - road.carriageway_height(s, q) < 0.5
    shown = np.flatnonzero(inside & low)
    return shown, np.stack([s[shown], q[shown]], axis=1)


def drawn_lines() -> Figure:
    """Return each scanner's points in plan, each scan line in one of ten colours."""
    figure = Figure(figsize=(11, 7.8), layout="constrained")
    figure.get_layout_engine().set(h_pad=0.12)
    for ax, scanner in zip(figure.subplots(2, 3, sharex=True, sharey=True).flat, SCANNERS, strict=True):
        dense = None if scanner == "airborne" else 2500.0
        survey = simulate_survey(**STREET, points_per_m=dense, scanner=scanner)
        shown, place = on_the_street(survey)
        ax.scatter(*place.T, c=survey.sweep[shown] % 10, s=2.0, lw=0, cmap="tab10", vmin=0, vmax=9)
        ax.set(title=scanner, xlim=STRETCH_M, ylim=ACROSS_M, aspect="equal")
    figure.supxlabel("along the street [m]")
    figure.supylabel("across [m]")
    return figure


def drawn_conditions() -> Figure:
    """Return brightness in plan of streets under usual and hard conditions."""
    figure = Figure(figsize=(11, 7.8), layout="constrained")
    figure.get_layout_engine().set(h_pad=0.12)
    surveys = {"usual, seed 3": simulate_survey(**STREET, points_per_m=9000.0)}
    for seed in HARD_SEEDS:
        surveys[f"hard, seed {seed}"] = simulate_survey(
            **STREET | {"seed": seed}, points_per_m=9000.0, conditions="hard"
        )
    for ax, (title, survey) in zip(
        figure.subplots(2, 3, sharex=True, sharey=True).flat, surveys.items(), strict=True
    ):
        shown, place = on_the_street(survey)
        top = 2**survey.scenario.sensor.intensity_bits - 1
        value = survey.points.intensity[shown]
        ax.scatter(*place.T, c=value, s=1.5, lw=0, cmap="gray", vmin=0, vmax=np.quantile(value, 0.995))
        full = np.mean(value >= top)
        ax.set(title=f"{title}: {value.min():.0f} to {value.max():.0f}, {full:.0%} full", facecolor="#8090c0")
        ax.set(xlim=STRETCH_M, ylim=ACROSS_M, aspect="equal")
    figure.supxlabel("along the street [m]")
    figure.supylabel("across [m]")
    return figure


if __name__ == "__main__":
    raise SystemExit(run())
