"""Units of headings by where they begin again, and numbers that stand for no heading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.logs.ahrs import read_ahrs
from sccal.logs.yaw_values import TURNS, stands_for_none, turn_of

T_S = np.arange(0.0, 60.0, 0.05)
YAW_DEG = 200.0 * np.sin(0.1 * T_S) + 3.0 * T_S + 0.1 * np.sin(37.0 * T_S)


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("low", [0.0, -0.5])
def test_a_full_turn_tells_the_unit(turn: float, low: float) -> None:
    part = YAW_DEG / 360.0
    assert turn_of((part - low) % 1.0 * turn + low * turn) == turn


def test_noise_about_the_end_of_a_turn_hides_no_unit() -> None:
    part = (np.sin(0.3 * T_S) + 0.003 * np.random.default_rng(2).standard_normal(T_S.size)) % 1.0
    assert turn_of(part * 2000.0 * np.pi) == 2000.0 * np.pi


def test_without_a_full_turn_nothing_is_told() -> None:
    assert turn_of(np.linspace(10.0, 300.0, 500)) is None
    assert turn_of(np.where(T_S < 30.0, 10.0, 300.0)) is None
    assert turn_of(YAW_DEG) is None


def written(folder: Path, yaw: np.ndarray, name: str = "yaw_deg", digits: int = 2) -> Path:
    path = folder / "ahrs.csv"
    rows = "".join(f"{t:.2f},{value:.{digits}f}\n" for t, value in zip(T_S.tolist(), yaw.tolist(), strict=True))
    path.write_text(f"t,{name}\n{rows}")
    return path


@pytest.mark.parametrize(
    ("name", "turn", "unit"),
    [
        ("yaw_deg", 36000.0, "hundredths of a degree"),
        ("yaw_deg", 2.0 * np.pi, "radians"),
        ("yaw_deg", 1.0, "turns"),
        ("yaw_rad", 360.0, "degrees"),
        ("yaw_rad", 6400.0, "mils"),
    ],
)
def test_another_unit_than_the_name_says_is_read_and_told(tmp_path: Path, name: str, turn: float, unit: str) -> None:
    stream, notices = read_ahrs(written(tmp_path, YAW_DEG % 360.0 / 360.0 * turn, name, 5))
    assert np.degrees(stream.yaw_rad) == pytest.approx(YAW_DEG % 360.0, abs=0.01)
    assert [notice.severity for notice in notices if unit in notice.what] == ["warning"]


@pytest.mark.parametrize("number", [0.0, -1.0, 999.9])
def test_a_number_that_stands_for_none_is_dropped_and_told(tmp_path: Path, number: float) -> None:
    lost = np.random.default_rng(1).random(T_S.size) < 0.1
    stream, notices = read_ahrs(written(tmp_path, np.where(lost, number, YAW_DEG % 360.0)))
    assert abs(stream.t_s.size - (~lost).sum()) <= 2
    assert [notice for notice in notices if f"exactly {number:g}" in notice.what]


def test_zeros_before_the_first_heading_are_none() -> None:
    none, number = stands_for_none(np.where(T_S < 10.0, 0.0, 100.0 + YAW_DEG % 200.0), 360.0)
    assert number == 0.0
    assert (none == (T_S < 10.0)).all()


@pytest.mark.parametrize(
    "yaw",
    [
        np.where(T_S < 10.0, 0.0, T_S - 10.0),
        np.round(YAW_DEG % 360.0),
        np.where(T_S < 30.0, 10.0, 300.0),
        np.round(YAW_DEG % 360.0, 2),
    ],
    ids=["begins at zero", "whole degrees", "one jump", "a usual drive"],
)
def test_headings_are_kept(yaw: np.ndarray) -> None:
    assert not stands_for_none(yaw, 360.0)[0].any()
