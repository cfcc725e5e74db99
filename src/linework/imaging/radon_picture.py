"""Picture of a Radon image, with its peaks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure

from linework.arrays import FloatArray
from linework.imaging.overview import reduced
from linework.imaging.picture import DPI, LINE_COLOUR, PANEL_CELLS, png


def draw_radon(
    values: FloatArray,
    angles_rad: FloatArray,
    rho_m: FloatArray,
    *,
    title: str,
    peaks: tuple[FloatArray, FloatArray] | None = None,
    names: Sequence[str] = (),
) -> bytes:
    """Return a PNG of Radon values (n_angles, n_rho), theta to the right and rho up.

    Parameters
    ----------
    peaks
        theta [rad] and rho [m] of peaks to mark, or None.
    names
        A short name for each peak, the same as on the map of the lines.
    """
    small, factor = reduced(values.T, PANEL_CELLS)
    theta_deg = np.degrees(angles_rad)
    step_deg = 180.0 / len(theta_deg)
    rho_step = float(rho_m[1] - rho_m[0]) if len(rho_m) > 1 else 1.0
    left, low = float(theta_deg[0]) - 0.5 * step_deg, float(rho_m[0]) - 0.5 * rho_step
    figure = Figure((11.0, 8.0), DPI, layout="constrained")
    ax = figure.add_subplot()
    drawn = ax.imshow(
        small, cmap="inferno", norm=PowerNorm(0.5, 0.0, max(float(values.max(initial=0.0)), 1e-6)), aspect="auto", origin="lower", interpolation="nearest",
        extent=(left, left + factor * step_deg * small.shape[1], low, low + factor * rho_step * small.shape[0]),
    )  # fmt: skip
    ax.set_xlim(left, left + step_deg * len(theta_deg))
    ax.set_ylim(low, low + rho_step * len(rho_m))
    ax.set_xlabel("theta: direction of the line's normal, anticlockwise from east [°]")
    ax.set_ylabel("rho: distance of the line from the image's centre [m]")
    figure.colorbar(drawn, ax=ax, pad=0.01).set_label(
        "occupied length in the strip [m], colours by its square root"
    )
    figure.suptitle(title, fontsize=13, weight="bold")
    if peaks is not None:
        ax.plot(
            np.degrees(peaks[0]), peaks[1], "o", markersize=9, markerfacecolor="none",
            markeredgecolor="#35d0ff", markeredgewidth=1.3, label="peak = candidate line",
        )  # fmt: skip
        for k, (theta, rho, name) in enumerate(zip(*peaks, names, strict=True)):
            aside = ((8, 6), (8, -12), (-16, 6), (-16, -12))[k % 4]
            ax.annotate(
                name, (float(np.degrees(theta)), float(rho)), xytext=aside, textcoords="offset points",
                fontsize=8, color="white", bbox={"boxstyle": "round,pad=0.15", "facecolor": LINE_COLOUR},
            )  # fmt: skip
        ax.legend(loc="upper right", fontsize=8)
    return png(figure)
