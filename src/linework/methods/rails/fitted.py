"""Numbers of the rail method that were tuned on simulated surveys, in one table.

======== =====================================================================================================
how      by hand, one test at a time
seeds    simulated surveys of seeds 1 to 4, of each kind of road: straight, bends, urban, motorway
date     2026-11-21
figure   on other seeds, 501 to 512: completeness 93.7 to 100 %, correctness 97.7 to 99.9 % within 0.10 m;
         see docs/methods/radon.md, "Measured". What each number adds is recorded only where it says so
======== =====================================================================================================

Limits that a user may change are settings of `CircleConfig` and `ProfileConfig`; these are the rest: the widths over
which a test changes from passed to failed, and factors and shares that go with the limits.
"""

from __future__ import annotations

# Starts: a beam in end view

#: Height of the followed sheet less that of a beam: noise of its top and bottom. [m]
START_BLUR_M = 0.06
#: Height above and below a beam in which points count against a start. [m]
START_CLEAR_M = 0.10
#: Fewest points of a beam to start from.
START_POINTS = 6.0
#: Least share of a beam's points that must remain when those above and below are subtracted.
START_CLARITY = 0.4

# Widths: a value this far within its limit scores 0.73, this far beyond it 0.27 (logistic function)

#: Of the spread of the sheet, where the sheet is to continue; and where it is to be deep. [m]
SPREAD_WIDTH_M, DEEP_WIDTH_M = 0.003, 0.002
#: Of the wobble of the top edge and of the wander across the line. [sigma]
WOBBLE_WIDTH = 0.15
#: Of the share of occupied stations.
OCCUPIED_WIDTH = 0.08
#: Of heights of the top edge, and of the height of the sheet at its upper limit. [m]
TOP_EDGE_WIDTH_M, BEAM_WIDTH_M = 0.03, 0.03
#: Of the height of the sheet at its lower limits: a plate, a beam, a lip. [m]
LOW_BEAM_WIDTH_M = 0.02
#: Of the common roughness.
ROUGH_WIDTH = 0.03
#: Of the density above the sheet, and of a second row of points. [ratio]
ABOVE_WIDTH, SECOND_WIDTH = 0.06, 0.06
#: Of the density below the sheet, and of the share of stations with points in front of it. [ratio, share]
BELOW_WIDTH, FRONT_WIDTH = 0.08, 0.08
#: Of the density of the apron, where it must be missing and where a barrier must have one. [ratio]
APRON_WIDTH = 0.05
#: Of the share of stations with ground visible below and behind, for barriers.
OPEN_WIDTH = 0.1

# Factors on the settings

#: A sheet continues up to these multiples of the largest spread, wobble and wander of a rail.
CONTINUES_SPREAD, CONTINUES_WOBBLE, CONTINUES_WANDER = 1.15, 1.6, 1.6
#: Least share of occupied stations of a sheet that continues, and of a second beam beside another one, whose posts
#: alone fill less.
CONTINUES_OCCUPIED, WHOLE_OCCUPIED = 0.4, 0.6
#: A barrier has at most this multiple of the density below a rail: its lower face stands out before the upper one.
BARRIER_BELOW = 1.5
#: A barrier has at least this multiple of the densest apron of a rail, and of its lowest top.
BARRIER_APRON, BARRIER_TOP = 1.5, 1.5

# Profile

#: Share of the points of both halves that one half of a sheet must hold to be judged alone.
LEAST_HALF = 0.2
#: Density against the beam's below which a sheet has ended.
SHEET_FILLED = 0.4

# Fits

#: Points of a node beyond which its weight does not grow: neighbours share pose and corrugation.
MOST_WEIGHT_POINTS = 10.0
#: Noise of the highest point of a beam. [m]
TOP_NOISE_M = 0.015
#: Tops this many of their deviations off the fitted edge are left out: bushes and gaps.
TOP_OUTLIER = 2.5

# Forms

#: Share of the points of a beam that must lie on its outline: posts and spacers behind take up to a fifth.
LEAST_EXPLAINED = 0.7
#: The same of a fence of mesh, which is as thin as its noise; the face of a concrete barrier slopes.
LEAST_THIN = 0.95
#: Least share of the windows of a stretch that show its form.
LEAST_AGREEING = 0.5
#: Share of the points of a concrete barrier below its lid near the middle of those at their height.
LEAST_FACED = 0.85
