"""
Guardrails: back to the points
==============================

A segment of the Radon transform is good to a cell of 20 cm. Circles in end view, laid along it, settle on the beam
and follow it through bends; a fit of their centres is the line, accurate to less than a centimetre.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle

import linework
from linework.imaging.raster import grid_for, in_height_band
from linework.methods.radon.method import RadonConfig
from linework.methods.radon.seeds import find_seed_lines, split_into_segments
from linework.methods.rails.chains import chains_from_starts
from linework.methods.rails.circles import bin_near, find_starts
from linework.methods.rails.rail_lines import rail_lines
from linework.methods.rails.rails import fit_rails
from linework.surface.road import height_above_ground, height_above_road

survey = linework.simulate("survey", road="bends", seed=32, length_m=60.0, points_per_m=2500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
truth = linework.read_lines(survey.root / "truth.gpkg")
config = RadonConfig()

# %%
# Segments, as on the page :doc:`radon_steps`.

ground = linework.find_ground(points, trajectory)
above_ground = height_above_ground(ground, points.xyz)
height = np.minimum(height_above_road(ground, points.xyz), above_ground)
binary = in_height_band(
    points.xyz, height, grid_for(points, config.cell_m), config.min_height_m, config.max_height_m
)
segments = split_into_segments(find_seed_lines(binary, config.seeds), binary, config.seeds)

# %%
# Circles
# -------
#
# Around each segment the points themselves are searched for a beam in end view: points over the height of a beam, none
# above, none below; or for the upper edge of a fence. What passes is a start; from there circles of 8 cm are moved along, half a metre at a time.

bins = bin_near(points.xyz, above_ground, binary)
starts = find_starts(segments, bins, config.circles)
band_m = config.circles.min_height_m, config.max_height_m
chains = chains_from_starts(starts, bins, band_m, config.profile.min_length_m, config.circles)
print(f"{len(segments)} segments, {len(starts)} starts, {len(chains)} chains of circles")

fig, ax = plt.subplots(figsize=(9, 6), layout="constrained")
origin = bins.origin[:2]
ax.scatter(bins.points[:, 0], bins.points[:, 1], s=0.3, c="0.8", rasterized=True)
for start, end in zip(segments.start_xy - origin, segments.end_xy - origin, strict=True):
    ax.plot(*np.array([start, end]).T, color="tab:orange", lw=1)
for chain in chains:
    ax.plot(*chain[:, :2].T, "o", ms=3, mfc="none", mec="tab:blue")
ax.plot(*starts[:, :2].T, "x", color="tab:purple", ms=4)
ax.set_aspect("equal")
ax.set_title("segments (orange), starts (crosses), circles (blue)")

# %%
# The line
# --------
#
# The centres are fitted locally; the vertical profile tells guardrails and barriers from hedges, walls and cars.

rails = fit_rails(chains, bins, config.circles, config.profile)
lines = rail_lines(rails, bins, ground, config.circles, config.profile)
for one in lines:
    print(f"{one.kind:10} {one.length_m:6.1f} m, confidence {one.confidence:.2f}")

# %%
# How far they are from the truth, across:

found = lines["guardrail"]
scores = linework.evaluate(found.with_crs(truth.crs), truth["guardrail"])
scores

# %%
# End view
# --------
#
# Three metres of rail, seen along it.

rail = found[0].xyz
k = len(rail) // 2
along = rail[k + 1, :2] - rail[k, :2]
along /= np.hypot(*along)
offset = points.xyz - rail[k]
s, across = offset[:, :2] @ along, offset[:, :2] @ np.array([-along[1], along[0]])
near = (np.abs(s) < 1.5) & (np.abs(across) < 1.2) & (np.abs(offset[:, 2]) < 1.2)

fig, ax = plt.subplots(figsize=(6, 5), layout="constrained")
ax.plot(across[near], offset[near, 2], ".", ms=3, color="0.6")
radius = config.circles.radius_m
ax.add_patch(Rectangle((-radius, -config.circles.sheet_m), 2 * radius, config.circles.sheet_m, fill=False))
ax.plot(0, 0, "o", ms=8, mfc="none", mec="tab:red")
ax.set(xlabel="across [m]", ylabel="above the top edge [m]", aspect="equal")
plt.show()
