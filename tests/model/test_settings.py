"""Settings refuse what cannot be: in Python when they are made, in run files when they are read."""

import dataclasses
import tomllib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from linework.errors import ConfigError
from linework.files.settings_file import read_settings_file
from linework.methods.obb.kerbs_and_edges import BoundaryConfig
from linework.methods.radon.figures import FigureConfig
from linework.model.settings import Settings, settings_from, settings_toml
from linework.navigation.located import NavigationConfig
from linework.runs.settings import RunSettings
from linework.surface.config import RoadConfig


def all_settings(cls: Any) -> Iterator[tuple[Any, dataclasses.Field[Any]]]:
    """Yield every setting below a class, with its class."""
    for field in dataclasses.fields(cls):
        if dataclasses.is_dataclass(field.default_factory):
            yield from all_settings(field.default_factory)
        else:
            yield cls, field


SETTINGS = [
    pytest.param(cls, field, id=f"{cls.__name__}.{field.name}")
    for top in (RunSettings, NavigationConfig, FigureConfig)
    for cls, field in all_settings(top)
]


@pytest.mark.parametrize(("cls", "field"), SETTINGS)
def test_every_setting_refuses_what_it_cannot_be(cls, field):
    assert issubclass(cls, Settings)
    kind = type(field.default)
    wrong = [None, [field.default], "text" if kind is not str else 3]
    if kind in (int, float):
        wrong += [float("nan"), float("inf"), -float("inf"), True]
        low, high = field.metadata["low"], field.metadata["high"]
        wrong += [bound for bound in (low - 1, high + max(1, abs(high))) if abs(bound) < np.inf]
    if kind is int:
        wrong.append(field.default + 0.5)
    for value in wrong:
        with pytest.raises(
            ConfigError, match=rf"^{cls.__name__}: {field.name} is .*, expected .*\. Correct the value\.$"
        ):
            cls(**{field.name: value})
        with pytest.raises(ConfigError, match=rf"^a\.toml: x\.{field.name} is "):
            settings_from(cls, {field.name: value}, where="a.toml", prefix="x.")
    assert getattr(cls(**{field.name: field.default}), field.name) == field.default


def test_the_line_names_value_and_bounds_with_their_unit():
    with pytest.raises(ConfigError) as caught:
        RoadConfig(cell_m=-1)
    assert str(caught.value) == (
        "RoadConfig: cell_m is -1, expected a number from 0.05 to 5 [m]. Correct the value."
    )
    with pytest.raises(ConfigError, match=r"normal_deg is 0\.087\d*, expected a number from 1 to 30 \[deg\]"):
        BoundaryConfig(normal_deg=np.radians(5.0))
    with pytest.raises(ConfigError, match="cell_m is 9, expected"):
        dataclasses.replace(RoadConfig(), cell_m=9)


def test_numbers_of_numpy_become_numbers():
    road = RoadConfig(cell_m=np.float32(0.5), max_cells=np.int64(2000))
    assert (type(road.cell_m), type(road.max_cells)) == (float, int)
    assert RoadConfig(cell_m=1) == RoadConfig(cell_m=1.0)
    assert type(RoadConfig(cell_m=1).cell_m) is float


def test_groups_and_unknown_names_are_refused():
    with pytest.raises(
        ConfigError, match=r"^RunSettings: road is 3, expected a table \[road\] \(RoadConfig\)"
    ):
        RunSettings(road=3)
    with pytest.raises(
        ConfigError, match=r"unknown key road\.cel_m\. Did you mean cell_m\? Known here: cell_m, "
    ):
        settings_from(RunSettings, {"road": {"cel_m": 1}})


def test_a_run_file_gives_the_settings_that_were_written(tmp_path):
    for cls in (RunSettings, NavigationConfig, FigureConfig):
        assert settings_from(cls, tomllib.loads(settings_toml(cls()))) == cls()
    path = tmp_path / "run.toml"
    path.write_text("[road]\ncell_m = 1\n", encoding="utf-8")
    assert read_settings_file(RunSettings, path) == RunSettings(road=RoadConfig(cell_m=1.0))
    path.write_text("[radon]\ncell_m = -1\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"run\.toml: radon\.cell_m is -1, expected a number from "):
        read_settings_file(RunSettings, path)
