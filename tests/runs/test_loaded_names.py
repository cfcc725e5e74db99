"""What workers load before they are forked: the kernels of everything that the run comes to, from wherever it is called."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from linework.library import extract as of_library
from linework.library import opened
from linework.model.points import Points
from linework.model.survey import Survey
from linework.runs import compile as compiling
from linework.workbench.jobs import extract as of_workbench


class _AskedError(Exception):
    """An executor was asked for."""


def asked(*_: Any, names: Any, **__: Any) -> None:
    raise _AskedError(sorted(names))


def test_points_in_memory_and_their_columns_are_among_them(monkeypatch):
    monkeypatch.setattr(of_library, "executor_for", asked)
    monkeypatch.setattr(opened, "compile_stage", lambda *_: None)
    xyz = np.random.default_rng(1).uniform(0.0, 20.0, (500, 3))
    points = Points(xyz, crs="EPSG:25832", columns={"range": np.ones(500, np.float32)})
    with pytest.raises(_AskedError) as caught:
        of_library.extract(points, methods="obb", kinds="kerb_top")
    assert caught.value.args[0] == ["columns", "kerb_top", "points"]


def test_points_of_files_are_among_those_of_the_workbench(monkeypatch, tmp_path):
    monkeypatch.setattr(of_workbench, "executor_for", asked)
    monkeypatch.setattr(of_workbench, "promised_points", lambda _: 1)
    monkeypatch.setattr(of_workbench, "give_way", lambda _: None)
    survey = Survey(name="s", root=tmp_path, point_files=(tmp_path / "a.las",), crs=None, carry=("range",))
    session: Any = SimpleNamespace(survey=survey, settings=None, report=lambda _: None)
    request: Any = SimpleNamespace(method="auto", kinds=("kerb_top",))
    with pytest.raises(_AskedError) as caught:
        of_workbench.extract_in_worker(session, request)
    assert caught.value.args[0] == ["columns", "kerb_top", "points"]


def test_what_is_compiled_is_loaded_where_something_else_is_not(monkeypatch):
    monkeypatch.setattr(compiling, "is_compiled", lambda groups: "points" not in groups)
    assert compiling.loading_of(["kerb_top", "points"]) == (
        "linework.kernels.compiling:load_kernels",
        "boundaries",
    )
    assert compiling.loading_of(["points"]) == ()
