"""
Cables: spans and catenaries
============================

Wires are thin, alone in their column, straight in plan, and they hang: in the vertical plane between two supports
each is a catenary.
"""

import matplotlib.pyplot as plt
import numpy as np

import linework
from linework.lines.catenary import fit_catenary
from linework.methods.cables.band import cable_band
from linework.methods.cables.find import CableConfig, find_cables
from linework.methods.cables.seeds import find_cable_seeds
from linework.model.tile import local_origin
from linework.surface.road import height_above_ground

survey = linework.simulate("survey", road="urban", seed=6, length_m=60.0, points_per_m=2500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
config = CableConfig()

# %%
# Points that may be wires
# ------------------------
#
# Above traffic, and isolated: nothing beside them, nothing right above or below.

ground = linework.find_ground(points, trajectory)
height = height_above_ground(ground, points.xyz)
origin = np.array(local_origin(*points.xyz.min(axis=0).tolist()))
band = cable_band(points.xyz, height, config.low_m, origin)
assert band is not None
isolated = band.xyz[band.lonely]
print(f"{len(points):,} points, {len(band.xyz):,} above {config.low_m:g} m, {len(isolated):,} isolated")

# %%
# Seed lines
# ----------
#
# Peaks of the Radon transform of the isolated points in plan.

seeds = find_cable_seeds(
    np.ascontiguousarray(isolated[:, :2]), window_m=config.window_m, cell_m=config.cell_m
)
print(f"{len(seeds)} seed lines, the strongest {seeds[0].strength_m:.1f} m")

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
ax.plot(*isolated[:, :2].T, ".", ms=1, color="0.6")
for seed in seeds[:40]:
    ends = np.array([-seed.half_m, seed.half_m])
    ax.plot(seed.x + ends * seed.ux, seed.y + ends * seed.uy, color="tab:orange", lw=0.8)
low, high = isolated[:, :2].min(axis=0), isolated[:, :2].max(axis=0)
ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", title="the strongest seed lines")

# %%
# Spans
# -----
#
# Each seed is followed in its vertical slice; pieces of one wire are joined, and end at the supports.

found = find_cables(points.xyz, points.time_s, height, config)
lines, poles = found.take(found.kind == "cable"), found.take(found.kind == "pole")
print(f"{len(lines)} wires, {len(poles)} poles where they end")
for one in lines:
    print(
        f"{one.length_m:5.1f} m, {one.clearance_m:4.1f} m above the ground, confidence {one.confidence:.2f}"
    )

# %%
# One wire from the side
# ----------------------
#
# ``fit_catenary`` is the function that the method fits with, on plain arrays.

wire = lines[int(np.argmax(lines.length_m))].xyz
along = (wire[-1, :2] - wire[0, :2]) / np.hypot(*(wire[-1, :2] - wire[0, :2]))
offset = points.xyz[:, :2] - wire[0, :2]
s, across = offset @ along, offset @ np.array([-along[1], along[0]])
expected = np.interp(s, (wire[:, :2] - wire[0, :2]) @ along, wire[:, 2])
length = float(np.hypot(*(wire[-1, :2] - wire[0, :2])))
on = (np.abs(across) < 0.08) & (s > 0) & (s < length) & (np.abs(points.xyz[:, 2] - expected) < 0.08)

fit = fit_catenary(s[on], points.xyz[on, 2])
print(
    f"{int(on.sum())} points, {1000 * fit.sigma_m:.1f} mm scatter, a = {1 / fit.curve.curvature_per_m:.0f} m"
)

fig, ax = plt.subplots(figsize=(9, 4), layout="constrained")
ax.plot(s[on], points.xyz[on, 2], ".", ms=4, color="0.5", label="points")
stations = np.linspace(0.0, length, 200)
ax.plot(stations, fit.curve.height_at(stations), color="tab:red", lw=1, label="catenary")
ax.set(xlabel="along the span [m]", ylabel="height [m]")
ax.legend()
plt.show()
