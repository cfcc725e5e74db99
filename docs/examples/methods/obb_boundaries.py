"""
Oriented boxes: road boundaries
===============================

Kang, Lee and Lee follow the edge of the road through small search areas [1]_: in each, the points with the normal of
the road are its floor, and the edge of that floor is a piece of boundary, an oriented box. Boxes that collide when
they are moved on are one line.

.. [1] Seokchan Kang, Jeongwon Lee, Jiyeong Lee (2023), Developing a Method to Automatically Extract Road Boundary and
       Linear Road Markings from a Mobile Mapping System Point Cloud Using Oriented Bounding Box Collision-Detection
       Techniques, Remote Sensing 15(19), 4656, `doi:10.3390/rs15194656 <https://doi.org/10.3390/rs15194656>`_.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial import cKDTree

import linework
from linework.methods.obb.kerbs_and_edges import BoundaryConfig, find_boundary_boxes
from linework.methods.obb.search_area import SearchArea
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm
from linework.model.tile import TileData, local_origin

survey = linework.simulate("survey", road="urban", seed=10, length_m=60.0, points_per_m=3000, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
truth = linework.read_lines(survey.root / "truth.gpkg")
ground = linework.find_ground(points, trajectory)

# %%
# A search area
# -------------
#
# A disc of half a metre on a kerb, where most points are. Its lowest plane is the road; what lies above it is kerb and pavement.

bounds = points.bounds
origin = np.array(local_origin(bounds.west, bounds.south, ground.z0_m))
kerb = truth["road_boundary"][0].xyz
n_near = cKDTree(points.xyz[:, :2]).query_ball_point(kerb[:, :2], 0.5, return_length=True)
place = kerb[int(np.argmax(n_near))] - origin
area = SearchArea.of(points.xyz - origin, place[:2])
above = area.above_m()
floor = above < 0.02
print(
    f"{len(area.xyz)} points, {int(floor.sum())} of them on the floor, the rest up to {above.max():.2f} m above it"
)

fig = plt.figure(figsize=(7, 5), layout="constrained")
ax = fig.add_subplot(projection="3d")
local = area.xyz - place
ax.scatter(local[floor, 0], local[floor, 1], local[floor, 2], c="0.6", s=4, label="floor")
ax.scatter(local[~floor, 0], local[~floor, 1], local[~floor, 2], c="tab:red", s=4, label="above")
ax.set(xlabel="east [m]", ylabel="north [m]", zlabel="height [m]", zlim=(-0.3, 0.3))
ax.legend()

# %%
# Boxes
# -----
#
# The same everywhere, without an operator: in each cell of the ground, the line where floor and face of a kerb meet,
# or where smooth pavement becomes rough.

tile = TileData("all", bounds.grown(1.0), points, trajectory, "", ground, (*origin,))
boxes = find_boundary_boxes(tile, ground, BoundaryConfig())
for form in (BoxForm.KERB, BoxForm.EDGE, BoxForm.BARRIER):
    print(f"{form.name.lower():8} {int((boxes.form == form).sum()):4} boxes")

# %%
# Tracking by collision
# ---------------------
#
# Each box is moved on along its direction by the search length; the boxes that it hits continue the line.

kerbs = boxes.take(boxes.form == BoxForm.KERB)
tracks = track_lines(kerbs, TrackConfig(), width_m=0.15)
print(f"{len(tracks)} lines through {len(kerbs)} boxes")

fig, ax = plt.subplots(figsize=(9, 6), layout="constrained")
step = kerbs.half_u_m[:, None] * kerbs.u
for a, b in zip(kerbs.centre[:, :2] - step, kerbs.centre[:, :2] + step, strict=True):
    ax.plot(*np.array([a, b]).T, color="0.6", lw=3)
for i in range(len(tracks)):
    index, _ = tracks.line(i)
    ax.plot(*kerbs.centre[index, :2].T, lw=1)
ax.set_aspect("equal")
ax.set_title("boxes of kerbs (grey) and the lines through them")

# %%
# The whole method
# ----------------
#
# ``Obb`` does all of this, smooths the lines, and adds the top edge of each kerb. ``steps`` gives the result of each
# step in its order; boxes and lines can be drawn.

results = dict(linework.Obb(kinds=("road_boundary", "kerb_top")).steps(points, trajectory))
for name, result in results.items():
    print(f"{name:20} {type(result).__name__}")

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
results["boundary boxes"].plot(ax)
results["lines"].plot(ax, linewidths=0.8)
plt.show()
