"""
Oriented boxes: lane markings
=============================

Paint returns more light than asphalt. In each cell of the road the method looks for a stripe that is brighter than
what lies on both sides of it, fits its two edges to the intensities, and makes it a box; boxes are tracked into lines
as those of boundaries are (:doc:`obb_boundaries`).
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import linework
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.model.boxes import BoxForm
from linework.model.tile import TileData, local_origin

survey = linework.simulate("survey", road="straight", seed=13, length_m=50.0, points_per_m=5000, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
ground = linework.find_ground(points, trajectory)

# %%
# Boxes
# -----
#
# A box has a centre, a direction, a length with evidence and a width: that of the paint. Its score is the probability
# that it is a piece of a marking.

bounds = points.bounds
origin = local_origin(bounds.west, bounds.south, ground.z0_m)
tile = TileData("all", bounds.grown(1.0), points, trajectory, "", ground, origin)
boxes = find_marking_boxes(tile, ground, MarkingConfig())
stripes = boxes.take(boxes.form == BoxForm.STRIPE)
print(f"{len(stripes)} stripes, median width {100 * np.median(2 * stripes.half_v_m):.0f} cm")
print(f"median contrast {np.nanmedian(stripes.contrast):.1f}")

middle = trajectory.xyz[len(trajectory.xyz) // 2]
near = np.hypot(*(points.xyz - middle)[:, :2].T) < 12.0
near &= np.abs(points.xyz[:, 2] - middle[2]) < 0.5
shown = points.take(near)

fig, ax = plt.subplots(figsize=(8, 8), layout="constrained")
ax.scatter(shown.xyz[:, 0], shown.xyz[:, 1], c=shown["intensity"], s=1, cmap="gray", rasterized=True)
replace(stripes, centre=stripes.centre + np.array(origin)).plot(ax)
ax.set(xlim=(middle[0] - 9, middle[0] + 9), ylim=(middle[1] - 9, middle[1] + 9))

# %%
# Lines
# -----
#
# Solid lines, dashed lines with each of their dashes, and what they are for: ``role`` and ``pattern``.

lines = linework.extract(points, kinds=("lane_marking", "lane_marking_dash"), trajectory=trajectory)
for one in lines["lane_marking"]:
    print(f"{one.role:10} {one.pattern:7} {one.length_m:5.1f} m long, {one.width_m:.2f} m wide")

fig, ax = plt.subplots(figsize=(8, 8), layout="constrained")
ax.scatter(shown.xyz[:, 0], shown.xyz[:, 1], c=shown["intensity"], s=1, cmap="gray", rasterized=True)
lines.plot(ax)
ax.set(xlim=(middle[0] - 9, middle[0] + 9), ylim=(middle[1] - 9, middle[1] + 9))
plt.show()
