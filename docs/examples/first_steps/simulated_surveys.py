"""
A simulated survey
==================

Roads with exact ground truth, as many as you like: the kind of road, a seed and a length decide everything. The
same arguments give the same survey to the last bit.
"""

import matplotlib.pyplot as plt
import numpy as np

from linework.simulation.simulate import simulate_survey

# %%
# The kinds of road
# -----------------

KINDS = ("straight", "bends", "urban", "motorway")
surveys = {kind: simulate_survey(kind, seed=1, length_m=60.0, points_per_m=1200) for kind in KINDS}
for kind, survey in surveys.items():
    print(f"{kind:10} {len(survey.points):7,} points, {len(survey.truth):3} true lines")

# %%
# The points by height, and the true lines. Stretches of truth that no scanner could see are marked as not
# ``observed``, so that nothing is asked for that nobody could find.

fig, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
for ax, (kind, survey) in zip(axes.flat, surveys.items(), strict=True):
    origin = survey.trajectory.xyz[0]
    xyz = survey.points.xyz - origin
    ax.scatter(*xyz[::3, :2].T, c=xyz[::3, 2], s=0.3, cmap="viridis", vmin=-1, vmax=6, rasterized=True)
    for one in survey.truth:
        ax.plot(*(one.xyz - origin)[:, :2].T, color="r", lw=0.8)
    ax.plot(*(survey.trajectory.xyz - origin)[:, :2].T, "k:", lw=1)
    ax.set_aspect("equal")
    ax.set_title(kind)

# %%
# A cross-section
# ---------------
#
# Two metres of the street, seen along the road.

street = surveys["urban"]
path = street.trajectory.xyz
middle = len(path) // 2
along = path[middle + 1, :2] - path[middle, :2]
along /= np.hypot(*along)
offset = street.points.xyz[:, :2] - path[middle, :2]
s, across = offset @ along, offset @ np.array([-along[1], along[0]])
near = np.abs(s) < 1.0

fig, ax = plt.subplots(figsize=(10, 3.5), layout="constrained")
height = street.points.xyz[near, 2] - path[middle, 2]
ax.scatter(
    across[near], height, s=2, c=None if street.points.intensity is None else street.points.intensity[near]
)
ax.set(xlabel="to the left of the van [m]", ylabel="height [m]", xlim=(-15, 15), ylim=(-1, 8))
plt.show()
