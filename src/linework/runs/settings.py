"""The settings of a run: the tables of a run file."""

from __future__ import annotations

from dataclasses import dataclass

from linework.methods.obb.method import ObbConfig
from linework.methods.radon.method import RadonConfig
from linework.methods.stereo.method import StereoConfig
from linework.model.settings import group
from linework.runs.tiles import TilingConfig
from linework.surface.road import RoadConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """The settings of the surface that all methods share, of every method, and of the plan."""

    road: RoadConfig = group(RoadConfig)
    radon: RadonConfig = group(RadonConfig)
    obb: ObbConfig = group(ObbConfig)
    stereo: StereoConfig = group(StereoConfig)
    tiling: TilingConfig = group(TilingConfig)
