"""
Stereo pairs: from bright pixels to lines in the world
======================================================

He and Novak find lane markings in pairs of images [1]_: bright lines in each row, thinned to their middle, followed
from row to row, matched between the two images and intersected.

.. [1] G. He, K. Novak (1992), Automatic analysis of highway features from digital stereo-images, ISPRS XXIX-B3.
"""

import matplotlib.pyplot as plt
import numpy as np

from linework.imaging.rectify import rectifier_of
from linework.kernels.images.row_stripes import COL, ROW
from linework.methods.protocol import SurveyContext
from linework.methods.stereo.method import Stereo
from linework.methods.stereo.road_plane import fit_pair_road
from linework.methods.stereo.sighted import sightings_of
from linework.methods.stereo.stripes import StripeConfig, find_stripe_lines
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.cameras import images_of, stereo_survey

# %%
# Pairs
# -----
#
# A van with two cameras drives 40 m and takes a pair every 10 m. The images are resampled so that what one camera
# shows in a row, the other one shows in the same row.

drive = stereo_survey(draw_scenario("straight", 1, 40.0), size="732x484", every_m=10.0, rays_per_pixel=1)
rectifier = rectifier_of(drive.rig)
pairs = [
    RectifiedPair(*rectifier.rectified(pair.left, pair.right), rectifier.rig, pair.number, pair.time_s)
    for pair in images_of(drive)
]
pair = pairs[0]
fig, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for ax, image, side in zip(axes, (pair.left, pair.right), ("left", "right"), strict=True):
    ax.imshow(image, cmap="gray")
    ax.set_title(side)

# %%
# The road
# --------
#
# A plane through the disparities in front of the van. It says how wide paint is in each row, and where it may be.

road = fit_pair_road(pair)
assert road is not None
print(f"the camera is {road.plane.camera_height_m(pair.rig):.2f} m above the road")

# %%
# Bright lines
# ------------
#
# In each row: a rise and a fall of grey values, as far apart as paint is wide there. The middle of the two is the
# thinned line. Middles that continue each other from row to row are one line.

config = StripeConfig()
stripes = find_stripe_lines(pair, road, config)
number, n_rows = np.unique(stripes.line, return_counts=True)
long = number[(number >= 0) & (n_rows >= 4)]
on_line = np.isin(stripes.line, long)
print(
    f"{len(stripes.table)} stripes, {int(on_line.sum())} of them on {len(long)} lines through four rows or more"
)

fig, ax = plt.subplots(figsize=(9, 6), layout="constrained")
ax.imshow(pair.left, cmap="gray")
ax.scatter(stripes.table[~on_line, COL], stripes.table[~on_line, ROW], s=2, c="tab:blue")
ax.scatter(
    stripes.table[on_line, COL], stripes.table[on_line, ROW], s=2, c=stripes.line[on_line], cmap="autumn"
)

# %%
# Into the world
# --------------
#
# The difference of the columns in the two images is the distance. Each place becomes a point in front of the van, with
# its covariance.

seen = sightings_of(pair, road, stripes, config)
print(f"{len(seen)} places on paint, {seen.xyz[:, 0].min():.0f} to {seen.xyz[:, 0].max():.0f} m ahead")

# %%
# Lanes
# -----
#
# Places of all pairs are put together by the poses of the van: where several pairs show the same paint they are
# averaged, weighted by their accuracy, and joined into lines.

method = Stereo()
found = Sightings.concatenate([method.look(one) for one in pairs])
lines = method.join(found, SurveyContext(poses=drive.poses, rig=rectifier.rig))
for one in lines["lane_marking"]:
    print(f"{one.role:10} {one.pattern:7} {one.length_m:5.1f} m")

origin = drive.poses.xyz[0, :2]
fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
for number in np.unique(found.pair):
    xyz = drive.poses.to_world(int(number), found.xyz[found.pair == number])
    ax.plot(*(xyz[:, :2] - origin).T, ".", ms=2, color="0.6")
for one in lines["lane_marking"]:
    ax.plot(*(one.xyz[:, :2] - origin).T, lw=1)
ax.plot(*(drive.poses.xyz[:, :2] - origin).T, "k+", ms=10)
ax.set_aspect("equal")
ax.set_title("places of all pairs (grey), lines, and the van (crosses)")
plt.show()
