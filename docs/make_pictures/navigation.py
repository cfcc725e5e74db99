"""Make the pictures of docs/methods/navigation.md from a simulated drive: ``python docs/make_pictures/navigation.py``."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from linework.evaluation.report.scores_figure import plot_png
from linework.evaluation.report.track import track_figure
from linework.navigation.locate import locate_drive
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, WheelGrade, simulate_logs
from linework.simulation.sensors.long_drives import URBAN, long_drive

PICTURES = Path(__file__).parents[1] / "pictures"
OUTAGES_S = ((100.0, 130.0), (200.0, 320.0))


def run() -> int:
    """Write docs/pictures/navigation_track.png and navigation_outage.png."""
    rng = np.random.default_rng(8)
    drive = long_drive(URBAN, 420.0, rng)
    grades = SensorGrades(
        gnss=GNSS_2_CM, gyro=GYROS[2], wheels=WheelGrade(scale_left=0.012, scale_right=-0.006)
    )
    located = locate_drive(simulate_logs(drive, grades, rng, outages_s=OUTAGES_S))
    saved(track_figure(located), "navigation_track.png")
    saved(outage_figure(drive, located), "navigation_outage.png")
    return 0


def outage_figure(drive, located) -> Figure:
    """Draw what both tracks are really off by in the longer outage, over what they say they may be."""
    figure = Figure(figsize=(10.0, 3.6), layout="constrained", dpi=100)
    panels = figure.subplots(1, 2)
    start, end = OUTAGES_S[1]
    for ax, poses, name in zip(
        panels, (located.forward, located.trajectory), ("in real time", "smoothed"), strict=True
    ):
        inside = (poses.time_s > start - 20.0) & (poses.time_s < end + 20.0)
        time = poses.time_s[inside]
        true = np.stack([np.interp(time, drive.time_s, c) for c in drive.xyz.T], axis=1)
        off, sigma = poses.xyz[inside] - true, poses.sigma_xyz_m[inside]
        for i, axis, colour in ((0, "east", "#1f77b4"), (1, "north", "#e06c00")):
            ax.fill_between(time, -sigma[:, i], sigma[:, i], color=colour, alpha=0.2, lw=0)
            ax.plot(time, off[:, i], color=colour, lw=1.2, label=axis)
        for at in (start, end):
            ax.axvline(at, color="#888888", lw=0.8, ls=":")
        ax.set(title=f"{name}: error, band of one sigma", xlabel="time [s]", ylabel="[m]")
        ax.legend(loc="upper left", fontsize=8)
    return figure


def saved(figure: Figure, name: str) -> None:
    """Write a small PNG."""
    picture = Image.open(io.BytesIO(plot_png(figure))).convert("RGB")
    picture.quantize(128, dither=Image.Dither.NONE).save(PICTURES / name, optimize=True)


if __name__ == "__main__":
    raise SystemExit(run())
