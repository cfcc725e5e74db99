"""Simulated surveys made worse, each in one way: what a poorer scanner or a thinner record would give."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.simulation.simulate import SimulatedSurvey, survey_of

#: Range noise of the noisy variant, on every beam (standard deviation). [m]
NOISE_M = 0.03


def degraded(survey: SimulatedSurvey, name: str) -> tuple[SimulatedSurvey, Trajectory | None]:
    """Return a variant of the survey, and the trajectory that goes with it, if any.

    Its truth, and what of it was observed, stays.
    """
    variant = VARIANTS[name](survey)
    return variant, None if name == NO_TRAJECTORY else variant.trajectory


def _as_drawn(survey: SimulatedSurvey) -> SimulatedSurvey:
    return survey


def _share(survey: SimulatedSurvey, share: float) -> SimulatedSurvey:
    """Keep points at random: every second one would keep every second beam of a turn in step."""
    kept = np.random.default_rng([survey.scenario.seed, 51]).random(len(survey.points)) < share
    return survey.take(kept)


def _half(survey: SimulatedSurvey) -> SimulatedSurvey:
    return _share(survey, 0.5)


def _quarter(survey: SimulatedSurvey) -> SimulatedSurvey:
    return _share(survey, 0.25)


def _noisy(survey: SimulatedSurvey) -> SimulatedSurvey:
    """Record the same drive with a noisier scanner."""
    sensor = replace(survey.scenario.sensor, range_noise_m=NOISE_M)
    return survey_of(replace(survey.scenario, sensor=sensor))


def _eight_bit(survey: SimulatedSurvey) -> SimulatedSurvey:
    """Keep the upper byte of 16-bit intensities; a survey of 8 bits stays as it is."""
    points = survey.points
    if survey.scenario.sensor.intensity_bits == 8 or points.intensity is None:
        return survey
    coarse = np.floor(points.intensity / 256.0).astype(np.float32)
    return replace(survey, points=Points(points.xyz, intensity=coarse, time_s=points.time_s))


AS_DRAWN, NO_TRAJECTORY = "as drawn", "no-trajectory"
VARIANTS: dict[str, Callable[[SimulatedSurvey], SimulatedSurvey]] = {
    AS_DRAWN: _as_drawn,
    "half": _half,
    "quarter": _quarter,
    "noise3cm": _noisy,
    NO_TRAJECTORY: _as_drawn,
    "8bit": _eight_bit,
}
