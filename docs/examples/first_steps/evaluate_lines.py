"""
How good are the lines?
=======================

Lines that you trust, digitised by hand or surveyed, are a reference: ``evaluate`` scores extracted lines against
them. Here the reference is the exact ground truth of a simulated street.
"""

import matplotlib.pyplot as plt
import numpy as np

import linework

survey = linework.simulate("survey", road="urban", seed=10, length_m=60.0, points_per_m=2500, images=False)
points, trajectory = linework.read_points(survey), linework.read_trajectory(survey)
truth = linework.read_lines(survey.root / "truth.gpkg")
lines = linework.extract(points, trajectory=trajectory)

# %%
# Scores
# ------
#
# A piece of line counts as found within 10 cm of the reference. Completeness is the share of the reference that was
# found, correctness the share of the lines that is right.

scores = linework.evaluate(lines, truth)
scores

# %%
# The same as a table, one row per kind of line.

table = scores.to_frame()
table

# %%
# Looser and tighter tolerances
# -----------------------------
#
# If completeness still rises from 10 cm to 50 cm, lines are in the wrong place; if it does not, they are missing.

fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
for kind in scores.kinds:
    tolerances = sorted({entry.tolerance_m: entry.completeness for entry in kind.curve}.items())
    ax.plot(*np.array(tolerances, dtype=np.float64).T, "o-", label=kind.kind)
ax.set(xlabel="tolerance [m]", ylabel="completeness", ylim=(0, 1.05))
ax.legend(fontsize=8)

# %%
# Where it is missing
# -------------------

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
for one in truth["lane_marking"]:
    ax.plot(*one.xyz[:, :2].T, color="tab:orange", lw=4, alpha=0.5)
for one in lines["lane_marking"]:
    ax.plot(*one.xyz[:, :2].T, color="k", lw=1)
ax.set_aspect("equal")
ax.set_title("lane markings: truth (orange) and extracted (black)")
plt.show()
