"""Where the van was, from GNSS and dead reckoning.

After the positioning of the GPS-Van [1]: a differential receiver, and where satellites are hidden a directional
gyro, a vertical gyro and wheel counters. Beyond it: one filter over all of them, forward, and a smoother backward,
which together leave in an outage a fraction of what dead reckoning alone does.

[1] G. He, K. Novak (1992), Automatic analysis of highway features from digital stereo-images,
    ISPRS XXIX-B3, 119-124, section 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linework.errors import InputError
from linework.model.arrays import FloatArray
from linework.model.logs import GnssLog, NavigationLogs
from linework.navigation.clock_check import checked_against_fixes
from linework.navigation.dead_reckoning import Motion
from linework.navigation.located import Located, one_after_another
from linework.navigation.motion import motion_of
from linework.navigation.settings import NavigationConfig
from linework.navigation.stretch import Sensors, located_stretch

#: A stretch of one clock with fewer fixes is no drive.
_LEAST_FIXES = 5


def locate(
    logs: NavigationLogs,
    config: NavigationConfig | None = None,
    *,
    rate_hz: float = 50.0,
    progress: Callable[[int, int], None] | None = None,
) -> Located:
    """Return where the van was and how it was turned, with honest sigmas.

    Parameters
    ----------
    logs
        GNSS, and a gyro or the counts of two wheels at least.
    rate_hz
        Poses per second.
    progress
        Told how many stretches are done, of how many.

    Raises
    ------
    InputError
        No gyro and no wheels, logs that do not overlap in time, a van that never moves.
    """
    config = config or NavigationConfig()
    # Turns and ways: what gyros and wheels say, put right where counters wrap, stick or saturate
    motion, turns, warnings = motion_of(logs)
    gnss, said = _fixes_within(logs.gnss, motion.span_s)
    # Clocks, signs and units: dead reckoning against the fixes; where a clock jumps, the drive is cut
    checked = checked_against_fixes(motion, gnss)
    sensors = Sensors(
        gyro_noise=None if turns is None else turns.noise * abs(checked.gyro_factor),
        tilt_sigma_rad=np.zeros(2) if turns is None else turns.tilt_sigma_rad,
        has_tilt=logs.gyro is not None and logs.gyro.roll_pitch_rad is not None,
        lever_m=np.asarray(logs.gnss_lever_m, dtype=np.float64),
    )
    parts, lost = [], []
    for i, (fixes, later_s) in enumerate(checked.stretches):
        part = GnssLog(gnss.time_s[fixes], gnss.xyz[fixes], gnss.sigma_m[fixes])
        if len(part.time_s) < _LEAST_FIXES:
            lost.append(f"{len(part.time_s)} fixes between two clock jumps: left out")
            continue
        # Filter forward, smooth backward
        alone = len(checked.stretches) == 1
        own = _cut(_later(checked.motion, later_s), None if alone else part)
        parts.append(located_stretch(own, part, sensors, config, rate_hz=rate_hz))
        if progress is not None:
            progress(i + 1, len(checked.stretches))
    return one_after_another(parts, (*warnings, *said, *checked.warnings, *lost))


def _fixes_within(gnss: GnssLog, span_s: tuple[float, float]) -> tuple[GnssLog, list[str]]:
    """Return the fixes that gyro and wheels cover, or nearly: their clock may be off by some seconds."""
    first, last = span_s
    inside = (gnss.time_s >= first - 60.0) & (gnss.time_s <= last + 60.0)
    if np.count_nonzero(inside) < _LEAST_FIXES:
        raise InputError(
            f"{np.count_nonzero(inside)} fixes while gyro and wheels were logged ({first:.1f} to {last:.1f} s; "
            f"GNSS: {gnss.time_s[0]:.1f} to {gnss.time_s[-1]:.1f} s)",
            where="navigation",
            advice="check that all logs have one clock and are of one drive",
        )
    # Receivers that say less than 3 mm speak of their own noise, not of where they are
    sigma = np.maximum(gnss.sigma_m[inside], 0.003)
    n_out = int(np.count_nonzero((gnss.time_s < first) | (gnss.time_s > last)))
    said = [f"{n_out} of {len(gnss.time_s)} fixes are before or after gyro and wheels"] if n_out else []
    return GnssLog(gnss.time_s[inside], gnss.xyz[inside], sigma), said


def _later(motion: Motion, seconds: float) -> Motion:
    """Return the motion in the clock of the fixes."""
    if seconds == 0.0:
        return motion
    return replace(
        motion, turn_time_s=motion.turn_time_s + seconds, way_time_s=motion.way_time_s + seconds,
        no_turn=motion.no_turn + seconds, no_way=motion.no_way + seconds, at_rest=motion.at_rest + seconds,
    )  # fmt: skip


def _cut(motion: Motion, fixes: GnssLog | None) -> Motion:
    """Return the motion while there are fixes of one clock."""
    return motion if fixes is None else motion.between(*_ends(fixes.time_s))


def _ends(time_s: FloatArray) -> tuple[float, float]:
    return float(time_s[0]), float(time_s[-1])
