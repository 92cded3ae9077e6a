"""Counters that are full: named with number, line and time; others that stand at such a number are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sccal.arrays import Floats
from sccal.errors import DataError
from sccal.logs.encoder import read_encoder
from sccal.logs.streams import Vehicle, WheelStream

T_S = 0.02 * np.arange(2000)
DRIVE = np.round(1000.0 * T_S)
"""A thousand counts a second: to 40000."""


def read(folder: Path, left: Floats, right: Floats, bits: int | None = None) -> WheelStream:
    rows = [f"{t:.4f},{a:.0f},{b:.0f}" for t, a, b in zip(T_S, left, right, strict=True)]
    (folder / "encoder.csv").write_text("\n".join(["t,left_ticks,right_ticks", *rows, ""]))
    vehicle = Vehicle("demo", folder / "vehicle.toml", 0.1, 0.7, ticks_per_rev=1000.0, counter_bits=bits)
    return read_encoder(folder / "encoder.csv", vehicle)[0]


@pytest.mark.parametrize("bits", [None, 16, 32])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_full_counter_is_named(tmp_path: Path, side: str, sign: float, bits: int | None) -> None:
    full, other = np.clip(sign * DRIVE, -32768, 32767), sign * 0.7 * DRIVE
    pair = (full, other) if side == "left" else (other, full)
    end, line = ("32767", 1641) if sign > 0 else ("-32768", 1641)
    with pytest.raises(
        DataError, match=rf"line {line}, t = 32\.780 s: the {side} counter saturates: .* {end}, the end of a 16"
    ):
        read(tmp_path, *pair, bits=bits)


def test_both_full_and_wider_ones(tmp_path: Path) -> None:
    both = np.minimum(DRIVE, 32767)
    with pytest.raises(DataError, match="the other one is full as well"):
        read(tmp_path, both, both)
    with pytest.raises(DataError, match="65535, the end of a 16-bit counter"):
        read(tmp_path, np.minimum(2.0 * DRIVE, 65535), 0.5 * DRIVE)
    with pytest.raises(DataError, match="2047, the end of a 12-bit counter"):
        read(tmp_path, np.minimum(0.1 * DRIVE, 2047), 0.05 * DRIVE, bits=12)


def test_a_counter_that_comes_back_from_its_end_was_full(tmp_path: Path) -> None:
    """Where the robot reverses, a counter that is kept within its ends counts down from there."""
    there_and_back = np.where(T_S < 36.0, DRIVE, 72000.0 - DRIVE)
    with pytest.raises(DataError, match=r"saturates: it stays at 32767, .* for 6\.\d s"):
        read(tmp_path, np.minimum(there_and_back, 32767), 0.5 * DRIVE)


def test_a_counter_that_wraps_is_none(tmp_path: Path) -> None:
    wrapped = (DRIVE + 32768) % 65536 - 32768
    stream = read(tmp_path, wrapped, 0.5 * DRIVE)
    assert stream.left_rad[-1] == pytest.approx(2 * np.pi * DRIVE[-1] / 1000.0)


def test_a_count_below_zero_of_an_unsigned_counter_is_none(tmp_path: Path) -> None:
    """A wheel that stands one count behind its start, while the robot turns about it."""
    left = np.where(T_S < 1.0, 0.0, np.where(T_S < 10.0, 65535.0, (DRIVE - 10000.0) % 65536))
    stream = read(tmp_path, left, 0.3 * DRIVE)
    assert stream.left_rad.size == T_S.size


def test_a_robot_that_rests_there_is_none(tmp_path: Path) -> None:
    rests = np.minimum(DRIVE, 32767)
    stream = read(tmp_path, rests, np.minimum(0.5 * DRIVE, 16383))
    assert stream.left_rad.size == T_S.size
