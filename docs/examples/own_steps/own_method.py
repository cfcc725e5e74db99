"""
Your own method
===============

A method is a class with a name, the kinds of line that it finds, and ``look``, which is given the points of one tile.
It then runs as the built-in ones do: on arrays, on surveys of any size, with workers, resumed after a crash.

How wide may a load be? The method of this page finds the nearest obstacle on both sides of the van's path.
"""

import matplotlib.pyplot as plt
import numpy as np
import shapely
from scipy.spatial import cKDTree

import linework
from linework.model.tile import TileData
from linework.surface.road import height_above_road

# %%
# The method
# ----------
#
# ``look`` returns lines, and may look at all points of the tile: those of its core and of a margin around it, which is
# ``buffer_m`` wide. Lines are cut at the edge of the core, and those of neighbouring tiles are joined, so that the same
# place must give the same line in both tiles. Here the stations along the van's path see to that.


class SideClearance(linework.Method):
    """Nearest obstacle higher than a kerb, to the left and to the right of the van's path."""

    name = "clearance"
    kinds = ("clearance",)
    buffer_m = 32.0
    farthest_m = 12.0

    def look(self, piece: TileData) -> linework.LineSet:
        """Return the lines along the nearest obstacles in a tile."""
        if piece.trajectory is None or piece.surface is None:
            return linework.LineSet.empty()
        stations, headings = stations_along(piece.trajectory.xyz, 1.0)
        xyz = piece.points.xyz
        height = height_above_road(piece.surface, xyz)
        xyz = xyz[(height > 0.3) & (height < 3.0)]
        if len(xyz) == 0:
            return linework.LineSet.empty()
        distance, nearest = cKDTree(stations[:, :2]).query(xyz[:, :2], distance_upper_bound=self.farthest_m)
        xyz, nearest = xyz[np.isfinite(distance)], nearest[np.isfinite(distance)]
        offset = xyz[:, :2] - stations[nearest, :2]
        left = np.column_stack([-np.sin(headings), np.cos(headings)])[nearest]
        across = (offset * left).sum(axis=1)
        found = []
        for side in (1.0, -1.0):
            own = side * across > 0.0
            clear = np.full(len(stations), np.inf)
            np.minimum.at(clear, nearest[own], np.abs(across[own]))
            known = np.isfinite(clear)
            jump = np.abs(np.diff(np.where(known, clear, -1e3))) > 1.0
            for run in np.split(np.arange(len(stations)), np.flatnonzero(jump) + 1):
                if len(run) >= 4 and known[run].all():
                    normal = side * np.column_stack([-np.sin(headings[run]), np.cos(headings[run])])
                    xy = stations[run, :2] + clear[run, None] * normal
                    found.append(np.column_stack([xy, stations[run, 2]]))
        return linework.LineSet.from_lines(found, kind=["clearance"] * len(found))


def stations_along(path: np.ndarray, step_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stations (n, 3) every `step_m` along a path [m], and its heading there (n,) [rad from east]."""
    far = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
    at = np.arange(0.0, far[-1], step_m)
    stations = np.column_stack([np.interp(at, far, column) for column in path.T])
    ahead = np.column_stack([np.interp(at + step_m, far, column) for column in path[:, :2].T])
    behind = np.column_stack([np.interp(at - step_m, far, column) for column in path[:, :2].T])
    return stations, np.arctan2(*(ahead - behind).T[::-1])


# %%
# On arrays
# ---------

survey = linework.simulate("survey", road="urban", seed=10, length_m=90.0, points_per_m=1500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
lines = linework.extract(points, trajectory=trajectory, methods=[SideClearance()])
lines

# %%

fig, ax = plt.subplots(figsize=(9, 6), layout="constrained")
ax.scatter(points.xyz[::4, 0], points.xyz[::4, 1], c="0.85", s=0.3, rasterized=True)
ax.plot(*trajectory.xyz[:, :2].T, "k:", lw=1)
for one in lines:
    ax.plot(*one.xyz[:, :2].T, color="tab:red", lw=1.5)
ax.set_aspect("equal")

widths = cKDTree(trajectory.xyz[:, :2]).query(lines.xyz[:, :2])[0]
print(f"narrowest: {widths.min():.2f} m from the van's path")

# %%
# Beside the built-in methods
# ---------------------------

both = linework.extract(
    points, trajectory=trajectory, methods=[SideClearance(), linework.Radon(kinds=("guardrail",))]
)
print({str(kind): int((both.kind == kind).sum()) for kind in np.unique(both.kind)})

# %%
# In tiles, with workers
# ----------------------
#
# The class is sent to the worker processes, also from a notebook.
#
# A survey as short as this one is a single tile: here tiles are made small, and a function that watches the progress
# notes how many there are.

tiles = {"tiling": {"core_m": 64.0, "max_points": 10_000}}
totals: dict[str, int] = {}
in_tiles = linework.extract(
    points,
    trajectory=trajectory,
    methods=[SideClearance()],
    settings=tiles,
    workers=2,
    progress=lambda stage, done, total: totals.update({stage: total}),
)
assert totals["find lines"] > 1

# %%
# Lines that cross the edge of a tile have a vertex there; otherwise they are the same:

assert len(lines) > 0
assert in_tiles.kind.tolist() == lines.kind.tolist()
apart_m = shapely.hausdorff_distance(in_tiles.to_shapely(), lines.to_shapely()).max()
print(f"{len(lines)} lines, from {totals['find lines']} tiles at most {100 * apart_m:.1f} cm away")
assert apart_m < 0.01
plt.show()
