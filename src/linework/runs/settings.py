"""Settings of a run, as they stand in the tables of a run file."""

from __future__ import annotations

from dataclasses import dataclass

from linework.methods.obb.method import ObbConfig
from linework.methods.radon.method import RadonConfig
from linework.methods.stereo.method import StereoConfig
from linework.model.settings import Settings, group, setting
from linework.published.obb_2023 import Obb2023Config
from linework.published.radon_2002 import Radon2002Config
from linework.published.stereo_1992 import Stereo1992Config
from linework.surface.road import RoadConfig


@dataclass(frozen=True, slots=True, kw_only=True)
class TilingConfig(Settings):
    """Settings of the tiles; the lines do not depend on them."""

    core_m: float = setting(
        512.0,
        unit="m",
        reason="eight blocks of the tile store; its buffer is a sixth of it",
        low=64,
        high=4096,
    )
    high_core_m: float = setting(
        2048.0,
        unit="m",
        reason="of methods that look at high points only: few, and a wide buffer that is a fifth of it",
        low=64,
        high=8192,
    )
    max_points: int = setting(
        3_000_000,
        unit="points",
        reason="a tile with more, buffer included, is divided: a worker needs some 150 bytes a point",
        low=10_000,
        high=1_000_000_000,
    )
    least_core_m: float = setting(
        64.0, unit="m", reason="tiles are not divided below a block of the tile store", low=16, high=4096
    )
    shift_east_m: float = setting(0.0, unit="m", reason="moves the lattice of the cores", low=-1e7, high=1e7)
    shift_north_m: float = setting(0.0, unit="m", reason="moves the lattice of the cores", low=-1e7, high=1e7)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings(Settings):
    """Settings of the surface that all methods share, of each method, and of the tiles."""

    road: RoadConfig = group(RoadConfig)
    radon: RadonConfig = group(RadonConfig)
    obb: ObbConfig = group(ObbConfig)
    stereo: StereoConfig = group(StereoConfig)
    radon_2002: Radon2002Config = group(Radon2002Config)
    obb_2023: Obb2023Config = group(Obb2023Config)
    stereo_1992: Stereo1992Config = group(Stereo1992Config)
    tiling: TilingConfig = group(TilingConfig)
