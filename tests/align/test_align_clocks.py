"""Clocks: receive jitter goes, a steered logging clock is followed, and signs and days come out right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import gamma

from sccal.align.clocks import fixes_on_host_clock, require_overlap
from sccal.errors import DataError
from sccal.logs.streams import FixStream, Notice
from sccal.results.clock import Clock

START_UTC_S = 1717243200.0
MEAN_DELAY_S = 0.02
EARLIEST_S = float(gamma.ppf(0.02, 16.0, scale=MEAN_DELAY_S / 16.0))
"""Of the delays below: what hurried lines take, the part that stays in the mapping."""
SPAN_S = (START_UTC_S, START_UTC_S + 600.0)


def fixes(host_t_s: np.ndarray, utc_s: np.ndarray, has_date: bool = True) -> FixStream:
    count = utc_s.size
    nothing = np.full(count, np.nan)
    return FixStream(
        host_t_s=host_t_s,
        utc_s=utc_s,
        utc_has_date=has_date,
        lat_deg=np.zeros(count),
        lon_deg=np.zeros(count),
        alt_m=nothing,
        quality=np.full(count, 4),
        sigma_east_m=nothing,
        sigma_north_m=nothing,
        cov_en_m2=np.zeros(count),
    )


def epochs(duration_s: float = 600.0, rate_hz: float = 5.0) -> np.ndarray:
    return START_UTC_S + np.arange(round(duration_s * rate_hz)) / rate_hz


def received(utc_s: np.ndarray, seed: int, jitter_s: float = 0.005, ahead_s: np.ndarray | float = 0.0) -> FixStream:
    """Lines that arrive after gamma-distributed delays on a clock that is ``ahead_s`` of UTC."""
    shape = (MEAN_DELAY_S / jitter_s) ** 2
    delay_s = np.random.default_rng(seed).gamma(shape, MEAN_DELAY_S / shape, utc_s.size)
    return fixes(utc_s + ahead_s + delay_s, utc_s)


@pytest.mark.parametrize(("duration_s", "rate_hz"), [(80.0, 5.0), (600.0, 1.0), (600.0, 10.0)])
@pytest.mark.parametrize("seed", range(5))
def test_receive_jitter_is_removed(duration_s, rate_hz, seed):
    utc_s = epochs(duration_s, rate_hz)
    stream = received(utc_s, seed)
    t_s, timed, clock = fixes_on_host_clock(stream, SPAN_S)
    error_s = t_s - (utc_s + EARLIEST_S)
    assert timed.all()
    assert np.max(np.abs(error_s)) < 0.0035
    assert np.sqrt(np.mean(error_s**2)) < 0.002
    assert np.std(stream.host_t_s - utc_s) > 0.0045
    assert clock.source == "utc_mapped"
    assert clock.jitter_s == pytest.approx(0.005, rel=0.3)


@pytest.mark.parametrize(("duration_s", "rate_hz"), [(80.0, 5.0), (600.0, 1.0), (600.0, 5.0)])
def test_a_stable_clock_gets_a_straight_line(duration_s, rate_hz):
    clocks = [fixes_on_host_clock(received(epochs(duration_s, rate_hz), seed), SPAN_S)[2] for seed in range(20)]
    straight = [clock for clock in clocks if clock.knots == 2]
    assert len(straight) >= 18
    assert max(abs(clock.skew_ppm) for clock in straight) * duration_s < 3000.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate_hz", [1.0, 5.0])
def test_changing_slopes_are_followed(seed, rate_hz):
    utc_s = epochs(600.0, rate_hz)
    corner_s = np.concatenate(([0.0], np.sort(np.random.default_rng(seed).uniform(60.0, 540.0, 3)), [600.0]))
    slope = np.array([300e-6, -500e-6, 400e-6, -300e-6])
    ahead_s = np.interp(utc_s - START_UTC_S, corner_s, np.concatenate(([0.0], np.cumsum(slope * np.diff(corner_s)))))
    assert np.ptp(ahead_s) > 0.03
    t_s, _, clock = fixes_on_host_clock(received(utc_s, seed, ahead_s=ahead_s), SPAN_S)
    assert np.sqrt(np.mean((t_s - utc_s - ahead_s - EARLIEST_S) ** 2)) < 0.005
    assert clock.knots > 2


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate_hz", [1.0, 5.0])
def test_a_daemon_pulling_the_clock_in_is_followed(seed, rate_hz):
    utc_s = epochs(600.0, rate_hz)
    since_s = utc_s - START_UTC_S - 150.0
    ahead_s = 0.15 * np.exp(-np.maximum(since_s, 0.0) / 60.0)
    t_s, _, clock = fixes_on_host_clock(received(utc_s, seed, ahead_s=ahead_s), SPAN_S)
    assert np.sqrt(np.mean((t_s - utc_s - ahead_s - EARLIEST_S) ** 2)) < 0.005
    assert clock.knots > 2


def test_late_lines_do_not_pull_the_clock():
    utc_s = epochs()
    stream = received(utc_s, 0)
    late_s = np.where(np.random.default_rng(1).random(utc_s.size) < 0.1, 0.5, 0.0)
    t_s, _, _ = fixes_on_host_clock(replace(stream, host_t_s=stream.host_t_s + late_s), SPAN_S)
    assert np.max(np.abs(t_s - utc_s - EARLIEST_S)) < 0.004


@given(ahead_s=st.sampled_from([97.0, -97.0, 0.4, -1.7e9]), skew_ppm=st.sampled_from([0.0, 200.0, -200.0]))
@settings(max_examples=12)
def test_offset_and_skew_are_logging_clock_minus_utc(ahead_s, skew_ppm):
    utc_s = epochs()
    middle_s = float(np.median(utc_s))
    stream = received(utc_s, 3, ahead_s=ahead_s + skew_ppm * 1e-6 * (utc_s - middle_s))
    t_s, _, clock = fixes_on_host_clock(stream, SPAN_S)
    assert clock.offset_s == pytest.approx(ahead_s + EARLIEST_S, abs=0.003)
    assert clock.skew_ppm == pytest.approx(skew_ppm, abs=10.0)
    assert np.max(np.abs(t_s - stream.host_t_s)) < 0.06


def test_lines_without_a_receive_time_are_mapped_too():
    utc_s = epochs(100.0)
    stream = received(utc_s, 0, ahead_s=97.0)
    bare = np.arange(utc_s.size) % 7 == 0
    t_s, timed, _ = fixes_on_host_clock(replace(stream, host_t_s=np.where(bare, np.nan, stream.host_t_s)), SPAN_S)
    assert timed.all()
    assert np.max(np.abs(t_s - utc_s - 97.0 - EARLIEST_S)) < 0.004


def test_receive_times_alone_are_taken_as_they_are():
    host_t_s = np.arange(20) * 0.2
    t_s, timed, clock = fixes_on_host_clock(fixes(host_t_s, np.full(20, np.nan)), (0.0, 4.0))
    assert timed.all()
    assert t_s.tolist() == host_t_s.tolist()
    assert (clock.source, clock.offset_s) == ("host", 0.0)


def test_without_receive_times_the_logging_clock_is_unix_time():
    utc_s = epochs(60.0)
    t_s, timed, clock = fixes_on_host_clock(fixes(np.full(utc_s.size, np.nan), utc_s), SPAN_S)
    assert timed.all()
    assert t_s.tolist() == utc_s.tolist()
    assert (clock.source, clock.offset_s, clock.knots) == ("utc", 0.0, 2)


@pytest.mark.parametrize("start_of_day_s", [30.0, 43200.0, 86390.0])
@pytest.mark.parametrize("wheels_first_s", [-60.0, 60.0])
def test_times_of_day_are_put_on_the_day_of_the_wheels(start_of_day_s, wheels_first_s):
    midnight_s = 19875 * 86400.0
    day_s = start_of_day_s + np.arange(100) * 0.2
    stream = fixes(np.full(100, np.nan), day_s, has_date=False)
    begin_s = midnight_s + start_of_day_s
    span_s = (begin_s + min(wheels_first_s, -5.0), begin_s + max(wheels_first_s, 25.0))
    t_s, _, _ = fixes_on_host_clock(stream, span_s)
    assert t_s == pytest.approx(midnight_s + day_s, abs=1e-6)


def test_no_overlap_names_both_spans():
    with pytest.raises(DataError, match=r"the fixes \(200\.000 … 300\.000 s\).*encoder\.csv \(5\.000 … 100\.500 s\)"):
        require_overlap(np.array([200.0, 300.0]), (5.0, 100.5), Clock("host", 0.0, 0.0, 0.0, 2), "the fixes")


def test_advice_of_no_overlap_depends_on_the_clock():
    span_s, t_s = (0.0, 90.0), epochs(90.0)
    with pytest.raises(DataError, match="must be Unix time"):
        require_overlap(t_s, span_s, Clock("utc", 0.0, 0.0, 0.0, 2), "the fixes")
    with pytest.raises(DataError, match="share the logging computer's clock"):
        require_overlap(t_s, span_s, Clock("utc_mapped", 0.0, 0.0, 0.0, 2), "the fixes")
    with pytest.raises(DataError, match="no usable rows"):
        require_overlap(np.zeros(0), span_s, Clock("host", 0.0, 0.0, 0.0, 2), "ahrs.csv")


@pytest.mark.parametrize("t_s", [[-5.0, 0.0], [90.0, 95.0], [-5.0, 95.0], [40.0, 41.0]])
def test_spans_that_touch_overlap(t_s):
    require_overlap(np.array(t_s), (0.0, 90.0), Clock("host", 0.0, 0.0, 0.0, 2), "ahrs.csv")


def in_bursts(host_t_s: np.ndarray, share: float, seed: int) -> np.ndarray:
    """Receive times of a buffer that is flushed late: all lines of a second or two are stamped with the last one's."""
    rng = np.random.default_rng(seed)
    late = host_t_s.copy()
    t_s = float(host_t_s[0])
    while t_s < host_t_s[-1]:
        long_s = rng.uniform(1.0, 2.0)
        t_s += rng.exponential(long_s * (1.0 - share) / share)
        inside = (host_t_s >= t_s) & (host_t_s < t_s + long_s)
        if inside.any():
            late[inside] = host_t_s[inside].max()
        t_s += long_s
    return late


def jittered(seed: int, skew_ppm: float = 0.0) -> FixStream:
    """Exponential jitter of 50 ms, and a tenth of the time lines come in bunches."""
    utc_s = epochs()
    ahead_s = 97.0 + 1e-6 * skew_ppm * (utc_s - float(np.median(utc_s)))
    host_t_s = utc_s + ahead_s + np.random.default_rng(seed).exponential(0.05, utc_s.size)
    return fixes(in_bursts(np.maximum.accumulate(host_t_s), 0.1, seed + 100), utc_s)


@pytest.mark.parametrize("seed", range(4))
def test_lines_in_bunches_do_not_bend_the_mapping(seed):
    stream = jittered(seed, 200.0)
    t_s, _, clock = fixes_on_host_clock(stream, SPAN_S)
    middle_s = float(np.median(stream.utc_s))
    assert clock.knots == 2
    assert np.max(np.abs(t_s - stream.utc_s - 97.0 - 200e-6 * (stream.utc_s - middle_s))) < 0.008
    assert clock.skew_ppm == pytest.approx(200.0, abs=25.0)


def test_sigmas_of_the_mapping_are_honest():
    clocks = [fixes_on_host_clock(jittered(seed), SPAN_S)[2] for seed in range(16)]
    offsets = np.array([(clock.offset_s - 97.001) / clock.sigma_offset_s for clock in clocks])
    skews = np.array([clock.skew_ppm / clock.sigma_skew_ppm for clock in clocks])
    assert 0.1 < np.sqrt(np.mean(offsets**2)) < 1.5
    assert 0.1 < np.sqrt(np.mean(skews**2)) < 1.5


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_even_mostly_bunched_lines_keep_their_mapping(share):
    stream = received(epochs(), 0, ahead_s=97.0)
    bunched = replace(stream, host_t_s=in_bursts(stream.host_t_s, share, 1))
    t_s, _, _ = fixes_on_host_clock(bunched, SPAN_S)
    assert np.max(np.abs(t_s - stream.utc_s - 97.0 - EARLIEST_S)) < 0.006


@pytest.mark.parametrize("steps", [[(300.0, 2.0)], [(300.0, -3.0)], [(150.0, 18.0), (400.0, -1.0)]])
@pytest.mark.parametrize("stream", [received(epochs(), 5, ahead_s=97.0), jittered(5)])
def test_leap_seconds_in_the_middle_are_mended(steps, stream):
    shown_s, right_s = stream.utc_s.copy(), stream.utc_s + 97.0
    for after_s, seconds in steps:
        shown_s[stream.utc_s - START_UTC_S >= after_s] += seconds
    onward = shown_s > np.maximum.accumulate(np.concatenate(([-np.inf], shown_s[:-1])))
    notices: list[Notice] = []
    t_s, _, _ = fixes_on_host_clock(fixes(stream.host_t_s[onward], shown_s[onward]), SPAN_S, notices)
    assert np.max(np.abs(t_s - right_s[onward])) < 0.025
    (told,) = [notice for notice in notices if "mended" in notice.what]
    assert told.count == len(steps)
    assert f"{steps[0][1]:+.2f} s"[:3] in told.what
