"""Small trade-offs that tests share."""

from __future__ import annotations

from typing import Any

from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.spec import TradeoffSpec
from lpet_sim.tradeoff.static import setting_of
from lpet_sim.tradeoff.static_view import Setting

FLAT: dict[str, Any] = {"relief": {"rms_slope_rad": 0.02}, "far": None}
SENSOR = Candidate(image_interval_m=0.4, resolution_px=512)


def spec_of(**more: Any) -> TradeoffSpec:
    """Make a trade-off over one sensor on a flat plain without rocks, 6 m long."""
    told: dict[str, Any] = {"name": "small", "space": {}, "site": {}, **more}
    told["site"] = {"terrain": FLAT, "distance_m": 6.0, **told["site"]}
    return TradeoffSpec.from_mapping(told)


def small_setting(seed: int = 0, **more: Any) -> Setting:
    """Draw the landmarks of a small trade-off."""
    return setting_of(spec_of(**more), seed)
