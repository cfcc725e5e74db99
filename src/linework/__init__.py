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

One call turns files or arrays into lines (`extract`). The methods are open at every step: `Radon`, `Obb` and `Stereo`
take functions of your own for single steps, and `extract` takes methods of your own; the steps themselves are
functions on arrays in the rooms `linework.methods.radon`, `rails`, `cables`, `obb` and `stereo`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# Before any kernel is imported
importlib.import_module("linework.kernels.cache")

#: The public names, and the module of each.
_PUBLIC = {
    "extract": "linework.library.extract",
    "trace": "linework.library.trace",
    "locate": "linework.library.read",
    "calibrate": "linework.library.calibrate",
    "open_survey": "linework.files.survey.open",
    "read_points": "linework.library.read",
    "read_trajectory": "linework.library.read",
    "read_lines": "linework.files.vectors.read_write",
    "write_lines": "linework.files.vectors.read_write",
    "find_ground": "linework.surface.road",
    "evaluate": "linework.evaluation.measures",
    "simulate": "linework.library.simulate",
    "compile_kernels": "linework.library.compile",
    "Points": "linework.model.points",
    "LineSet": "linework.model.lines",
    "Line": "linework.model.lineset.line",
    "Survey": "linework.model.survey",
    "Trajectory": "linework.model.trajectory",
    "Ground": "linework.model.ground",
    "Image": "linework.model.grid",
    "Scores": "linework.evaluation.values",
    "Report": "linework.model.lineset.report",
    "Radon": "linework.methods.radon.method",
    "Obb": "linework.methods.obb.method",
    "Stereo": "linework.methods.stereo.method",
    "Method": "linework.methods.protocol",
    "LineworkError": "linework.errors",
}
__all__ = ["__version__", *_PUBLIC]  # noqa: PLE0604

if TYPE_CHECKING:
    from linework.errors import LineworkError as LineworkError
    from linework.evaluation.measures import evaluate as evaluate
    from linework.evaluation.values import Scores as Scores
    from linework.files.survey.open import open_survey as open_survey
    from linework.files.vectors.read_write import read_lines as read_lines
    from linework.files.vectors.read_write import write_lines as write_lines
    from linework.library.calibrate import calibrate as calibrate
    from linework.library.compile import compile_kernels as compile_kernels
    from linework.library.extract import extract as extract
    from linework.library.read import locate as locate
    from linework.library.read import read_points as read_points
    from linework.library.read import read_trajectory as read_trajectory
    from linework.library.simulate import simulate as simulate
    from linework.library.trace import trace as trace
    from linework.methods.obb.method import Obb as Obb
    from linework.methods.protocol import Method as Method
    from linework.methods.radon.method import Radon as Radon
    from linework.methods.stereo.method import Stereo as Stereo
    from linework.model.grid import Image as Image
    from linework.model.ground import Ground as Ground
    from linework.model.lines import LineSet as LineSet
    from linework.model.lineset.line import Line as Line
    from linework.model.lineset.report import Report as Report
    from linework.model.points import Points as Points
    from linework.model.survey import Survey as Survey
    from linework.model.trajectory import Trajectory as Trajectory
    from linework.surface.road import find_ground as find_ground


def __getattr__(name: str) -> Any:
    """Import a public name on first use, so that `import linework` stays instant."""
    if name in _PUBLIC:
        return getattr(importlib.import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'linework' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(_PUBLIC)
