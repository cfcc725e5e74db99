"""
Lines in DuckDB and polars
==========================

Lines are an Arrow stream: a row per line, its geometry in GeoArrow, lists for what is known of each vertex. Any library
that reads Arrow takes them as they are, without a file in between.
"""

import duckdb
import matplotlib.pyplot as plt
import polars as pl

import linework

survey = linework.simulate("survey", road="urban", seed=10, length_m=60.0, points_per_m=2500, images=False)
lines = linework.extract(survey)

# %%
# SQL
# ---
#
# DuckDB finds the variable by its name.

summary = duckdb.sql("""
    SELECT kind, count(*) AS lines, round(avg(confidence), 2) AS confidence, avg(len(sigma_xy_m)) AS vertices
    FROM lines
    GROUP BY kind
    ORDER BY kind
""")
print(summary)

# %%
# Which lines have vertices that are worse than 5 cm?

worse = duckdb.sql("""
    SELECT kind, count(*) AS vertices
    FROM (SELECT kind, unnest(sigma_xy_m) AS sigma_m FROM lines)
    WHERE sigma_m > 0.05
    GROUP BY kind
    ORDER BY kind
""")
print(worse)

# %%
# polars
# ------

frame = pl.DataFrame(lines)
best = (
    frame.explode("sigma_xy_m")
    .filter(pl.col("sigma_xy_m").is_not_nan())
    .group_by("kind")
    .agg(pl.col("sigma_xy_m").median().alias("median_sigma_m"))
    .sort("kind")
)
best

# %%

fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
ax.barh(best["kind"].to_list(), [100.0 * value for value in best["median_sigma_m"].to_list()])
ax.set_xlabel("median standard deviation across the line [cm]")

# %%
# And back
# --------
#
# From an Arrow table, such as one that polars makes, the same set of lines. Metadata of columns, and with it the CRS,
# does not survive every library, so name it.

back = linework.LineSet.from_arrow(frame, crs=lines.crs)
print("the same lines:", back == lines)
assert back == lines
plt.show()
