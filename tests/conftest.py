"""Small surveys for tests: laser files of a hundred points, and the command line run in this process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from tests.scenes.effort import THOROUGH

from linework.files.las.write import write_las
from linework.model.points import Points

#: UTM 32 with heights of the German height system: projected, metres, compound.
# No timing is asserted: these machines have other work. The quick run draws the same examples each time, so that a
# change is judged by what it changed, and shows a failing one as it was drawn: where each is an extraction, making it
# smaller took five minutes of a property. The long run draws others each time
PHASES = [phase for phase in hypothesis.Phase if THOROUGH or phase.name not in ("shrink", "explain")]
hypothesis.settings.register_profile("any speed", deadline=None, phases=PHASES, derandomize=not THOROUGH)
hypothesis.settings.load_profile("any speed")

CRS = "EPSG:25832+7837"


def road_points(
    n: int = 400, *, east_m: float = 500_000.0, north_m: float = 5_400_000.0, seed: int = 1
) -> Points:
    """Return a strip of flat road 40 m long, times in order."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform([0, -4, 0], [40, 4, 0.02], (n, 3)) + np.array([east_m, north_m, 100.0])
    intensity = rng.integers(200, 4000, n).astype(np.float32)
    return Points(xyz, intensity=intensity, time_s=np.linspace(3.0e8, 3.0e8 + 4, n))


@pytest.fixture
def las_file(tmp_path: Path) -> Path:
    """Return a sound laser file of 400 points."""
    path = tmp_path / "survey" / "a.laz"
    write_las(road_points(), path, crs=CRS)
    return path


@dataclass(frozen=True)
class Outcome:
    """How a command ended and what it said."""

    code: int
    stdout: str
    stderr: str

    @property
    def line(self) -> str:
        """The one line of an error: that there is exactly one is checked here."""
        lines = [line for line in self.stderr.splitlines() if line.startswith("error:")]
        assert len(lines) == 1, self.stderr
        assert self.stderr.splitlines()[-1] == lines[0], self.stderr
        assert "Traceback" not in self.stderr
        return lines[0]


@pytest.fixture
def linework(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    """Return a function that runs the command line in this process, as quickly as can be."""
    from linework.cli.app import main

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()
        code = main([str(a) for a in arguments])
        said = capsys.readouterr()
        return Outcome(code, said.out, said.err)

    return run
