"""The antenna by the path alone: every sign, with outliers, and nothing where there is too little."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.align.antenna import antenna_by_path


def drive(arm: complex, offset_rad: float, scale: float, outliers: float = 0.0, seed: int = 1):
    """A robot on bends both ways; its AHRS is off by a constant, its wheels by a scale."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 200.0, 0.2)
    heading = 0.4 + 1.5 * np.sin(0.11 * t_s)
    place = np.cumsum(0.16 * np.exp(1j * heading))
    yaw = heading + offset_rad + 0.003 * rng.standard_normal(t_s.size)
    path = np.cumsum(0.16 / scale * np.exp(1j * yaw))
    fixes = place + arm * np.exp(1j * heading) + 0.01 * (rng.standard_normal((t_s.size, 2)) @ [1.0, 1j])
    return t_s, fixes + 3.0 * (rng.random(t_s.size) < outliers), path, yaw


@pytest.mark.parametrize("arm", [2.2 - 0.3j, -0.6 + 0.4j, 0.02 - 1.5j, 0.0j])
@pytest.mark.parametrize(("offset_rad", "scale"), [(0.0, 1.0), (-2.9, 1.03), (1.2, 0.95)])
def test_the_arm_and_both_its_signs_whatever_the_zero_of_the_ahrs(arm, offset_rad, scale):
    found = antenna_by_path(*drive(arm, offset_rad, scale, outliers=0.03))
    assert found == pytest.approx((arm.real, arm.imag), abs=0.05)


def test_too_few_fixes_show_nothing():
    t_s, *rest = drive(1.0 + 0.0j, 0.0, 1.0)
    assert antenna_by_path(t_s[:40], *(one[:40] for one in rest)) is None
