"""Clocks that wrap or are set in the middle of a log, in tables and before sentences, and streams of other zones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.logs.nmea import parse_nmea
from sccal.logs.one_clock import on_one_clock
from sccal.logs.set_clock import carried_on
from sccal.logs.streams import ClockStep, FixStream, HeadingStream, Notice, WheelStream
from sccal.logs.write import gga, rmc

T_S = np.arange(0.0, 60.0, 0.05)
DAY_S = 86400.0
STEPS = {
    "16 bits": (T_S + 40.0) % 65.536,
    "microseconds": (T_S - 30.0) % 4294.967296,
    "signed": (T_S - 30.0) % 4294.967296 - 2147.483648,
    "milliseconds": (T_S - 30.0) % 4294967.296,
    "midnight": (T_S - 30.0) % DAY_S,
    "3 days": 1.7e9 + T_S - 3 * DAY_S * (T_S < 20.0),
    "20 years": 1.7e9 + T_S + 7305 * DAY_S * (T_S < 20.0),
    "an hour back": 1.7e9 + T_S - 3600.0 * (T_S > 20.0),
    "from its zero": T_S + (1.7e9 + 0.123) * (T_S > 20.0),
}


def carried(t_s: np.ndarray) -> tuple[np.ndarray, tuple[ClockStep, ...], list[Notice]]:
    notices: list[Notice] = []
    moved, steps = carried_on(t_s, np.arange(t_s.size) + 2, "encoder.csv", notices)
    return moved, steps, notices


@pytest.mark.parametrize("name", STEPS)
def test_a_step_of_the_clock_is_carried_on(name: str) -> None:
    moved, steps, notices = carried(STEPS[name])
    assert np.diff(moved) == pytest.approx(np.full(T_S.size - 1, 0.05), abs=1e-5)
    assert len(steps) == (name == "from its zero")
    assert [notice.severity for notice in notices] == ["warning"]


@pytest.mark.parametrize(
    "t_s",
    [T_S, T_S - 2.0 * (T_S > 20.0), T_S - 77.3 * (T_S > 20.0), T_S + 500.0 * (T_S > 20.0), T_S + 1e6 * (T_S == 3.0)],
    ids=["none", "2 s back", "begins again", "pause", "one bad stamp"],
)
def test_what_may_be_something_else_is_left(t_s: np.ndarray) -> None:
    moved, steps, notices = carried(t_s)
    assert (moved == t_s).all()
    assert not steps
    assert not notices


def test_receive_times_are_carried_on_as_tables_are() -> None:
    lines = []
    for k in range(100):
        t = 1717243200.0 + 0.2 * k
        said = [gga(t, 52.1, 5.3, 40.0, 4, 12, 0.6, 0.8), *([rmc(t, 52.1, 5.3, 1.0, 90.0)] if k % 5 == 0 else [])]
        lines += [f"{(0.2 * k - 10.0) % 4294.967296:.6f} {text}" for text in said]
    fixes, _ = parse_nmea("\n".join([*lines, ""]).encode(), "gnss.nmea")
    assert np.diff(fixes.host_t_s) == pytest.approx(np.full(99, 0.2), abs=1e-5)


def streams(wheel_s: float, heading_s: float, fix_s: float) -> tuple[WheelStream, HeadingStream, FixStream]:
    zero, none = np.zeros(T_S.size), np.full(T_S.size, np.nan)
    wheels = WheelStream(T_S + wheel_s, zero, zero, zero > 0)
    heading = HeadingStream(T_S + heading_s, zero)
    quality = np.full(T_S.size, 4)
    return wheels, heading, FixStream(T_S + fix_s, none, False, zero, zero, none, quality, none, none, zero)


def test_times_of_day_and_local_times_are_put_on_the_wheels_clock() -> None:
    heading, fixes, notices = on_one_clock(*streams(43200.0, 1717243200.25, 1717250400.5))
    assert heading.t_s == pytest.approx(T_S + 43200.25, abs=1e-5)
    assert fixes.host_t_s == pytest.approx(T_S + 43200.5, abs=1e-5)
    assert len(notices) == 2


@pytest.mark.parametrize("away_s", [0.0, 97.3, 400.0, 1234.0])
def test_another_distance_is_left_for_the_motion(away_s: float) -> None:
    heading, fixes, notices = on_one_clock(*streams(1000.0, 1000.0 + away_s, 1000.0))
    assert heading.t_s == pytest.approx(T_S + 1000.0 + away_s)
    assert fixes.host_t_s == pytest.approx(T_S + 1000.0)
    assert not notices


def test_a_step_of_unknown_size_is_the_wheels() -> None:
    wheels, heading, fixes = streams(0.0, 0.0, 0.0)
    wheels = replace(wheels, clock_steps=(ClockStep(20.0, 1e9),))
    fixes = replace(fixes, clock_steps=(ClockStep(20.0, 1e9 + 0.15),))
    _, fixes, _ = on_one_clock(wheels, heading, fixes)
    assert fixes.host_t_s == pytest.approx(np.where(T_S < 20.0, T_S - 0.15, T_S), abs=1e-6)
