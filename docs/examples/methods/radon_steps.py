"""
Radon transform: every step
===========================

Manandhar and Shibasaki find guardrails in four steps [1]_: a raster image of the points, a binary image of those at
the height of a rail, the Radon transform of that image, and its peaks, which are lines. This page calls each step on
its own and draws what it returns.

.. [1] D. Manandhar, R. Shibasaki (2002), Extraction of linear features from vehicle-borne laser data.
"""

import matplotlib.pyplot as plt
import numpy as np

import linework
from linework.imaging.raster import grid_for, in_height_band, rasterise
from linework.methods.radon.peaks import find_peaks
from linework.methods.radon.seeds import SeedConfig, find_seed_lines, split_into_segments
from linework.methods.radon.transform import evenly_spaced_angles, radon_transform
from linework.surface.road import height_above_road

survey = linework.simulate("survey", road="straight", seed=3, length_m=50.0, points_per_m=2000, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)

# %%
# Raster image
# ------------
#
# Cells of 20 cm, as in the paper. Row 0 is north. What a step returns can be drawn with ``plot``; its ``values`` are a
# NumPy array.

grid = grid_for(points, 0.20)
images = rasterise(points, grid)

fig, axes = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
images.density.plot(axes[0], norm="symlog", cmap="magma")
images.maximum.plot(axes[1])
for ax, title in zip(axes, ("number of points", "greatest height"), strict=True):
    ax.set_title(title)
    ax.tick_params("x", rotation=30)

# %%
# Binary image
# ------------
#
# Heights are taken above the road, which is found first. Guardrails are 0.2 to 1.2 m above it.

ground = linework.find_ground(points, trajectory)
height = height_above_road(ground, points.xyz)
binary = in_height_band(points.xyz, height, grid, 0.20, 1.20)
print(f"{int(binary.values.sum())} of {binary.values.size} cells are set")

# %%
# Radon transform
# ---------------
#
# One bin per direction of the line's normal (theta) and distance from the middle of the image (rho). Its value is the
# occupied length along that line, in metres: a straight rail is a bright spot.

radon = radon_transform(binary, evenly_spaced_angles(1.0))

# %%
# Peaks
# -----
#
# The transform is dilated, and a peak is where the two are equal, above a threshold.

peaks = find_peaks(
    radon.values,
    radon.angles_rad,
    radon.rho_m,
    threshold=12.0,
    theta_window_rad=np.radians(15.0),
    rho_window_m=1.0,
)
for theta, rho, strength in zip(peaks.theta_rad, peaks.rho_m, peaks.strength_m, strict=True):
    print(f"theta {np.degrees(theta):6.1f} deg, rho {rho:6.2f} m, {strength:5.1f} m long")

fig, ax = plt.subplots(figsize=(9, 4.5), layout="constrained")
radon.plot(ax, norm="symlog", cmap="magma")
peaks.plot(ax, edgecolors="cyan")

# %%
# The peaks as lines in the binary image.

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
binary.plot(ax, cmap="gray_r")
for theta, rho in zip(peaks.theta_rad, peaks.rho_m, strict=True):
    normal, direction = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    ends = radon.centre_xy + rho * normal + np.outer([-25.0, 25.0], direction)
    ax.plot(*ends.T, color="tab:red", lw=1)

# %%
# Segments
# --------
#
# A transform of the whole image finds straight roads only, so that the method takes it in windows of 6 m, and cuts the
# lines to the stretches that are occupied.

config = SeedConfig()
seeds = find_seed_lines(binary, config)
segments = split_into_segments(seeds, binary, config)
print(f"{len(seeds)} seed lines in windows of {config.window_m:g} m, {len(segments)} segments")

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
binary.plot(ax, cmap="gray_r", alpha=0.4)
segments.plot(ax)

# %%
# From here the points decide: see :doc:`rails`.
#
# All steps in one call
# ---------------------
#
# ``steps`` runs the method on points in memory and gives the result of each step, in the order of the paper: those of
# this page, and those that follow.

results = dict(linework.Radon(kinds=("guardrail",)).steps(points, trajectory))
for name, result in results.items():
    print(f"{name:24} {type(result).__name__}")

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
results["binary image"].plot(ax, cmap="gray_r", alpha=0.4)
results["lines"].plot(ax)
plt.show()
