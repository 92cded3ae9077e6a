"""Wheel motion without slip: a straight drive has no turns, and real turns keep their size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align.denoise import denoised_angles
from sccal.simulate.run import simulate_run
from sccal.simulate.settings import DriveSettings, SimulationSettings, VehicleSettings

RADIUS_M, TRACK_M, SPEED_MPS = 0.08, 0.70, 0.6
END_S = 400.0
PIVOT_S = (200.0, 204.0)


def wheels(
    turn_rate_radps, standing, slip_m: float, seed: int = 0, rate_hz: float = 20.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, right and left angles of a drive whose wheels slip by ``slip_m`` per root of a metre."""
    t_s = np.arange(0.0, END_S, 1.0 / rate_hz)
    along_m = np.where(standing(t_s), 0.0, SPEED_MPS / rate_hz)
    half_m = 0.5 * TRACK_M * turn_rate_radps(t_s) / rate_hz
    rng = np.random.default_rng(seed)

    def angle(travel_m: np.ndarray) -> np.ndarray:
        slipping = travel_m + slip_m * np.sqrt(np.abs(travel_m)) * rng.standard_normal(t_s.size)
        return np.concatenate(([0.0], np.cumsum(slipping[1:]))) / RADIUS_M

    return t_s, angle(along_m + half_m), angle(along_m - half_m)


def straight(slip_m: float, seed: int = 0):
    return wheels(np.zeros_like, lambda t: np.zeros_like(t, dtype=bool), slip_m, seed)


def pivot(slip_m: float, seed: int = 0):
    def turn_rate(t):
        return np.where((t > PIVOT_S[0]) & (t <= PIVOT_S[1]), np.pi / 2 / (PIVOT_S[1] - PIVOT_S[0]), 0.0)

    return wheels(turn_rate, lambda t: (t > PIVOT_S[0] - 1) & (t <= PIVOT_S[1] + 1), slip_m, seed)


def circle(slip_m: float, seed: int = 0):
    return wheels(lambda t: np.full(t.size, SPEED_MPS / 8.0), lambda t: np.zeros_like(t, dtype=bool), slip_m, seed)


def turn(right_rad: np.ndarray, left_rad: np.ndarray) -> np.ndarray:
    """Heading (rad) by the wheels."""
    return (right_rad - left_rad) * RADIUS_M / TRACK_M


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("slip_m", [0.001, 0.003, 0.01])
def test_slip_on_a_straight_drive_leaves_nearly_no_turning(slip_m, seed):
    t_s, right, left = straight(slip_m, seed)
    grid, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    raw = np.abs(np.diff(turn(np.interp(grid, t_s, right), np.interp(grid, t_s, left)))).sum()
    assert raw > 1000 * slip_m
    assert np.abs(np.diff(turn(clear_right, clear_left))).sum() < 0.02 * raw
    assert abs(turn(clear_right, clear_left)[-1]) < 1e-6


@pytest.mark.parametrize("ratio", [0.97, 1.03])
def test_unequal_radii_are_no_turn_once_their_ratio_is_known(ratio):
    t_s, right, left = straight(0.003)
    grid, clear_right, clear_left = denoised_angles(t_s, right / ratio, left, ratio)
    assert np.abs(np.diff(turn(clear_right * ratio, clear_left))).sum() < 0.1
    assert clear_right[-1] == pytest.approx(right[-1] / ratio, rel=1e-3)
    assert grid[-1] == t_s[-1]


@pytest.mark.parametrize("seed", range(5))
def test_a_pivot_keeps_its_angle(seed):
    t_s, right, left = pivot(0.003, seed)
    grid, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    around = np.array([PIVOT_S[0] - 2, PIVOT_S[1] + 2])

    def through(grid_s, right_rad, left_rad):
        return np.diff(np.interp(around, grid_s, turn(right_rad, left_rad)))[0]

    assert through(grid, clear_right, clear_left) == pytest.approx(through(t_s, right, left), rel=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_a_circle_keeps_its_turning(seed):
    t_s, right, left = circle(0.003, seed)
    _, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    assert turn(clear_right, clear_left)[-1] == pytest.approx(turn(right, left)[-1], rel=0.01)
    assert np.abs(np.diff(turn(clear_right, clear_left))).sum() == pytest.approx(turn(right, left)[-1], rel=0.01)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("slip_m", [0.003, 0.01, 0.03])
def test_a_lone_pivot_is_not_turned_back(slip_m, seed):
    """However much slips: without the mean turn of the whole run, the pivot would be undone bit by bit elsewhere."""
    t_s, right, left = pivot(slip_m, seed)
    _, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    assert turn(clear_right, clear_left)[-1] == pytest.approx(np.pi / 2, abs=0.02 + 10 * slip_m)


@pytest.mark.parametrize("drive", [straight, pivot, circle])
@pytest.mark.parametrize("slip_m", [0.0, 0.003, 0.03])
def test_total_travel_is_preserved(drive, slip_m):
    t_s, right, left = drive(slip_m)
    _, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    assert (clear_right + clear_left)[-1] == pytest.approx((right + left)[-1], rel=1e-4)


@pytest.mark.parametrize("drive", [straight, pivot, circle])
def test_without_noise_nothing_changes(drive):
    t_s, right, left = drive(0.0)
    grid, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    assert np.max(np.abs(clear_right - np.interp(grid, t_s, right))) < 1e-9
    assert np.max(np.abs(clear_left - np.interp(grid, t_s, left))) < 1e-9


@pytest.mark.parametrize("path", ["rectangle", "figure8", "general"])
def test_without_slip_ramps_and_ticks_change_little(path):
    settings = SimulationSettings(
        drive=DriveSettings(path=path, duration_s=120.0), vehicle=replace(VehicleSettings(), slip_m_per_sqrt_m=0.0)
    )
    log = simulate_run(settings)
    rad = 2.0 * np.pi / settings.encoder.ticks_per_rev
    t_s = log.encoder.host_t_s
    right, left = ((ticks - ticks[0]) * rad for ticks in (log.encoder.right_ticks, log.encoder.left_ticks))
    grid, clear_right, clear_left = denoised_angles(t_s, right, left, 1.0)
    error_m = RADIUS_M * np.abs(clear_right - np.interp(grid, t_s, right))
    assert np.max(error_m) < 0.005
    assert turn(clear_right, clear_left)[-1] == pytest.approx(turn(right, left)[-1], abs=0.01)


def test_a_standing_robot_stays_where_it_is():
    t_s = np.arange(0.0, 60.0, 0.05)
    for angle in (np.zeros(t_s.size), np.full(t_s.size, 12.0)):
        _, right, left = denoised_angles(t_s, angle, angle, 1.0)
        assert np.ptp(right) == np.ptp(left) == 0.0


def test_the_grid_spans_the_wheels_samples():
    t_s = 1717243200.0 + np.cumsum(np.random.default_rng(0).uniform(0.01, 0.09, 400))
    angle = t_s - t_s[0]
    grid, right, left = denoised_angles(t_s, angle, angle, 1.0)
    assert (grid[0], grid[-1]) == (t_s[0], t_s[-1])
    assert right.size == left.size == grid.size
    assert np.all(np.diff(grid) > 0)
    assert np.median(np.diff(grid)) == pytest.approx(0.1, rel=0.2)
