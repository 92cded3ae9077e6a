"""Counters: what wraps, resets, gaps and bogus values must come out as."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.arrays import Floats
from sccal.errors import DataError, SccalError
from sccal.logs.encoder import read_encoder
from sccal.logs.streams import Notice, Vehicle, WheelStream

TICKS_PER_REV = 32768.0
TICKS_PER_M = TICKS_PER_REV / (2 * np.pi * 0.08)


def vehicle(bits: int | None = None, ticks_per_rev: float | None = TICKS_PER_REV) -> Vehicle:
    return Vehicle("robot", Path("vehicle.toml"), 0.08, 0.7, ticks_per_rev, bits)


def drive(rate_hz: float, duration_s: float = 60.0, seed: int = 0) -> tuple[Floats, Floats]:
    """Times (n) and whole ticks (n, 2) of a drive with stops, reverse and turns, up to 1.2 m/s."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0, duration_s, 1 / rate_hz)
    legs_mps = np.array([0.0, 1.0, 1.2, 0.0, -0.6, 0.8, 1.0])
    target = legs_mps[(t_s / 8).astype(int) % legs_mps.size]
    smooth = np.convolve(np.pad(target, int(rate_hz), mode="edge"), np.ones(int(rate_hz)) / rate_hz, "same")
    speed_mps = smooth[int(rate_hz) : int(rate_hz) + t_s.size]
    turn_mps = 0.1 * np.sin(t_s / 3 + rng.uniform(0, 6)) * (np.abs(speed_mps) > 0.1)
    wheels = np.column_stack((speed_mps - turn_mps, speed_mps + turn_mps))
    return t_s, np.round(np.cumsum(wheels / rate_hz, axis=0) * TICKS_PER_M)


def write(folder: Path, t_s: Floats, ticks: Floats, names: str = "left_ticks,right_ticks", form: str = "%d") -> Path:
    path = folder / "encoder.csv"
    rows = "\n".join(f"%.4f,{form},{form}" % (t, *pair) for t, pair in zip(t_s, ticks.tolist(), strict=True))
    path.write_text(f"t,{names}\n{rows}\n")
    return path


def read(
    folder: Path, t_s: Floats, ticks: Floats, bits: int | None = None
) -> tuple[WheelStream, tuple[Notice, ...], Floats]:
    """The stream, the notices and the counts (m, 2) it holds, from their first value on."""
    stream, notices = read_encoder(write(folder, t_s, ticks), vehicle(bits))
    counts = np.column_stack((stream.left_rad, stream.right_rad)) * TICKS_PER_REV / (2 * np.pi)
    return stream, notices, counts - counts[0]


def found(notices: tuple[Notice, ...], words: str) -> Notice:
    matches = [notice for notice in notices if words in notice.what]
    assert len(matches) == 1, [str(notice) for notice in notices]
    return matches[0]


def wrapped(ticks: Floats, bits: int, signed: bool, start: float) -> Floats:
    values = np.mod(ticks + start, 2.0**bits)
    return np.where(values >= 2.0 ** (bits - 1), values - 2.0**bits, values) if signed else values


@pytest.mark.parametrize("rate_hz", [10.0, 50.0, 100.0, 200.0])
@pytest.mark.parametrize(("bits", "start"), [(16, 30000.0), (32, 2.0**32 - 70000), (32, 2.0**31 - 70000)])
@pytest.mark.parametrize("signed", [True, False])
@pytest.mark.parametrize("declared", [True, False])
def test_wraps_come_out_as_the_unwrapped_counter(
    tmp_path: Path, rate_hz: float, bits: int, start: float, signed: bool, declared: bool
) -> None:
    t_s, ticks = drive(rate_hz)
    stream, notices, counts = read(tmp_path, t_s, wrapped(ticks, bits, signed, start), bits if declared else None)
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=1e-3)
    assert not stream.loose.any()
    assert not [notice for notice in notices if notice.severity == "warning"]
    crosses = np.abs(np.diff(wrapped(ticks, bits, signed, start), axis=0)) > 2.0 ** (bits - 1)
    if crosses.any():
        assert found(notices, f"wraps at {bits} bits").count == crosses.sum()


@pytest.mark.parametrize("gap_s", [0.3, 0.45, 1.0])
@pytest.mark.parametrize("declared", [True, False])
def test_wraps_inside_a_gap_follow_the_speed_around_it(tmp_path: Path, gap_s: float, declared: bool) -> None:
    t_s, ticks = drive(100.0)
    out = np.zeros(t_s.size, dtype=bool)
    for start_s in (12.0, 20.0, 50.0):
        out |= (t_s > start_s) & (t_s < start_s + gap_s)
    values = wrapped(ticks, 16, False, 0.0)[~out]
    stream, notices, counts = read(tmp_path, t_s[~out], values, 16 if declared else None)
    np.testing.assert_allclose(counts, (ticks - ticks[0])[~out], atol=1e-3)
    assert stream.loose.sum() == (3 if gap_s > 0.5 else 0)
    if gap_s > 0.5:
        assert found(notices, "gaps").count == 3


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    bits=st.sampled_from([16, 32]),
    signed=st.booleans(),
    start=st.integers(-(2**33), 2**33),
    rate_hz=st.sampled_from([10.0, 50.0, 100.0]),
)
def test_any_declared_wrap_is_undone(
    tmp_path_factory: pytest.TempPathFactory, seed: int, bits: int, signed: bool, start: int, rate_hz: float
) -> None:
    t_s, ticks = drive(rate_hz, 20.0, seed)
    folder = tmp_path_factory.mktemp("run")
    _, _, counts = read(folder, t_s, wrapped(ticks, bits, signed, float(start)), bits)
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=1e-3)


@pytest.mark.parametrize("bits", [None, 32])
def test_bogus_zero_rows_are_dropped_and_counted(tmp_path: Path, bits: int | None) -> None:
    t_s, ticks = drive(100.0)
    ticks = ticks + 5e6
    bogus = np.array([700, 701, 702, 1500, 3000, 3002, 3004, 4500])
    broken = ticks.copy()
    broken[bogus] = 0
    stream, notices, counts = read(tmp_path, t_s, broken, bits)
    notice = found(notices, "bogus")
    assert (notice.count, notice.where) == (8, "line 702")
    np.testing.assert_allclose(counts, np.delete(ticks - ticks[0], bogus, axis=0), atol=1e-3)
    assert not stream.loose.any()


def test_a_bogus_value_of_one_wheel_drops_the_row(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    broken = ticks.copy()
    broken[1000, 1] += 400_000
    _, notices, counts = read(tmp_path, t_s, broken)
    assert found(notices, "bogus").count == 1
    np.testing.assert_allclose(counts, np.delete(ticks - ticks[0], 1000, axis=0), atol=1e-3)


def test_bogus_first_and_last_rows_are_dropped(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    broken = ticks + 8e6
    broken[:3] = 0
    broken[-1, 1] /= 10
    _, notices, counts = read(tmp_path, t_s, broken)
    assert found(notices, "bogus").count == 4
    np.testing.assert_allclose(counts, (ticks - ticks[3])[3:-1], atol=1e-3)


def test_zeros_until_the_driver_is_up_are_dropped(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    broken = ticks + 8e6
    broken[:300] = 0
    _, notices, counts = read(tmp_path, t_s, broken)
    assert found(notices, "bogus").count == 300
    assert counts.shape[0] == t_s.size - 300


@pytest.mark.parametrize("lands_at", [0.0, -3e6])
def test_a_reset_is_bridged_with_the_speed_around_it_and_loose(tmp_path: Path, lands_at: float) -> None:
    t_s, ticks = drive(100.0)
    ticks = ticks + 4e6
    broken = ticks.copy()
    broken[2000:] += lands_at - ticks[2000]
    stream, notices, counts = read(tmp_path, t_s, broken)
    assert found(notices, "resets").count == 1
    assert np.flatnonzero(stream.loose).tolist() == [2000]
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=0.002 * TICKS_PER_M)


def test_counts_that_lag_and_catch_up_keep_the_distance(tmp_path: Path) -> None:
    t_s, ticks = drive(100.0)
    broken = ticks.copy()
    stale = slice(1300, 1350)
    broken[stale] = ticks[1300] + 1
    stream, notices, counts = read(tmp_path, t_s, broken)
    np.testing.assert_allclose(counts[-1], (ticks - ticks[0])[-1], atol=1e-3)
    assert stream.loose.any()
    assert any(notice.severity == "warning" for notice in notices)


def test_gaps_are_counted_and_loose_only_where_the_robot_moved(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    moving = (t_s > 12) & (t_s < 14)
    standing = (t_s > 26) & (t_s < 30)
    speed = np.abs(np.diff(ticks, axis=0)).sum(axis=1)
    assert speed[moving[1:]].min() > 0
    assert speed[standing[1:]].max() == 0
    keep = ~(moving | standing)
    stream, notices, counts = read(tmp_path, t_s[keep], ticks[keep])
    notice = found(notices, "gaps")
    assert notice.count == 2
    assert notice.where.startswith("t = ")
    np.testing.assert_allclose(counts, (ticks - ticks[0])[keep], atol=1e-3)
    assert stream.loose.sum() == 1
    assert stream.t_s[stream.loose][0] == pytest.approx(14.0, abs=0.03)


def test_arrival_jitter_is_no_fault(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t_s, ticks = drive(100.0)
    late_s = rng.uniform(0, 0.009, t_s.size)
    late_s[rng.random(t_s.size) < 0.02] += 0.008
    arrival_s = np.maximum.accumulate(t_s + late_s) + 1e-4 * np.arange(t_s.size) / 10
    arrival_s += 2e-4 * np.cumsum(np.diff(arrival_s, prepend=-1.0) < 2e-4)
    stream, notices, counts = read(tmp_path, arrival_s, ticks)
    assert stream.t_s.size == t_s.size
    assert not stream.loose.any()
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=1e-3)
    assert not notices


def test_rows_delivered_in_bunches_keep_their_counts(tmp_path: Path) -> None:
    t_s, ticks = drive(100.0)
    i = np.arange(t_s.size)
    arrival_s = np.floor(i / 10) * 0.1 + 0.1 + (i % 10) * 5e-4
    stream, notices, counts = read(tmp_path, arrival_s, ticks)
    assert stream.t_s.size == t_s.size
    assert not stream.loose.any()
    assert not notices
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=1e-3)


def test_a_long_standstill_and_a_short_dash_are_no_faults(tmp_path: Path) -> None:
    t_s = np.arange(0, 400, 0.02)
    speed_mps = np.clip(2 * (t_s - 300), 0, 2) * (t_s < 304) + np.clip(2 - 2 * (t_s - 304), 0, 2) * (t_s >= 304)
    ticks = np.round(np.repeat(np.cumsum(speed_mps * 0.02)[:, None], 2, axis=1) * TICKS_PER_M)
    stream, notices, counts = read(tmp_path, t_s, ticks)
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=1e-3)
    assert not stream.loose.any()
    assert not notices


@pytest.mark.parametrize("per_rev", [20.0, 360.0])
def test_coarse_counters_are_no_faults(tmp_path: Path, per_rev: float) -> None:
    t_s, ticks = drive(100.0)
    coarse = np.round(ticks * per_rev / TICKS_PER_REV)
    stream, notices = read_encoder(write(tmp_path, t_s, coarse), vehicle(None, per_rev))
    np.testing.assert_allclose(stream.left_rad * per_rev / (2 * np.pi), coarse[:, 0], atol=1e-6)
    assert not stream.loose.any()
    assert not notices


def test_angles_are_read_without_ticks_per_rev(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    angles = ticks * 2 * np.pi / TICKS_PER_REV + 100
    broken = angles.copy()
    broken[[500, 1200]] = 0
    path = write(tmp_path, t_s, broken, "left_rad,right_rad", "%.6f")
    stream, notices = read_encoder(path, vehicle(ticks_per_rev=None))
    assert found(notices, "bogus").count == 2
    np.testing.assert_allclose(stream.right_rad, np.delete(angles[:, 1], [500, 1200]), atol=1e-5)


def test_ticks_without_ticks_per_rev_say_what_to_add(tmp_path: Path) -> None:
    t_s, ticks = drive(10.0)
    with pytest.raises(DataError, match="add a line such as ticks_per_rev"):
        read_encoder(write(tmp_path, t_s, ticks), vehicle(ticks_per_rev=None))


def test_a_declared_width_that_the_values_exceed_is_not_used(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    _, notices, counts = read(tmp_path, t_s, ticks + 1e6, 16)
    assert found(notices, "beyond 16 bits").severity == "warning"
    np.testing.assert_allclose(counts, ticks - ticks[0], atol=1e-3)


def test_a_counter_too_narrow_for_its_rate_is_told(tmp_path: Path) -> None:
    t_s, ticks = drive(10.0)
    _, notices, _ = read(tmp_path, t_s, np.mod(ticks, 2.0**14), 14)
    assert found(notices, "too few").severity == "warning"


def test_an_unsigned_64_bit_counter_below_zero(tmp_path: Path) -> None:
    t_s, ticks = drive(50.0)
    path = tmp_path / "encoder.csv"
    rows = "\n".join(
        f"{t:.4f},{int(left) % 2**64},{int(right) % 2**64}" for t, (left, right) in zip(t_s, ticks - 30000, strict=True)
    )
    path.write_text(f"t,left_ticks,right_ticks\n{rows}\n")
    stream, _ = read_encoder(path, vehicle())
    np.testing.assert_allclose(stream.left_rad * TICKS_PER_REV / (2 * np.pi), ticks[:, 0] - 30000, atol=1e-3)


def test_counts_that_no_motion_explains_are_an_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    t_s = np.arange(0, 30, 0.01)
    noise = rng.integers(-(2**40), 2**40, (t_s.size, 2)).astype(float)
    with pytest.raises(DataError, match="60 m/s"):
        read(tmp_path, t_s, noise)


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(st.integers(0, 3000), st.integers(-(2**33), 2**33), st.integers(-70000, 70000)),
        min_size=1,
        max_size=30,
    ),
    st.sampled_from([None, 16, 32]),
)
def test_any_counts_give_a_sound_stream_or_a_known_error(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, int, int]], bits: int | None
) -> None:
    values = np.array(rows, dtype=float)
    try:
        stream, _, _ = read(tmp_path_factory.mktemp("run"), values[:, 0] / 1000, values[:, 1:], bits)
    except SccalError:
        return
    assert stream.t_s.size == stream.left_rad.size == stream.right_rad.size == stream.loose.size
    assert np.isfinite(stream.left_rad).all()
    assert np.isfinite(stream.right_rad).all()
    assert (np.diff(stream.t_s) > 0).all()


def test_zeros_near_a_wrap_are_bogus_even_where_the_step_would_be_possible(tmp_path: Path) -> None:
    t_s, ticks = drive(20.0)
    bogus = 160
    values = wrapped(ticks - ticks[bogus - 1] + 2000, 16, False, 0.0)
    values[bogus] = 0
    _, notices, counts = read(tmp_path, t_s, values, 16)
    assert (found(notices, "bogus").count, found(notices, "bogus").where) == (1, f"line {bogus + 2}")
    np.testing.assert_allclose(counts, np.delete(ticks - ticks[0], bogus, axis=0), atol=1e-3)
