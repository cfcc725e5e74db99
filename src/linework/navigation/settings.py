"""What may be chosen about positioning."""

from __future__ import annotations

from dataclasses import dataclass

from linework.model.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationConfig:
    """Limits of what dead reckoning is trusted with."""

    longest_outage_s: float = setting(
        180.0, unit="s", low=1.0, high=3600.0,
        reason="of longer ones the middle is left out: dead reckoning keeps 0.1 % of the way, 5 m at 100 km/h",
    )  # fmt: skip
    max_sigma_m: float = setting(
        20.0, unit="m", low=0.01, high=1000.0,
        reason="less certain places are left out: that far away is another road",
    )  # fmt: skip
