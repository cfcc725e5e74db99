"""Positioning of a drive by GNSS and dead reckoning.

After the positioning of the GPS-Van [1]: a differential receiver, and where satellites are hidden a directional
gyro, a vertical gyro and wheel counters. Beyond it: one filter over all of them, forward, and a smoother backward,
whose error in an outage is a fraction of that of dead reckoning alone.

[1] G. He, K. Novak (1992), Automatic analysis of highway features from digital stereo-images,
    ISPRS XXIX-B3, 119-124, section 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linework.errors import InputError
from linework.model.logs import GnssLog, NavigationLogs
from linework.navigation.clock_check import checked_against_fixes
from linework.navigation.dead_reckoning import Motion
from linework.navigation.located import LocatedDrive, NavigationConfig, concatenated_drives
from linework.navigation.motion import motion_of
from linework.navigation.stretch import Sensors, locate_stretch
from linework.navigation.wheels import spans_of

#: Fewest fixes of a drive.
_LEAST_FIXES = 5
#: Least sigma of a fix: smaller ones are the noise of the receiver, not the error of its position. [m]
_LEAST_SIGMA_M = 0.003
#: Pause of the logs from which they were switched off: the path in between is unknown. [s]
_PAUSE_S = 5.0
#: Largest difference of clocks; see `clock_check`. [s]
_CLOCK_S = 40.0


def locate_drive(
    logs: NavigationLogs,
    config: NavigationConfig | None = None,
    *,
    rate_hz: float = 50.0,
    progress: Callable[[int, int], None] | None = None,
) -> LocatedDrive:
    """Return positions and attitudes of a drive, with realistic sigmas.

    Parameters
    ----------
    logs
        GNSS, and at least a gyro or the counts of two wheels.
    rate_hz
        Poses per second. [Hz]
    progress
        Called with the number of sections between pauses of the logs that are done, and of all.

    Raises
    ------
    InputError
        When there is neither a gyro nor wheels, the logs do not overlap in time, or the van never moves.
    """
    config = config or NavigationConfig()
    # Turn rates and distances, corrected where counters wrap, stick or saturate
    motion, turns, warnings = motion_of(logs)
    sensors = Sensors(
        gyro_noise=None if turns is None else turns.noise,
        tilt_sigma_rad=np.zeros(2) if turns is None else turns.tilt_sigma_rad,
        has_tilt=logs.gyro is not None and logs.gyro.roll_pitch_rad is not None,
        lever_m=np.asarray(logs.gnss_lever_m, dtype=np.float64),
    )
    gnss, said = _fixes_within(logs.gnss, motion.span_s)
    # The drive is cut where the logs pause: the path is not known there
    sections, pauses_said = _sections(motion)
    found: list[LocatedDrive] = []
    refused: list[tuple[Motion, InputError]] = []
    for i, section in enumerate(sections):
        try:
            found += _located_section(section, gnss, sensors, config, rate_hz)
        except InputError as error:
            refused.append((section, error))
        if progress is not None:
            progress(i + 1, len(sections))
    if not found:
        raise refused[0][1]
    lost = [f"{error.problem}: left out" for _, error in refused]
    return concatenated_drives(
        found, [section.span_s for section, _ in refused], (*warnings, *said, *pauses_said, *lost)
    )


def _located_section(
    motion: Motion, gnss: GnssLog, sensors: Sensors, config: NavigationConfig, rate_hz: float
) -> list[LocatedDrive]:
    """Return the drive between two pauses of the logs, one part per clock."""
    gnss, _ = _fixes_within(gnss, motion.span_s)
    # Clocks, signs and units: dead reckoning against the fixes; where a clock jumps, the drive is cut
    checked = checked_against_fixes(motion, gnss)
    if sensors.gyro_noise is not None:
        sensors = replace(sensors, gyro_noise=sensors.gyro_noise * abs(checked.gyro_factor))
    parts = []
    for fixes, later_s in checked.stretches:
        part = GnssLog(gnss.time_s[fixes], gnss.xyz[fixes], gnss.sigma_m[fixes])
        own = _later(checked.motion, later_s)
        if len(checked.stretches) > 1:
            own = own.between(float(part.time_s[0]), float(part.time_s[-1]))
        # Filter forward, smooth backward
        parts.append(locate_stretch(own, part, sensors, config, rate_hz=rate_hz))
    return [replace(parts[0], warnings=(*checked.warnings, *parts[0].warnings)), *parts[1:]]


def _sections(motion: Motion) -> tuple[list[Motion], list[str]]:
    """Return the parts of a drive between pauses of both gyro and wheels, and messages about the pauses."""
    time = np.unique(np.concatenate([motion.turn_time_s, motion.way_time_s]))
    pauses = spans_of(np.diff(time) > _PAUSE_S, time)
    said = [f"gyro and wheels pause from {a:.1f} to {b:.1f} s: no poses there" for a, b in pauses]
    bounds = np.concatenate([[time[0]], pauses.ravel(), [time[-1]]]).reshape(-1, 2)
    sections = [motion.between(float(a), float(b)) for a, b in bounds]
    return [s for s in sections if min(len(s.turn_time_s), len(s.way_time_s)) > 1], said


def _fixes_within(gnss: GnssLog, span_s: tuple[float, float]) -> tuple[GnssLog, list[str]]:
    """Return the fixes about the time of gyro and wheels, whose clock may be off by some seconds; and messages."""
    first, last = span_s
    inside = (gnss.time_s >= first - _CLOCK_S) & (gnss.time_s <= last + _CLOCK_S)
    n_covered = int(np.count_nonzero((gnss.time_s >= first) & (gnss.time_s <= last)))
    if n_covered < _LEAST_FIXES:
        raise InputError(
            f"{n_covered} fixes while gyro and wheels were logged ({first:.1f} to {last:.1f} s; "
            f"GNSS: {gnss.time_s[0]:.1f} to {gnss.time_s[-1]:.1f} s)",
            where="navigation",
            advice="check that all logs have one clock and are of one drive",
        )
    sigma = np.maximum(gnss.sigma_m[inside], _LEAST_SIGMA_M)
    n_out = len(gnss.time_s) - n_covered
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
