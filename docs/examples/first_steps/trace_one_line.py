"""
One line from one position
==========================

Sometimes a single line is wanted: the kerb at this position, the guardrail over there. ``trace`` follows it from a
point, in both directions, and ends where the line does.
"""

import matplotlib.pyplot as plt
import numpy as np

import linework

survey = linework.simulate("survey", road="urban", seed=10, length_m=60.0, points_per_m=2500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
truth = linework.read_lines(survey.root / "truth.gpkg")

# %%
# A click
# -------
#
# Any position within half a metre of the line will do. Here: a point 20 cm beside the middle of a true kerb.

kerb = truth["road_boundary"][0].xyz
at = kerb[len(kerb) // 2, :2] + np.array([0.15, 0.1])
line = linework.trace(points, (float(at[0]), float(at[1])), kind="road_boundary")
line

# %%
# Towards one side only
# ---------------------

end = kerb[-1, :2]
ahead = linework.trace(
    points, (float(at[0]), float(at[1])), kind="road_boundary", toward=(float(end[0]), float(end[1]))
)
print(f"both ways {line.length_m[0]:.1f} m, one way {ahead.length_m[0]:.1f} m")

# %%

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
ax.scatter(points.xyz[::4, 0], points.xyz[::4, 1], c="0.85", s=0.3, rasterized=True)
for traced, colour, width in ((line, "tab:blue", 3), (ahead, "tab:red", 1)):
    for one in traced["road_boundary"]:
        ax.plot(*one.xyz[:, :2].T, color=colour, lw=width)
ax.plot(*at, "k+", ms=12)
ax.set_aspect("equal")

# %%
# A position where there is no line is refused, with the reason and the nearest position that works.

middle = trajectory.xyz[len(trajectory.xyz) // 2]
try:
    linework.trace(points, (float(middle[0]), float(middle[1])), kind="guardrail")
except linework.LineworkError as error:
    print(error)
plt.show()
