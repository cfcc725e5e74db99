"""
First lines, from arrays
========================

You have points in an array, from whatever program or format: this page makes lines of them and draws them.
"""

import laspy
import matplotlib.pyplot as plt
import numpy as np

import linework

# %%
# Points
# ------
#
# A simulated street, read with laspy, stands in for your data. All that is needed is an (n, 3) array of east, north and height in
# metres; intensities are needed for lane markings, times help to tell one pass of the van from another.

survey = linework.simulate("survey", road="urban", seed=10, length_m=60.0, points_per_m=2500, images=False)
las = laspy.read(survey.point_files[0])
xyz, intensity, time_s = np.asarray(las.xyz), np.asarray(las.intensity), np.asarray(las.gps_time)

points = linework.Points(xyz, intensity=intensity, time_s=time_s, crs="EPSG:25832+7837")
points

# %%
# Coordinates that belong to no place on earth are ``crs="local"``, which is also what you get without ``crs``.
#
# Lines
# -----
#
# One call. The order of the points does not matter, and nothing has to be chosen by hand. With the path of the van
# the road is found below it; without, from the points alone.

lines = linework.extract(points, trajectory=linework.read_trajectory(survey))
lines

# %%
# What was found, by kind. ``lines["guardrail"]`` is again a set of lines, ``lines[0]`` is one line with its vertices.

for kind in np.unique(lines.kind):
    found = lines[str(kind)]
    print(f"{kind:20} {len(found):3} lines {found.length_m.sum():8.1f} m")

# %%
# Each vertex has its own standard deviation, and a flag where the line was carried across a gap instead of being
# measured.

longest = lines[int(np.argmax(lines.length_m))]
print(longest.kind, f"{longest.length_m:.1f} m")
print("sigma across, median [m]:", np.round(np.nanmedian(longest.sigma_xy_m), 4))
print("bridged vertices:", int(longest.bridged.sum()), "of", len(longest.xyz))

# %%
# The picture
# -----------

fig, ax = plt.subplots(figsize=(9, 6), layout="constrained")
ground = np.asarray(points.xyz[:, 2] < np.quantile(points.xyz[:, 2], 0.8))
ax.scatter(points.xyz[ground, 0], points.xyz[ground, 1], c="0.85", s=0.2, rasterized=True)
lines.plot(ax=ax)
ax.set_aspect("equal")

# %%
# A file for QGIS
# ---------------
#
# The suffix decides the format.

linework.write_lines(lines, "street.gpkg")
print(linework.read_lines("street.gpkg") == lines)
plt.show()
