"""Places as a hand draws them: beside true lines, and how far from them they are."""

from __future__ import annotations

import numpy as np


def hands(truth, kind, rng):
    """Yield places beside the true lines of a kind, off by 8 cm across, the line and its direction there."""
    for line in truth[kind]:
        xy = line.xyz[:, :2]
        for i in range(2, len(xy) - 2, max(1, len(xy) // 6)):
            step = xy[i + 1] - xy[i]
            right = np.array([step[1], -step[0]]) / np.hypot(*step)
            yield xy[i] + rng.choice([-0.08, 0.08]) * right, xy, float(np.degrees(np.arctan2(*step)))


def off(place, xy):
    """Return the distance of a place from a line in plan. [m]"""
    step = np.diff(xy, axis=0)
    share = np.clip(((place - xy[:-1]) * step).sum(axis=1) / (step**2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(xy[:-1] + share[:, None] * step - place).T).min())
