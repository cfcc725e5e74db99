"""
Your own ground
===============

All methods take heights above the road and the ground. You have a better terrain model, or an idea for one: pass it
as a ``Ground``, or as a function that makes one from the points.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely
from scipy import ndimage

import linework
from linework.model.grid import Grid

survey = linework.simulate("survey", road="bends", seed=7, length_m=90.0, points_per_m=1500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
truth = linework.read_lines(survey.root / "truth.gpkg")

# %%
# A function
# ----------
#
# The simplest ground: the lowest point in each cell of half a metre, smoothed, holes filled from the nearest cell. The
# road is where the van drove, and six metres to either side.


def lowest_cells(points: linework.Points, trajectory: linework.Trajectory | None) -> linework.Ground:
    """Return the ground through the lowest point of each cell."""
    bounds = points.bounds
    grid = Grid.covering(bounds, 0.5)
    rows, cols = (np.floor(v).astype(np.int64) for v in grid.to_cell(points.xyz[:, :2]))
    lowest = np.full(grid.shape, np.inf)
    np.minimum.at(lowest, (rows, cols), points.xyz[:, 2])
    empty = ~np.isfinite(lowest)
    index = ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True)
    filled = ndimage.median_filter(lowest[tuple(index)], size=5)
    near = np.ones(grid.shape, dtype=bool)
    if trajectory is not None:
        driven = np.zeros(grid.shape, dtype=bool)
        at = [np.floor(v).astype(np.int64) for v in grid.to_cell(trajectory.xyz[:, :2])]
        inside = (at[0] >= 0) & (at[0] < grid.n_rows) & (at[1] >= 0) & (at[1] < grid.n_cols)
        driven[at[0][inside], at[1][inside]] = True
        near = ndimage.distance_transform_edt(~driven) * 0.5 < 6.0
    return linework.Ground.from_heights(filled, grid, is_road=near)


ground = lowest_cells(points, trajectory)
ground

# %%
# Against linework's own
# ----------------------

given = linework.find_ground(points, trajectory)
fig, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
for ax, shown, title in ((axes[0], given, "find_ground"), (axes[1], ground, "own")):
    shown.plot(ax, cmap="terrain")
    ax.set_title(title)

places = trajectory.xyz
difference = ground.height_m(places) - given.height_m(places)
print(f"under the van they differ by {100 * np.median(np.abs(difference)):.1f} cm")

# %%
# Lines with it
# -------------

lines = linework.extract(points, kinds="guardrail", trajectory=trajectory, ground=lowest_cells)
print(linework.evaluate(lines, truth["guardrail"]))

# %%
# A ``Ground`` that is there already is passed as it is:

same = linework.extract(points, kinds="guardrail", trajectory=trajectory, ground=ground)
assert len(lines) > 0
assert same == lines

# %%
# In tiles, with workers
# ----------------------
#
# The function is sent to the worker processes, also from a notebook.
#
# A survey as short as this one is a single tile: here tiles are made small, and a function that watches the progress
# notes how many there are.

tiles = {"tiling": {"core_m": 64.0, "max_points": 10_000}}
totals: dict[str, int] = {}
in_tiles = linework.extract(
    points,
    kinds="guardrail",
    trajectory=trajectory,
    ground=lowest_cells,
    settings=tiles,
    workers=2,
    progress=lambda stage, done, total: totals.update({stage: total}),
)
assert totals["find lines"] > 1

# %%
# Lines that cross the edge of a tile have a vertex there; otherwise they are the same:

assert in_tiles.kind.tolist() == lines.kind.tolist()
apart_m = shapely.hausdorff_distance(in_tiles.to_shapely(), lines.to_shapely()).max()
print(f"{len(lines)} lines, from {totals['find lines']} tiles at most {100 * apart_m:.1f} cm away")
assert apart_m < 0.01
plt.show()
