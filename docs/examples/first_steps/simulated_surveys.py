"""
A simulated survey
==================

Roads with exact ground truth, as many as you like: the kind of road, a seed and a length decide everything. The
same arguments give the same survey to the last bit.
"""

import matplotlib.pyplot as plt
import numpy as np

import linework

# %%
# The kinds of road
# -----------------

KINDS = ("straight", "bends", "urban", "motorway")
surveys = {
    kind: linework.simulate(kind, road=kind, seed=1, length_m=60.0, points_per_m=1200, images=False)
    for kind in KINDS
}
points = {kind: linework.read_points(survey) for kind, survey in surveys.items()}
paths = {kind: linework.read_trajectory(survey) for kind, survey in surveys.items()}
truths = {kind: linework.read_lines(survey.root / "truth.gpkg") for kind, survey in surveys.items()}
for kind in KINDS:
    print(f"{kind:10} {len(points[kind]):7,} points, {len(truths[kind]):3} true lines")

# %%
# A survey is a folder: points, trajectory, logs, truth, and a ``survey.toml`` that says what is what. With
# ``images=True`` there are stereo pairs too, which take seconds each.

print(
    *sorted(str(path.relative_to(surveys["urban"].root)) for path in surveys["urban"].root.rglob("*.*")),
    sep="\n",
)

# %%
# The points by height, and the true lines. Stretches of truth that no scanner could see are marked as not
# ``observed``, so that nothing is asked for that nobody could find.

fig, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
for ax, kind in zip(axes.flat, KINDS, strict=True):
    origin = paths[kind].xyz[0]
    xyz = points[kind].xyz - origin
    ax.scatter(
        xyz[::3, 0], xyz[::3, 1], c=xyz[::3, 2], s=0.3, cmap="viridis", vmin=-1, vmax=6, rasterized=True
    )
    for one in truths[kind]:
        ax.plot(*(one.xyz - origin)[:, :2].T, color="r", lw=0.8)
    ax.plot(*(paths[kind].xyz - origin)[:, :2].T, "k:", lw=1)
    ax.set_aspect("equal")
    ax.set_title(kind)

# %%
# A cross-section
# ---------------
#
# Two metres of the street, seen along the road.

street, path = points["urban"], paths["urban"].xyz
middle = len(path) // 2
along = path[middle + 1, :2] - path[middle, :2]
along /= np.hypot(*along)
offset = street.xyz[:, :2] - path[middle, :2]
s, across = offset @ along, offset @ np.array([-along[1], along[0]])
near = np.abs(s) < 1.0

fig, ax = plt.subplots(figsize=(10, 3.5), layout="constrained")
height = street.xyz[near, 2] - path[middle, 2]
ax.scatter(across[near], height, s=2, c=street["intensity"][near])
ax.set(xlabel="to the left of the van [m]", ylabel="height [m]", xlim=(-15, 15), ylim=(-1, 8))
plt.show()
