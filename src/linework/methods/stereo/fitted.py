"""Numbers of the stereo method that neither geometry nor a standard fixes, tuned on simulated drives, in one table.

======== =====================================================================================================
how      not recorded
data     simulated drives; seeds 1, 2 and 9 were among those tuned on, the whole list is not recorded
date     2026-11-21
figure   on seeds that took no part, 950 to 959, at 1240 x 376 pixels, over what at least 3 pairs saw within
         20 m: 87.3 % complete and 96.9 % correct within 0.15 m, 0.8 cm across, 0.3 cm in height (RMSE);
         rms(error / sigma) across 0.80 to 1.12, in height 0.65 to 0.69; confidence calibrated to 4.3 %, AUC
         0.85; see docs/methods/stereo.md, "Measured"
======== =====================================================================================================

Which of them were tuned one by one, and what each adds, is not recorded. Limits that a user may change are settings of `StripeConfig`; physical
bounds (height and tilt of the cameras, radii of crests) are constants with their reason where they are used.
"""

from __future__ import annotations

# The road surface

#: Residual at which a place no longer agrees with the plane: noise of matching slanted windows, and the shape of the
#: road above the plane. [pixels]
TOLERANCE_PX = 1.0
#: Smallest sum of the weights of the places that agree with a plane.
LEAST_SUPPORT = 8.0
#: Largest height above the plane that counts as the road's shape, round by round. [m]
SHAPE_GATES_M = (0.40, 0.25, 0.15, 0.10)
#: Standard deviation of the height of a place, and of its disparity. [m, pixels]
SHAPE_NOISE = (0.02, 0.5)
#: Number of neighbouring places that err as one where the road departs from a polynomial.
SHARED_PLACES = 5.0

# Which lines of stripes are paint

#: Smallest standard deviation of a sub-pixel edge, whatever the noise: blur, sampling, lens. [pixels]
LEAST_STRIPE_SIGMA_PX = 0.05
#: Least share of the stripes of a line that have a partner in the other image.
LEAST_MATCHED = 0.4
#: Largest median deviation of the width as a share of it, because both edges of paint are parallel; and what is taken
#: off beforehand for blur. [1, pixels]
RAGGED, WIDTH_BLUR_PX = 0.5, 0.35
#: Length of the steps whose turns are compared, and the largest turn from one to the next, as in a bend of 5 m radius;
#: blades of grass and grain of asphalt, linked by chance, meander. [m, rad]
WINDING_STEP_M, WINDING_RAD = 0.5, 0.12
#: Quantile of the turns of a line that is compared with it.
TURNING_QUANTILE = 0.75
#: Share of the width by which worn paint shifts the middle of a step to one side.
WORN_SHARE = 0.5
#: Largest lean of paint, 0 for flat and 1 for upright: beyond it are posts and wheels.
STEEP_PAINT = 0.5
#: Largest depth below and height above the road's surface, for gutters, ruts and crowns; kerbs are higher. [m]
UNDER_M, OVER_M = 0.15, 0.10
#: Largest height to the side of the van's lane, where roads fall away from their crown: kerbs are higher. [m]
OVER_ASIDE_M = 0.05
#: Largest height of one edge above the other: of a kerb stone, one edge is at its foot. [m]
EDGE_STEP_M = 0.04

# Scores

#: Score of the shortest line over that of a long one, and the length over which it rises by 1. [1, m]
SHORT_LINE_SCORE, SHORT_LINE_SLOPE_M = 0.5, 4.0
#: Share of a stripe's grey value from which road counts as equally bright. Paint is brighter than the road; where the
#: road is as bright, the stripe may be sunlit road between shadows.
LIGHT = 0.9
#: Shares of the road that is as bright between which the score falls; and by how much it falls. [1, 1]
LIGHT_SHARE, BRIGHT_ROAD_FACTOR = (0.03, 0.10), 0.5
#: Least share of the pairs in range that show a place.
LEAST_SEEN_SHARE = 0.15
#: Added to that share in the score of a place: 60 % of the pairs give the full score.
SURE_SHARE = 0.4
#: Factor on the score of a place that one, two, three or more pairs show; 1 where only one has it in view.
SURE_BY_PAIRS = (0.7, 0.95, 1.0)
