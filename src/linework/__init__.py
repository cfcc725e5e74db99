"""linework: georeferenced 3-D road lines from mobile-mapping surveys.

Conventions
-----------
- SI units internally: metres, seconds, radians; fields, options and columns carry the unit in their name.
- Points are (n, 3): east, north, up, float64, in the survey's projected CRS. A local origin is subtracted
  before a conversion to float32.
- Images are (row, col); row 0 is north.
- Vehicle frame: x forward, y left, z up, origin on the ground under the rear axle (ISO 8855).
- Heading: clockwise from grid north. Roll: right side down positive. Pitch: nose up positive.
- Transforms are named ``T_to_from``: inner names cancel.
- One time scale: GPS seconds, float64.
- The normal form of a line is ``x cos(theta) + y sin(theta) = rho``.

Three levels of use: one call (`extract`), a few steps (`open_survey`, `read_survey_points`, `Obb`,
`Radon`), single steps (the rooms `linework.surface`, `linework.imaging`, `linework.methods.obb`,
`linework.methods.radon`, `linework.lines`).
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_PUBLIC = {
    "Bounds": "linework.model.grid",
    "Grid": "linework.model.grid",
    "Image": "linework.model.grid",
    "LineSet": "linework.model.lines",
    "LineworkError": "linework.errors",
    "Points": "linework.model.points",
    "Survey": "linework.model.survey",
    "TileData": "linework.model.tile",
    "Trajectory": "linework.model.trajectory",
    "Obb": "linework.methods.obb.method",
    "Radon": "linework.methods.radon.method",
    "evaluate": "linework.evaluation.measures",
    "extract": "linework.runs.extract",
    "open_survey": "linework.files.survey.open",
    "read_lines": "linework.files.vectors.read_write",
    "read_survey_points": "linework.files.store.in_memory",
    "read_survey_trajectory": "linework.files.store.in_memory",
    "write_lines": "linework.files.vectors.read_write",
}
__all__ = ["__version__", *_PUBLIC]  # noqa: PLE0604

if TYPE_CHECKING:
    from linework.errors import LineworkError as LineworkError
    from linework.evaluation.measures import evaluate as evaluate
    from linework.files.store.in_memory import read_survey_points as read_survey_points
    from linework.files.store.in_memory import read_survey_trajectory as read_survey_trajectory
    from linework.files.survey.open import open_survey as open_survey
    from linework.files.vectors.read_write import read_lines as read_lines
    from linework.files.vectors.read_write import write_lines as write_lines
    from linework.methods.obb.method import Obb as Obb
    from linework.methods.radon.method import Radon as Radon
    from linework.model.grid import Bounds as Bounds
    from linework.model.grid import Grid as Grid
    from linework.model.grid import Image as Image
    from linework.model.lines import LineSet as LineSet
    from linework.model.points import Points as Points
    from linework.model.survey import Survey as Survey
    from linework.model.tile import TileData as TileData
    from linework.model.trajectory import Trajectory as Trajectory
    from linework.runs.extract import extract as extract


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that `import linework` stays instant."""
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'linework' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
