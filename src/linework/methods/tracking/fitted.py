"""Numbers of tracked lines and their boxes that were fitted to data, in one table.

========== ====================================================================================================
how        not recorded
data       simulated surveys of straight, winding, urban and motorway roads; the seeds are not recorded
date       2026-11-21
figure     on seeds that took no part, 860 to 874: lane markings 94.7 % complete and 99.8 % correct within 0.10 m,
           kerbs 95.2 and 99.7 %, edges without a kerb 96.4 and 98.1 %; rms(error / sigma) 0.77 to 0.85 for
           markings and 1.20 to 1.61 for boundaries; see docs/methods/obb.md, "Measured"
========== ====================================================================================================

What a number adds by itself is recorded only where its entry says so. Limits that a user may change are settings of
`MarkingConfig`, `BoundaryConfig` and `TrackConfig`; physical bounds (the height of a kerb, the length of a dash, the
curvature of a road) are constants with their reason where they are used. Kernels cannot import from here: two numbers
of this kind stand there, the share of independent points `linework.kernels.boundaries.pavement_edges.NEW_SHARE`, and
the widths of the score of a kerb in `linework.kernels.boundaries.kerbs.boxes`.
"""

from __future__ import annotations

# Scores of boxes: the chance that a box is a piece of such a feature

#: Logistic curve from the t-value of a stripe of paint to its score: of boxes with t-values of 1.5, 3.5, 5.5 and 9, 65,
#: 88, 95 and 99 % were on paint.
PAINT_SCORE_SLOPE, PAINT_SCORE_OFFSET = 0.5, -0.5

# Boxes that err together: neighbours share points, and what hides a feature

#: Number of neighbouring boxes of an edge without a kerb that err as one: tufts of grass and a verge's shadow hide it
#: over some metres alike. Other boxes: `linework.kernels.tracking.track.SHARED`, from the overlap of search areas.
SHARED_EDGE = 6.0
#: Number of boxes of a line whose scores count as independent in its confidence. Calibration error of the confidence of
#: markings per 10 m over degraded surveys: 0.4 %, AUC 0.998.
INDEPENDENT_BOXES = 2

#: Share of the patches of a row that hold a stripe though there is no line, and the logarithm of the odds that a row is
#: one before its patches count: tracking looks for rows. Simulated roads of eight kinds in usual and hard conditions,
#: seeds 8511 to 8513, 2026-11-27: of 48 roads with 17,000 m of markings, 112 m of false lines and 10 m of true ones have
#: less than even odds; with 0.05 it is 0 and 10 m, with 0.2 190 and 120 m.
STRAY_PATCHES, ROW_LOG_ODDS = 0.1, -3.0

# Confidence at which a line is believed against others

#: Smallest mean score of the boxes of a boundary without a kerb, and of small pieces of paint: boxes that are more
#: likely wrong make no line, however many.
LEAST_BOUNDARY_SCORE, LEAST_PIECE_SCORE = 0.5, 0.5
