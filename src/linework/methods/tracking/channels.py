"""Channels within a carriageway: the ground falls to the end of one, and to the middle of a lane that drains there too.

Separate from `arrangement`, which weighs parallel edges: this asks whether carriageway goes on behind a channel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.methods.tracking.arrangement import BESIDE_KERB_M, LANE_M, share_of_stations
from linework.methods.tracking.neighbours import LineAxis, find_neighbours

#: A survey's vehicle keeps this far from the end of a carriageway, from its middle: half of a van of 2.0 m and 0.2 m. [m]
CLEAR_OF_EDGE_M = 1.2
#: The channel along stones runs between their edges, or this far beyond: it is measured to a few centimetres. [m]
BESIDE_STONES_M = 0.03
#: A channel is within a carriageway if it is at more than this share of its stations.
_SOME = 0.3
#: It has a footway behind it if a boundary stands at the back of one at more than this share of its stations.
_MOST = 0.5


def within_carriageway(
    channels: Sequence[LineAxis], lanes: Sequence[LineAxis], path: Sequence[LineAxis]
) -> BoolArray:
    """Return which channels lie within a carriageway, (m,) bool, each with the vehicle's path to its left.

    There the path runs over the channel or close beside it, or paint or the path lies up to a lane's width behind it.

    Parameters
    ----------
    channels
        Axes of channels.
    lanes, path
        Axes of markings and of the vehicle's path. Markings within `BESIDE_KERB_M` of a channel tell nothing: they may be
        the bright stones of its gutter.
    """
    m, every = len(channels), [*channels, *lanes, *path]
    n = find_neighbours(every, LANE_M)
    is_path = n.other >= m + len(lanes)
    over = is_path & (n.across_m < CLEAR_OF_EDGE_M)
    behind = (n.other >= m) & ~is_path & (n.across_m < -BESIDE_KERB_M)
    return np.asarray(share_of_stations(n, (n.line < m) & (over | behind), every)[:m] > _SOME)


def has_footway_behind(channels: Sequence[LineAxis], bounds: Sequence[LineAxis]) -> BoolArray:
    """Return which channels have another boundary so close behind them that no vehicle fits between, (m,) bool."""
    m, every = len(channels), [*channels, *bounds]
    n = find_neighbours(every, LANE_M)
    behind = (n.line < m) & (n.other >= m) & n.ends_footway
    return np.asarray(share_of_stations(n, behind, every)[:m] > _MOST)


def on_channels(markings: Sequence[LineAxis], width_m: FloatArray, channels: Sequence[LineAxis]) -> BoolArray:
    """Return which markings (m,) of these widths have a channel under them over most of their length, (m,) bool.

    Where water runs there is no line to guide traffic: they are stones that lead it, or the kerb's where it is flush.
    """
    m, every = len(markings), [*markings, *channels]
    n = find_neighbours(every, LANE_M)
    reach_m = np.append(0.5 * width_m + BESIDE_STONES_M, np.zeros(len(channels)))
    over = (n.line < m) & (n.other >= m) & (np.abs(n.across_m) <= reach_m[n.line])
    return np.asarray(share_of_stations(n, over, every)[:m] > _MOST)
