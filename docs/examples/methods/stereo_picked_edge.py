"""
Stereo pairs: following an edge from one pixel
==============================================

The second approach of He and Novak [1]_ starts from a pixel that a person picks: the profile of grey values across
the line is matched step by step, in both images at once, through the pair and then into the pairs before and after.

.. [1] G. He, K. Novak (1992), Automatic analysis of highway features from digital stereo-images, ISPRS XXIX-B3.
"""

import matplotlib.pyplot as plt
import numpy as np

from linework.imaging.rectify import rectifier_of
from linework.methods.picked_edge.method import NoEdgeAtPixelError, PosedPairs, follow_picked
from linework.methods.stereo.method import Stereo
from linework.model.images import RectifiedPair
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.cameras import images_of, stereo_survey

drive = stereo_survey(draw_scenario("straight", 1, 40.0), size="732x484", every_m=10.0, rays_per_pixel=1)
rectifier = rectifier_of(drive.rig)
pairs = {
    pair.number: RectifiedPair(
        *rectifier.rectified(pair.left, pair.right), rectifier.rig, pair.number, pair.time_s
    )
    for pair in images_of(drive)
}

# %%
# A pick
# ------
#
# In place of a person, this script picks a pixel on the longest line of paint that the first pair shows.

first = pairs[0]
seen = Stereo().look(first)
on = seen.take(seen.line == int(np.argmax(np.bincount(seen.line))))
col, row = float(on.col[len(on) // 2]), float(on.row[len(on) // 2])
print(f"picked: column {col:.0f}, row {row:.0f}")

# %%
# Following
# ---------
#
# ``follow_picked`` is a generator: it yields the line as each pair shows it, so that a program can draw it while it
# grows, and returns the whole line.

series = PosedPairs(pairs.__getitem__, list(pairs), drive.poses)
following = follow_picked(series, (0, col, row))
steps = []
while True:
    try:
        steps.append(next(following))
    except StopIteration as finished:
        edge = finished.value
        break
print(
    f"{edge.kind}, {edge.lines.length_m[0]:.1f} m through {len(steps)} pairs; it ends: {[str(s) for s in edge.stops]}"
)

fig, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for ax, image, pixels in zip(
    axes, (first.left, first.right), (steps[0].left_px, steps[0].right_px), strict=True
):
    ax.imshow(image, cmap="gray")
    ax.plot(*pixels.T, color="yellow", lw=2)
axes[0].plot(col, row, "r+", ms=14)

# %%
# In the world
# ------------

line, origin = edge.lines[0], drive.poses.xyz[0, :2]
fig, ax = plt.subplots(figsize=(9, 4), layout="constrained")
for step in steps:
    ax.plot(*(step.xyz[:, :2] - origin).T, ".", ms=3, label=f"pair {step.number}")
ax.plot(*(line.xyz[:, :2] - origin).T, "k", lw=1, label="line")
ax.set_aspect("equal")
ax.legend(fontsize=8)
print(f"sigma across, median: {100 * float(np.nanmedian(line.sigma_xy_m)):.1f} cm")

# %%
# No edge here
# ------------
#
# A pixel that is on no edge is refused, with the nearest one that works.

try:
    next(follow_picked(series, (0, col + 30.0, row)))
except NoEdgeAtPixelError as error:
    print(error)
plt.show()
