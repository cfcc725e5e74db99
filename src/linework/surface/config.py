"""Settings of the road surface."""

from __future__ import annotations

from dataclasses import dataclass

from linework.model.settings import Settings, setting


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadConfig(Settings):
    """Settings of the road surface."""

    cell_m: float = setting(
        0.5,
        unit="m",
        reason="holds two scan lines at 25 cm spacing; a kerb still stands out",
        low=0.05,
        high=5,
    )
    support_m: float = setting(
        0.15, unit="m", reason="a point with none this close above it is a stray", low=0.01, high=1
    )
    layer_m: float = setting(
        0.20,
        unit="m",
        reason="ground layer of a cell: 12 % grade over 0.5 m, and four sigma of 2 cm noise on both sides",
        low=0.02,
        high=1,
    )
    max_grade: float = setting(
        0.25, unit="m/m", reason="12 % grade, 6 % crossfall and twice that for a reserve", low=0.01, high=2
    )
    max_step_m: float = setting(
        0.035,
        unit="m",
        reason="half of the lowest kerb (7 cm); the mean of a cell is good to 1 cm",
        low=0.005,
        high=1,
    )
    ground_step_m: float = setting(
        0.25, unit="m", reason="per cell: banks up to 1 in 2 and kerbs, not walls or cars", low=0.01, high=5
    )
    roughness_m: float = setting(
        0.06,
        unit="m",
        reason="spread of the layer on asphalt at 12 % grade and 2 cm noise is 3 cm",
        low=0.005,
        high=1,
    )
    carry_m: float = setting(
        10.0,
        unit="m",
        reason="how far beyond its edge the road's height is the reference; then the ground",
        low=0,
        high=200,
    )
    max_cells: int = setting(
        60_000_000, unit="cells", reason="bounds the memory to about 2 GB", low=1000, high=2_000_000_000
    )
