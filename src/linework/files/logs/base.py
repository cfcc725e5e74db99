"""Differences of positions to a base log: what a receiver at a known place is off by, taken off the rover's fixes.

Separate from `sensors`, which reads the logs of the van: this reads that of a receiver that stands still.

Two plain receivers near each other are off alike, as long as they use the same satellites: by the orbits, the clocks
and the air. Neither log says which satellites were used, so that the differences are approximate; a solution from the
raw measurements (RTKLIB's .pos) is not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.crs import LOCAL
from linework.errors import ConfigError, InputError
from linework.files.geodetic import EarthFrame, project_places
from linework.files.logs.clock import fitted_times
from linework.files.logs.fixes import GnssContent
from linework.files.logs.gnss import read_gnss
from linework.model.logs import FIX_QUALITIES, GnssLog
from linework.model.survey import Survey

#: Longest time between two fixes of the base that errors are interpolated over: reference stations log every 30 s, and
#: one fix may be missing. [s]
_MOST_INTERVAL_S = 60.0
#: A base farther off than this from its known position is another antenna, or has coordinates of another datum: code
#: receivers are off by 20 m at worst. [m]
_MOST_ERROR_M = 100.0
#: Distance beyond which orbits and air err differently by more than what is left of a code receiver's noise. [m]
_FAR_M = 50_000.0
#: Kinds of fixes from which a base has been taken off already.
_DIFFERENTIAL = [FIX_QUALITIES.index(name) for name in ("fixed", "float", "sbas", "differential", "ppp")]


def less_base_errors(rover: GnssContent, survey: Survey) -> GnssContent:
    """Return the fixes of the rover less what the base of [gnss] is off by at the same time; unchanged without a base.

    Fixes at times without fixes of the base are left out. Sigmas stay those of the receiver: what the differences are
    off by is in neither log.

    Raises
    ------
    ConfigError
        The known position of the base is missing.
    InputError
        The base cannot be used: no common time, another place, or fixes of the rover that are differential already.
    """
    table = survey.settings.get("gnss", {})
    if "base" not in table:
        return rover
    name, path = table["base"], survey.root / table["base"]
    done = rover.log.quality is not None and np.mean(np.isin(rover.log.quality, _DIFFERENTIAL)) > 0.5
    if done:
        raise InputError("most fixes of the rover are differential already", where=path,
                         advice="remove [gnss] base from the survey.toml")  # fmt: skip
    frame = EarthFrame.of(survey)
    base = read_gnss(path, replace(frame, origin_deg=frame.base_deg))
    base, remarks = _on_the_clock_of(rover, base, survey)
    error = base.log.xyz - _known_xyz(table, frame, survey)
    off = float(np.median(np.hypot(*error[:, :2].T)))
    if off > _MOST_ERROR_M:
        raise InputError(
            f"its fixes are {off:,.0f} m from the known position of the base (median), at most {_MOST_ERROR_M:g} m",
            where=path, advice="check [gnss] base_m or base_deg in the survey.toml",
        )  # fmt: skip
    at, covered = _at(rover.log.time_s, base.log.time_s, error)
    if not covered.any():
        span, own = ((float(log.time_s[0]), float(log.time_s[-1])) for log in (rover.log, base.log))
        raise InputError(
            f"from {own[0]:.1f} to {own[1]:.1f} s, the rover from {span[0]:.1f} to {span[1]:.1f} s: no common time",
            where=path, advice="check the epochs ([time] epoch)",
        )  # fmt: skip
    log = rover.log.take(covered)
    warnings = [f"{name}: {text}" for text in (*base.warnings, *remarks)]
    warnings.append(
        f"positions are differences to the base {name}: approximate, since it is not known which satellites both used"
    )
    if not covered.all():
        warnings.append(
            f"{np.count_nonzero(~covered)} of {len(covered)} fixes left out: no fix of the base {name} at their time"
        )
    warnings += _far_warning(log, base.log, name, is_local=frame.crs == LOCAL)
    moved = GnssLog(log.time_s, log.xyz - at[covered], log.sigma_m, log.quality)
    return replace(rover, log=moved, warnings=(*rover.warnings, *warnings))


def _known_xyz(table: Mapping[str, Any], frame: EarthFrame, survey: Survey) -> FloatArray:
    """Return the known position of the base in the survey, (3,) [m]."""
    if "base_m" in table:
        return np.array(table["base_m"], dtype=np.float64)
    where = survey.settings_file or survey.root
    if frame.base_deg is None:
        raise ConfigError(
            "gnss.base without the known position of the base", where=where,
            advice="add base_m = [easting, northing, height] or base_deg = [latitude, longitude, height]",
        )  # fmt: skip
    if frame.crs == LOCAL:
        return np.zeros(3)
    return np.asarray(project_places(np.array([frame.base_deg]), frame, where=where).xyz[0])


def _on_the_clock_of(
    rover: GnssContent, base: GnssContent, survey: Survey
) -> tuple[GnssContent, tuple[str, ...]]:
    """Return the base on the clock of the rover, and warnings about its times."""
    time = survey.settings.get("time", {})
    stated = str(time.get("epoch", ""))
    span = float(rover.log.time_s[0]), float(rover.log.time_s[-1])
    time_s, remarks = fitted_times(
        base.log.time_s, base.epoch or stated, span, rover.epoch or stated, week=time.get("week")
    )
    return replace(base, log=replace(base.log, time_s=time_s)), remarks


def _at(time_s: FloatArray, known_s: FloatArray, error: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the errors (n, 3) at times (n,), interpolated linearly, and (n,) bool: whether fixes are near enough."""
    after = np.searchsorted(known_s, time_s)
    right, left = np.minimum(after, len(known_s) - 1), np.maximum(after - 1, 0)
    is_same = known_s[right] == time_s
    inside = (after > 0) & (after < len(known_s)) & (known_s[right] - known_s[left] <= _MOST_INTERVAL_S)
    at = np.stack([np.interp(time_s, known_s, column) for column in error.T], axis=1)
    return at, inside | is_same


def _far_warning(rover: GnssLog, base: GnssLog, name: str, *, is_local: bool) -> list[str]:
    """Return a warning where the rover is far from the base; local frames of two logs have two origins."""
    if is_local:
        return []
    away = np.hypot(*(rover.xyz - np.median(base.xyz, axis=0))[:, :2].T)
    if away.max() <= _FAR_M:
        return []
    return [
        f"up to {away.max() / 1000.0:,.0f} km from the base {name}: receivers so far apart are off differently"
    ]
