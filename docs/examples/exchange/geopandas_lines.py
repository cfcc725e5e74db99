"""
Lines and GeoPandas
===================

A set of lines becomes a GeoDataFrame with geometry, CRS and all attributes, and comes back with nothing lost: heights,
standard deviations and flags of each vertex travel as lists.
"""

import matplotlib.pyplot as plt

import linework

survey = linework.simulate("survey", road="urban", seed=10, length_m=60.0, points_per_m=2500, images=False)
lines = linework.extract(survey)

# %%
# To GeoPandas
# ------------

frame = lines.to_geopandas()
frame[["kind", "role", "confidence", "geometry"]].head()

# %%
# Everything that GeoPandas does works: lengths by kind, a corridor of half a metre around the guardrails, what lies in
# it.

print(frame.assign(length_m=frame.length).groupby("kind")["length_m"].sum().round(1))
corridor = frame[frame["kind"] == "guardrail"].buffer(0.5)
print(f"corridor: {corridor.area.sum():.0f} square metres")

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
frame.plot(ax=ax, column="kind", legend=True, linewidth=1)
corridor.plot(ax=ax, alpha=0.3)
ax.set_aspect("equal")

# %%
# And back
# --------

back = linework.LineSet.from_geopandas(frame)
print("the same lines:", back == lines)
assert back == lines

# %%
# Your own frame becomes lines too, to be evaluated or written in any format: it needs a geometry and a column ``kind``.

mine = frame[frame["kind"] == "road_boundary"][["kind", "geometry"]]
print(linework.evaluate(lines, linework.LineSet.from_geopandas(mine), kinds="road_boundary"))

# %%
# Other libraries
# ---------------
#
# Whatever reads ``__geo_interface__`` takes lines as they are; shapely geometries keep the heights.

shapes = lines.to_shapely()
print(shapes[0].geom_type, "with heights" if shapes[0].has_z else "without heights")
print(lines.__geo_interface__["type"], len(lines.__geo_interface__["features"]))
plt.show()
