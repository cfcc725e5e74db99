"""
Radon transform: every step
===========================

Manandhar and Shibasaki find guardrails in four steps [1]_: a raster image of the points, a binary image of those at
the height of a rail, the Radon transform of that image, and its peaks, which are lines. This page calls each step on
its own and draws what it returns.

.. [1] D. Manandhar, R. Shibasaki (2002), Auto-extraction of urban features from vehicle-borne laser data.
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
# Cells of 20 cm, as in the paper. Row 0 is north.

grid = grid_for(points, 0.20)
images = rasterise(points, grid)
west, north = grid.east_m, grid.north_m
extent = (0.0, grid.n_cols * grid.cell_width_m, -grid.n_rows * grid.cell_height_m, 0.0)

fig, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
axes[0].imshow(np.log1p(images.density.values), extent=extent, cmap="magma")
axes[0].set_title("density (log)")
axes[1].imshow(images.maximum.values, extent=extent, cmap="viridis")
axes[1].set_title("greatest height")

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
shown = (0.0, 180.0, float(radon.rho_m[0]), float(radon.rho_m[-1]))
picture = ax.imshow(radon.values.T, extent=shown, origin="lower", aspect="auto", cmap="magma", norm="symlog")
ax.plot(np.degrees(peaks.theta_rad), peaks.rho_m, "o", mfc="none", mec="cyan", ms=10)
ax.set(xlabel="theta [deg]", ylabel="rho [m]")
fig.colorbar(picture, label="occupied length [m]")

# %%
# The peaks as lines in the binary image.

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
ax.imshow(binary.values, extent=extent, cmap="gray_r")
centre = radon.centre_xy - (west, north)
for theta, rho in zip(peaks.theta_rad, peaks.rho_m, strict=True):
    normal, direction = np.array([np.cos(theta), np.sin(theta)]), np.array([-np.sin(theta), np.cos(theta)])
    ends = centre + rho * normal + np.outer([-100.0, 100.0], direction)
    ax.plot(*ends.T, color="tab:red", lw=1)
ax.set(xlim=extent[:2], ylim=extent[2:])

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
ax.imshow(np.where(binary.values, 0.7, 1.0), extent=extent, cmap="gray", vmin=0, vmax=1)
for start, end in zip(segments.start_xy - (west, north), segments.end_xy - (west, north), strict=True):
    ax.plot(*np.array([start, end]).T, color="tab:orange", lw=1.5)
ax.set_title("segments of seed lines")

# %%
# From here the points decide: see :doc:`rails`.

plt.show()
