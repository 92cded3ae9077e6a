"""When sentences were true: dates from every source, week rollover, leap seconds learnt late, epochs of the untimed."""

from __future__ import annotations

import calendar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.logs.nmea import parse_nmea, parse_nmea_heading
from sccal.logs.streams import FixStream, Notice
from sccal.logs.write import gga, rmc, zda
from tests.receiver import ggk, hdt, ksxt, ths, vtg

NOON_S = float(calendar.timegm((2024, 6, 1, 12, 0, 0)))
WEEKS_S = 1024 * 7 * 86400.0


def read(lines: list[str]) -> tuple[FixStream, tuple[Notice, ...]]:
    return parse_nmea(("\n".join(lines) + "\n").encode(), "gnss.nmea")


def fix(utc_s: float) -> str:
    return gga(utc_s, 52.1, 5.3, 40.0, 4, 12, 0.6, 0.8)


def date(utc_s: float) -> str:
    return rmc(utc_s, 52.1, 5.3, 1.0, 90.0, "R")


def told(notices: tuple[Notice, ...], words: str) -> Notice:
    matches = [notice for notice in notices if words in notice.what]
    assert len(matches) == 1, [str(notice) for notice in notices]
    return matches[0]


@pytest.mark.parametrize("dating", ["rmc", "zda", "ggk", "ksxt"])
@pytest.mark.parametrize("dated_at", [0, 49, 50, 99])
def test_each_date_reaches_over_midnight(dating: str, dated_at: int) -> None:
    start_s = float(calendar.timegm((2023, 12, 31, 23, 59, 55)))
    lines = [fix(start_s + 0.1 * i) for i in range(100)]
    when = start_s + 0.1 * dated_at
    stated = {"rmc": date(when), "zda": zda(when), "ggk": ggk(when, 52.1, 5.3, 3), "ksxt": ksxt(when)}[dating]
    stream, notices = read([*lines[:dated_at], stated, *lines[dated_at:]])
    np.testing.assert_allclose(stream.utc_s, start_s + 0.1 * np.arange(100), atol=1e-6)
    assert stream.utc_has_date
    assert not notices


@pytest.mark.parametrize("turns", [1, 2, -1])
def test_dates_of_a_rolled_over_week_count_are_mended_by_the_receive_times(turns: int) -> None:
    wrong_s = NOON_S - turns * WEEKS_S
    lines = [f"{NOON_S + 0.1 * i + 0.02:.3f} {line}" for i in range(50) for line in (date(wrong_s + 0.1 * i),)]
    lines += [f"{NOON_S + 0.1 * i + 5.02:.3f} {fix(wrong_s + 5 + 0.1 * i)}" for i in range(50)]
    stream, notices = read(lines)
    np.testing.assert_allclose(stream.utc_s, NOON_S + 5 + 0.1 * np.arange(50), atol=1e-6)
    assert told(notices, "rolled over").severity == "warning"


def test_without_receive_times_old_dates_are_told() -> None:
    wrong_s = NOON_S - WEEKS_S
    stream, notices = read([date(wrong_s), *(fix(wrong_s + i) for i in range(5))])
    assert stream.utc_s[0] == wrong_s
    assert "2004-10-16" in told(notices, "rolled over").what


def test_receive_times_from_zero_say_nothing_about_the_date() -> None:
    stream, notices = read([f"{i}.0 {line}" for i in range(5) for line in (date(NOON_S + i), fix(NOON_S + i))])
    assert stream.utc_s[0] == NOON_S
    assert not notices


@settings(max_examples=40)
@given(
    st.integers(1, 18),
    st.sampled_from([0.1, 0.2, 1.0]),
    st.integers(6, 94),
    st.booleans(),
    st.sampled_from([0.0, NOON_S + 3.3]),
)
def test_leap_seconds_learnt_late_are_mended(
    ahead_s: int, step_s: float, learnt_at: int, with_host: bool, host_zero_s: float
) -> None:
    rng = np.random.default_rng(ahead_s)
    lines = []
    for i in range(100):
        utc_s = NOON_S + step_s * i
        stated_s = utc_s + (ahead_s if i < learnt_at else 0)
        prefix = f"{utc_s - NOON_S + host_zero_s + rng.gamma(4, 0.005):.4f} " if with_host else ""
        lines += [prefix + line for line in (fix(stated_s), date(stated_s))]
    stream, notices = read(lines)
    if not with_host and ahead_s - step_s < 0.75:
        return
    np.testing.assert_allclose(stream.utc_s, NOON_S + step_s * np.arange(100), atol=1e-6)
    notice = told(notices, "leap seconds")
    assert f"{-ahead_s:+d} s" in notice.what
    assert bool(notice.doubt) == (not with_host)


def test_a_step_forward_needs_the_receive_times() -> None:
    def lines(with_host: bool) -> list[str]:
        utc_s = NOON_S + 0.1 * np.arange(100)
        stated_s = utc_s + np.where(np.arange(100) < 40, -2.0, 0.0)
        pairs = zip(utc_s, stated_s, strict=True)
        return [(f"{own - NOON_S:.4f} " if with_host else "") + fix(stated) for own, stated in pairs]

    stream, notices = read([*lines(True), date(NOON_S + 10)])
    np.testing.assert_allclose(np.diff(stream.utc_s), 0.1, atol=1e-6)
    assert "+2 s" in told(notices, "leap seconds").what
    stream, notices = read([*lines(False), date(NOON_S + 10)])
    assert np.diff(stream.utc_s).max() == pytest.approx(2.1)
    assert not notices


def test_a_pause_of_whole_seconds_is_no_step_of_utc() -> None:
    times_s = NOON_S + np.concatenate((np.arange(50), np.arange(68, 100)))
    stream, notices = read([date(NOON_S), *(f"{t - NOON_S + 7.02:.3f} {fix(t)}" for t in times_s)])
    np.testing.assert_allclose(stream.utc_s, times_s, atol=1e-6)
    assert not notices


def test_leap_seconds_learnt_in_a_pause_are_mended() -> None:
    times_s = NOON_S + np.concatenate((np.arange(50), np.arange(90, 140)))
    stated_s = times_s + np.where(times_s < NOON_S + 60, 18.0, 0.0)
    pairs = zip(times_s, stated_s, strict=True)
    stream, notices = read([date(NOON_S), *(f"{own - NOON_S + 7.02:.3f} {fix(stated)}" for own, stated in pairs)])
    np.testing.assert_allclose(stream.utc_s, times_s, atol=1e-6)
    assert "-18 s" in told(notices, "leap seconds").what


@pytest.mark.parametrize("step_s", [3.0, -5.0])
def test_a_logging_clock_that_steps_is_not_blamed_on_the_receiver(step_s: float) -> None:
    times_s = NOON_S + 0.1 * np.arange(100)
    lines = [f"{t - NOON_S + 50 + (step_s if i >= 50 else 0):.3f} {fix(t)}" for i, t in enumerate(times_s)]
    stream, notices = read([date(NOON_S), *lines])
    np.testing.assert_allclose(stream.utc_s, times_s, atol=1e-6)
    assert not notices


def test_lines_that_wait_and_come_at_once_are_no_step_of_utc() -> None:
    times_s = NOON_S + 0.1 * np.arange(100)
    host_s = times_s - NOON_S
    host_s[40:60] = host_s[60]
    stream, notices = read([date(NOON_S), *(f"{h:.3f} {fix(t)}" for h, t in zip(host_s, times_s, strict=True))])
    np.testing.assert_allclose(stream.utc_s, times_s, atol=1e-6)
    assert not notices


def headings(lines: list[str]) -> tuple[np.ndarray, np.ndarray]:
    heading, _ = parse_nmea_heading(("\n".join(lines) + "\n").encode(), "gnss.nmea")
    assert heading.utc_s is not None
    return np.round(heading.utc_s - NOON_S, 3), np.round(np.degrees(heading.yaw_rad), 2)


def burst(i: int, parts: list[str], jitter_s: float = 0.0) -> list[str]:
    return [f"{0.1 * i + 0.03 + 0.001 * k + jitter_s:.4f} {part}" for k, part in enumerate(parts)]


@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("make", [hdt, ths])
def test_an_untimed_heading_belongs_to_its_burst(place: int, make: object) -> None:
    """Before, among and after the timed sentences: the receive times show where a burst begins."""
    rng = np.random.default_rng(3)
    lines = []
    for i in range(50):
        utc_s = NOON_S + 0.1 * i
        parts = [fix(utc_s), date(utc_s)]
        parts.insert(place, make(float(i)))
        lines += burst(i, parts, rng.gamma(2, 0.005))
    utc_s, yaw_deg = headings(lines)
    np.testing.assert_allclose(utc_s, 0.1 * yaw_deg, atol=1e-6)
    assert yaw_deg.size == 50


def test_without_receive_times_a_heading_follows_its_epoch() -> None:
    lines = [line for i in range(20) for line in (date(NOON_S + i), fix(NOON_S + i), hdt(float(i)))]
    utc_s, yaw_deg = headings(lines)
    np.testing.assert_allclose(utc_s, yaw_deg)


@pytest.mark.parametrize("with_host", [True, False])
def test_a_heading_whose_own_epoch_was_lost_takes_no_other(with_host: bool) -> None:
    lines = []
    for i in range(50):
        utc_s = NOON_S + 0.1 * i
        parts = [fix(utc_s), hdt(float(i))] if i not in (20, 21, 33) else [hdt(float(i))]
        lines += burst(i, parts) if with_host else parts
    utc_s, yaw_deg = headings([date(NOON_S - 0.1), *lines] if not with_host else [*burst(-1, [date(NOON_S)]), *lines])
    np.testing.assert_allclose(utc_s, 0.1 * yaw_deg, atol=1e-6)
    assert yaw_deg.size == 47


@pytest.mark.parametrize("place", [0, 1])
def test_a_speed_without_time_belongs_to_its_burst(place: int) -> None:
    lines = []
    for i in range(50):
        parts = [fix(NOON_S + 0.1 * i)]
        parts.insert(place, vtg(0.0, 3.6 * 0.01 * i))
        lines += burst(i, parts)
    stream, _ = read([*burst(-1, [zda(NOON_S)]), *lines])
    np.testing.assert_allclose(stream.speed_mps, 0.01 * np.arange(50), atol=3e-4)


def _whole(t: float, lat_deg: float) -> str:
    """A GGA whose epoch has lost its fraction."""
    return gga(float(np.floor(t)), lat_deg, 5.3, 40.0, 4, 12, 0.6, 0.8)


def test_epochs_that_lost_their_fractions_get_them_back() -> None:
    t = NOON_S + 0.2 * np.arange(2, 60)
    lines = [f"{one + 0.03:.3f} {_whole(one, 52.0 + 1e-6 * k)}" for k, one in enumerate(t.tolist())]
    fixes, notices = parse_nmea("\n".join([*lines, ""]).encode(), "gnss.nmea")
    assert fixes.host_t_s - fixes.utc_s == pytest.approx(np.full(t.size, fixes.host_t_s[0] - fixes.utc_s[0]), abs=1e-3)
    assert any("lost their fraction" in notice.what for notice in notices)


def test_lines_that_are_written_again_get_no_fractions() -> None:
    t = NOON_S + 0.2 * np.arange(60)
    lines = [f"{one + 0.03:.3f} {_whole(one, 52.0 + 1e-6 * (k // 5))}" for k, one in enumerate(t.tolist())]
    fixes, _ = parse_nmea("\n".join([*lines, ""]).encode(), "gnss.nmea")
    assert (fixes.utc_s == np.floor(fixes.utc_s)).all()
