"""
Your own peak finder
====================

The Radon method finds peaks by dilation. You want to try another way: pass a function, and everything else stays as
it is: windows, segments, circles, tiles, workers, resuming.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely
from scipy import ndimage

import linework
from linework.arrays import FloatArray
from linework.imaging.raster import grid_for, in_height_band
from linework.methods.radon.peaks import find_peaks
from linework.methods.radon.transform import evenly_spaced_angles, radon_transform
from linework.surface.road import height_above_road

# %%
# The function
# ------------
#
# It gets the Radon image of one window, (n_angles, n_rho), with the angles and distances of its bins, and the
# parameters of the method; it returns theta, rho and strength of each peak. This one smooths the image first, so that
# a rail with a gap is one peak.


def smooth_peaks(
    values: FloatArray,
    angles_rad: FloatArray,
    rho_m: FloatArray,
    *,
    threshold: float,
    theta_window_rad: float,
    rho_window_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the peaks of a smoothed Radon image."""
    smooth = ndimage.gaussian_filter(values, sigma=(1.0, 0.5), mode=("wrap", "constant"))
    across = max(1, round(theta_window_rad / float(angles_rad[1] - angles_rad[0])))
    along = max(1, round(rho_window_m / float(rho_m[1] - rho_m[0])))
    highest = ndimage.maximum_filter(smooth, size=(2 * (across // 2) + 1, 2 * (along // 2) + 1), mode="wrap")
    rows, cols = np.nonzero((smooth == highest) & (values > threshold))
    return angles_rad[rows], rho_m[cols], values[rows, cols]


# %%
# The two side by side
# --------------------

survey = linework.simulate("survey", road="straight", seed=3, length_m=90.0, points_per_m=1500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
truth = linework.read_lines(survey.root / "truth.gpkg")
ground = linework.find_ground(points, trajectory)
height = height_above_road(ground, points.xyz)
binary = in_height_band(points.xyz, height, grid_for(points, 0.20), 0.20, 1.20)
radon = radon_transform(binary, evenly_spaced_angles(1.0))

fig, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
extent = (0.0, 180.0, float(radon.rho_m[0]), float(radon.rho_m[-1]))
given = find_peaks(
    radon.values, radon.angles_rad, radon.rho_m,
    threshold=15.0, theta_window_rad=np.radians(15.0), rho_window_m=1.0,
)  # fmt: skip
own_theta, own_rho, _ = smooth_peaks(
    radon.values, radon.angles_rad, radon.rho_m,
    threshold=15.0, theta_window_rad=np.radians(15.0), rho_window_m=1.0,
)  # fmt: skip
for ax, theta, rho, title in (
    (axes[0], given.theta_rad, given.rho_m, "dilation"),
    (axes[1], own_theta, own_rho, "own"),
):
    ax.imshow(radon.values.T, extent=extent, origin="lower", aspect="auto", cmap="magma", norm="symlog")
    ax.plot(np.degrees(theta), rho, "o", mfc="none", mec="cyan", ms=10)
    ax.set(title=title, xlabel="theta [deg]", ylabel="rho [m]")

# %%
# In the method
# -------------

lines = linework.extract(
    points,
    trajectory=trajectory,
    methods=[linework.Radon(kinds=("guardrail",), find_peaks=smooth_peaks)],
)
print(linework.evaluate(lines, truth["guardrail"]))

# %%
# In tiles, with workers
# ----------------------
#
# The function is sent to the worker processes, also from a notebook.
#
# A survey as short as this one is a single tile: here tiles are made small, and a function that watches the progress
# notes how many there are.

tiles = {"tiling": {"core_m": 64.0, "max_points": 10_000}}
totals: dict[str, int] = {}
in_tiles = linework.extract(
    points,
    trajectory=trajectory,
    methods=[linework.Radon(kinds=("guardrail",), find_peaks=smooth_peaks)],
    settings=tiles,
    workers=2,
    progress=lambda stage, done, total: totals.update({stage: total}),
)
assert totals["find lines"] > 1

# %%
# Lines that cross the edge of a tile have a vertex there; otherwise they are the same:

assert len(lines) > 0
assert in_tiles.kind.tolist() == lines.kind.tolist()
apart_m = shapely.hausdorff_distance(in_tiles.to_shapely(), lines.to_shapely()).max()
print(f"{len(lines)} lines, from {totals['find lines']} tiles at most {100 * apart_m:.1f} cm away")
assert apart_m < 0.01
plt.show()
