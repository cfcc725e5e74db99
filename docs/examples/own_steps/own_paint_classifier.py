"""
Your own paint classifier
=========================

A neural network, or any other program, says how likely each point is paint. Write that as an extra dimension into the
LAZ files, and the markings are found in it instead of in the intensities, without a line of code. The model of this
page is small enough to be trained here: a logistic regression on five numbers per point.
"""

import subprocess
import sys
from pathlib import Path

import laspy
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.special import expit

import linework
from linework.arrays import BoolArray, FloatArray
from linework.surface.road import height_above_road

# %%
# Features and labels
# -------------------
#
# Of each point near the road: its intensity against that of the road around it, at two sizes of neighbourhood, and
# its height. Labels come from the ground truth of a simulated survey.


def points_in(laz: Path) -> linework.Points:
    """Return the points of a file in the order of the file."""
    las = laspy.read(laz)
    return linework.Points(np.asarray(las.xyz), intensity=np.asarray(las.intensity), crs="EPSG:25832+7837")


def features(points: linework.Points, height_m: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the features (k, 5) of the points within 10 cm of the road, and which points they are (n,)."""
    near = np.abs(height_m) < 0.10
    xyz, strength = points.xyz[near], np.log1p(np.asarray(points["intensity"][near], dtype=np.float64))
    if len(xyz) < 32:
        return np.zeros((0, 5)), np.zeros(len(near), dtype=np.bool_)
    tree = cKDTree(xyz[:, :2])
    _, close = tree.query(xyz[:, :2], k=8)
    _, wide = tree.query(xyz[:, :2], k=32)
    level, local = np.median(strength[wide], axis=1), np.median(strength[close], axis=1)
    spread = np.std(strength[wide], axis=1) + 1e-3
    columns = [np.ones(len(xyz)), strength - level, local - level, (local - level) / spread, height_m[near]]
    return np.column_stack(columns), near


def above_road(points: linework.Points) -> FloatArray:
    """Return the height of points above the road (n,) [m]."""
    return height_above_road(linework.find_ground(points), points.xyz).astype(np.float64)


def is_paint(xyz: FloatArray, truth: linework.LineSet) -> BoolArray:
    """Return which of (n, 3) points lie on true paint: dashes, and solid lines."""
    true = truth[(truth.kind == "lane_marking_dash") | (truth.pattern == "solid")]
    dense = np.concatenate([
        np.linspace(a, b, max(2, round(float(np.hypot(*(b - a)[:2])) / 0.05)))
        for one in true
        for a, b in zip(one.xyz[:-1], one.xyz[1:], strict=True)
    ])  # fmt: skip
    distance, _ = cKDTree(dense[:, :2]).query(xyz[:, :2])
    return np.asarray(distance < 0.06)


# %%
# Training
# --------

training = linework.simulate("training", seed=13, length_m=50.0, points_per_m=2500, images=False)
labelled = points_in(training.point_files[0])
x, near = features(labelled, above_road(labelled))
y = is_paint(labelled.xyz[near], linework.read_lines(training.root / "truth.gpkg")).astype(np.float64)
scale = np.maximum(np.abs(x).max(axis=0), 1e-9)
positive = 0.5 / max(float(y.mean()), 1e-6)


def loss(weights: FloatArray) -> tuple[float, FloatArray]:
    """Return the weighted cross-entropy and its gradient."""
    p = expit((x / scale) @ weights)
    each = np.where(y > 0.5, positive, 0.5 / (1.0 - float(y.mean())))
    value = -np.mean(each * (y * np.log(p + 1e-12) + (1.0 - y) * np.log(1.0 - p + 1e-12)))
    gradient = (x / scale).T @ (each * (p - y)) / len(y) + 1e-4 * weights
    return float(value + 0.5e-4 * weights @ weights), np.asarray(gradient)


weights = minimize(loss, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B").x
print("weights:", np.round(weights, 1))

# %%
# Another survey
# --------------
#
# The model has not seen this road. Its probabilities are written into the LAZ file with laspy, as any program could.

survey = linework.simulate("survey", seed=12, length_m=90.0, points_per_m=2500, images=False)
for laz in survey.point_files:
    points = points_in(laz)
    x2, near2 = features(points, above_road(points))
    p_paint = np.zeros(len(points), dtype=np.float32)
    p_paint[near2] = expit((x2 / scale) @ weights)
    las = laspy.read(laz)
    las.add_extra_dim(laspy.ExtraBytesParams("p_paint", "float32", "probability of paint"))
    las.p_paint = p_paint
    las.write(laz)

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
shown = np.flatnonzero(near2)[::3]
ax.scatter(
    points.xyz[shown, 0], points.xyz[shown, 1], c=p_paint[shown], s=0.5, cmap="viridis", rasterized=True
)
ax.set_aspect("equal")
ax.set_title("probability of paint")

# %%
# Markings from it
# ----------------

KINDS = ("lane_marking", "lane_marking_dash")
method = linework.Obb(kinds=KINDS, paint="p_paint")
lines = linework.extract("survey", methods=[method])
truth = linework.read_lines(survey.root / "truth.gpkg")
print(linework.evaluate(lines, truth[np.isin(truth.kind, KINDS)]))

# %%
# The same from intensities, to compare:

from_intensity = linework.extract("survey", kinds=KINDS)
print(linework.evaluate(from_intensity, truth[np.isin(truth.kind, KINDS)]))

# %%
# A function in place of a column
# -------------------------------
#
# Where the classifier is Python, nothing needs to be written: a function is given points near the road, with their
# height above it in the column ``above_road_m``, and returns their probabilities.


def trained(near: linework.Points) -> FloatArray:
    """Return the probability of paint (n,)."""
    x, chosen = features(near, np.asarray(near["above_road_m"], dtype=np.float64))
    probability = np.zeros(len(near))
    probability[chosen] = expit((x / scale) @ weights)
    return probability


by_function = linework.extract("survey", methods=[linework.Obb(kinds=KINDS, paint=trained)])
print(linework.evaluate(by_function, truth[np.isin(truth.kind, KINDS)]))

# %%
# On the command line
# -------------------
#
# No code at all: ``--paint-column`` names the dimension.

command = "extract survey -o markings.gpkg --features lane_marking,lane_marking_dash --paint-column p_paint"
finished = subprocess.run(
    [sys.executable, "-m", "linework", *command.split()], check=True, capture_output=True, text=True
)
print(finished.stdout)
written = linework.read_lines("markings.gpkg")
print(f"{len(written)} lines, {written.length_m.sum():.1f} m; from Python {lines.length_m.sum():.1f} m")

# %%
# In tiles, with workers
# ----------------------
#
# The column is cut into tiles with the points.
#
# A survey as short as this one is a single tile: here tiles are made small, and a function that watches the progress
# notes how many there are.

tiles = {"tiling": {"core_m": 64.0, "max_points": 10_000}}
totals: dict[str, int] = {}
in_tiles = linework.extract(
    "survey",
    methods=[method],
    settings=tiles,
    workers=2,
    progress=lambda stage, done, total: totals.update({stage: total}),
)
assert totals["find lines"] > 1
assert len(lines) > 0
assert in_tiles == lines
print(f"{len(lines)} lines, the same from {totals['find lines']} tiles")
plt.show()
