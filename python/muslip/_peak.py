"""The state of an estimator."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Peak:
    """Peak friction and critical slip with their 1-sigma, and the correlation of the two."""

    peak_friction: float
    peak_friction_std: float
    critical_slip: float
    critical_slip_std: float
    correlation: float
