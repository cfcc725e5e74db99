"""What was corrected of the drives of a survey and of the turns of its scanner, for run.json and for people."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class DriveAccount:
    """How a drive was corrected.

    Parameters
    ----------
    start_s, end_s
        Of its poses at which points were measured. [s]
    n_ties
        Differences to other drives that it was tied by.
    correction_m
        Root mean square of its correction in plan and in height. [m]
    sigma_m
        Root mean square of the standard deviation of its path afterwards: across and in height at its ties. [m]
    """

    start_s: float
    end_s: float
    n_ties: int
    correction_m: tuple[float, float]
    sigma_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class DrivesAccount:
    """How the drives of a survey were made to agree.

    Parameters
    ----------
    drives
        In the order of their times.
    apart_m, left_apart_m
        Median size of the differences between drives at their lines, across and in height, before and after. [m]

    Examples
    --------
    >>> one = DriveAccount(0.0, 9.0, 40, (0.03, 0.02), (0.01, 0.01))
    >>> DrivesAccount((one, one), (0.062, 0.041), (0.004, 0.003)).summary
    '2 drives adjusted at their lines: 6.2 cm apart across and 4.1 cm in height, 0.4 and 0.3 cm after'
    """

    drives: tuple[DriveAccount, ...]
    apart_m: tuple[float, float]
    left_apart_m: tuple[float, float]

    @property
    def summary(self) -> str:
        """One line."""
        before, after = (tuple(100.0 * v for v in pair) for pair in (self.apart_m, self.left_apart_m))
        return (
            f"{len(self.drives)} drives adjusted at their lines: {before[0]:.1f} cm apart across and {before[1]:.1f} cm in"
            f" height, {after[0]:.1f} and {after[1]:.1f} cm after"
        )

    def as_document(self) -> dict[str, Any]:
        """Return it for run.json."""
        return {
            "summary": self.summary,
            "apart_m": _rounded(self.apart_m),
            "left_apart_m": _rounded(self.left_apart_m),
            "adjusted": [
                {
                    name: _rounded(value) if isinstance(value, tuple) else value
                    for name, value in asdict(one).items()
                }
                for one in self.drives
            ],
        }


@dataclass(frozen=True, slots=True)
class TurnsAccount:
    """How the turns of a spinning lidar were levelled.

    Parameters
    ----------
    n_turns
        Turns, or stretches of time.
    apart_m, left_apart_m
        Standard deviation of the heights of turns to the mean of all, before and after. [m]
    common_sigma_m
        Standard deviation of what the turns of a place have in common. [m]
    n_passing
        Points that were left out, of things that passed while the scanner looked.

    Examples
    --------
    >>> TurnsAccount(154, 0.055, 0.01, 0.075, 2480).summary
    '154 turns of the scanner levelled: 5.5 cm apart in height, 1.0 cm after; without 2,480 points of what passed'
    """

    n_turns: int
    apart_m: float
    left_apart_m: float
    common_sigma_m: float
    n_passing: int

    @property
    def summary(self) -> str:
        """One line."""
        passing = f"; without {self.n_passing:,} points of what passed" if self.n_passing else ""
        return (
            f"{self.n_turns} turns of the scanner levelled: {100 * self.apart_m:.1f} cm apart in height,"
            f" {100 * self.left_apart_m:.1f} cm after{passing}"
        )

    def as_document(self) -> dict[str, Any]:
        """Return it for run.json."""
        values = {name: round(value, 4) for name, value in asdict(self).items()}
        return {"summary": self.summary, **values}


def _rounded(values: tuple[float, ...]) -> list[float]:
    return [round(value, 4) for value in values]
