"""
Oriented boxes: lane markings
=============================

Paint returns more light than asphalt. In each cell of the road the method looks for a stripe that is brighter than
what lies on both sides of it, fits its two edges to the intensities, and makes it a box; boxes are tracked into lines
as those of boundaries are (:doc:`obb_boundaries`).
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

import linework
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.model.boxes import BoxForm
from linework.model.tile import TileData, local_origin

survey = linework.simulate("survey", road="straight", seed=13, length_m=50.0, points_per_m=5000, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
assert points.intensity is not None
ground = linework.find_ground(points, trajectory)

# %%
# Intensities of the road
# -----------------------

bounds = points.bounds
origin = np.array(local_origin(bounds.west, bounds.south, ground.z0_m))
path = trajectory.xyz
middle = path[len(path) // 2]
way = path[-1, :2] - path[0, :2]
way /= np.hypot(*way)
turn = np.column_stack([way, [-way[1], way[0]]])
local = (points.xyz[:, :2] - middle[:2]) @ turn
low = np.abs(points.xyz[:, 2] - middle[2]) < 0.5
shown = low & (np.abs(local[:, 0]) < 12.0) & (np.abs(local[:, 1]) < 8.0)

# %%
# Boxes
# -----
#
# A box has a centre, a direction, a length with evidence and a width: that of the paint. Its score is the probability
# that it is a piece of a marking.

tile = TileData("all", bounds.grown(1.0), points, trajectory, "", ground, (*origin,))
boxes = find_marking_boxes(tile, ground, MarkingConfig())
stripes = boxes.take(boxes.form == BoxForm.STRIPE)
print(f"{len(stripes)} stripes, median width {100 * np.median(2 * stripes.half_v_m):.0f} cm")
print(f"median contrast {np.nanmedian(stripes.contrast):.1f}")

left = np.column_stack([-stripes.u[:, 1], stripes.u[:, 0]])
signs = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)])
corners = (
    stripes.centre[:, None, :2]
    + signs[None, :, :1] * (stripes.half_u_m[:, None] * stripes.u)[:, None]
    + signs[None, :, 1:] * (stripes.half_v_m[:, None] * left)[:, None]
)
outlines = (corners + origin[:2] - middle[:2]) @ turn

fig, ax = plt.subplots(figsize=(10, 6), layout="constrained")
ax.scatter(local[shown, 0], local[shown, 1], c=points.intensity[shown], s=1, cmap="gray", rasterized=True)
ax.add_collection(LineCollection(list(outlines), colors="tab:blue", linewidths=1))
ax.set(xlim=(-12, 12), ylim=(-8, 8), aspect="equal", xlabel="along the road [m]", ylabel="to the left [m]")

# %%
# Lines
# -----
#
# Solid lines, dashed lines with each of their dashes, and what they are for: ``role`` and ``pattern``.

lines = linework.extract(points, kinds=("lane_marking", "lane_marking_dash"), trajectory=trajectory)
for one in lines["lane_marking"]:
    print(f"{one.role:10} {one.pattern:7} {one.length_m:5.1f} m long, {one.width_m:.2f} m wide")

fig, ax = plt.subplots(figsize=(10, 6), layout="constrained")
ax.scatter(local[shown, 0], local[shown, 1], c=points.intensity[shown], s=1, cmap="gray", rasterized=True)
for one in lines:
    xy = (one.xyz[:, :2] - middle[:2]) @ turn
    dash = one.kind == "lane_marking_dash"
    ax.plot(*xy.T, color="tab:red" if dash else "gold", lw=3 if dash else 1)
ax.set(xlim=(-12, 12), ylim=(-8, 8), aspect="equal", xlabel="along the road [m]", ylabel="to the left [m]")
plt.show()
