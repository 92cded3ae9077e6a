"""Each stream on its own: rate, gaps, resolution; and what is there when something else is not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.errors import DataError
from sccal.inspect.fixes import STRIP_CELLS, fix_facts
from sccal.inspect.place import PlacedFixes, legs
from sccal.logs.run import discover, read_run
from sccal.logs.streams import FixStream
from sccal.results.clock import Clock
from tests.inspect.logs import inspected, rows, said, stream

FILES = {"wheels": "encoder.csv", "heading": "ahrs.csv", "fixes": "gnss.nmea"}


def test_rates_and_resolutions(general):
    wheels, heading, fixes = (stream(general, name) for name in FILES)
    assert wheels.rate_hz == pytest.approx(20.0, rel=1e-3)
    assert wheels.resolution == pytest.approx(1e3 * 2 * np.pi * 0.08 / 32768, rel=1e-3)
    assert heading.rate_hz == pytest.approx(10.0, rel=1e-3)
    assert heading.resolution == pytest.approx(0.01, rel=1e-3)
    assert fixes.rate_hz == pytest.approx(5.0, rel=1e-3)
    assert fixes.resolution < 1e-3
    assert all(one.covered > 0.99 and not one.gaps and one.missing < 0.01 for one in general.streams)
    assert [one.source for one in general.streams] == list(FILES.values())


@pytest.mark.parametrize(("name", "length_s"), [("wheels", 60.0), ("heading", 20.0)])
def test_a_gap_is_told_where_it_is(spoilt, name, length_s):
    rows(spoilt / FILES[name], lambda t, row: None if 50.0 < t < 50.0 + length_s else row)
    found = inspected(spoilt)
    [gap] = stream(found, name).gaps
    assert gap.start_s - found.span_s[0] == pytest.approx(50.0, abs=0.2)
    assert gap.length_s == pytest.approx(length_s, abs=0.2)
    assert stream(found, name).covered == pytest.approx(1.0 - length_s / 150.0, abs=0.01)
    assert said(found, f"the longest gap: {gap.length_s:.1f} s").weight == "warning"
    assert np.isnan(found.series.turn_wheels_radps if name == "wheels" else found.series.turn_yaw_radps).sum() * 0.5 > (
        length_s - 1.0
    )


def test_lost_rows_are_no_jitter(spoilt):
    lost = iter(np.random.default_rng(2).random(5000) < 0.3)
    rows(spoilt / "ahrs.csv", lambda t, row: None if next(lost) else row)
    heading = stream(inspected(spoilt), "heading")
    assert heading.missing == pytest.approx(0.3, abs=0.05)
    assert heading.jitter_s < 1e-3
    assert heading.rate_hz == pytest.approx(10.0, rel=1e-3)


def test_jitter_is_the_spread_of_the_steps(spoilt):
    rng = np.random.default_rng(1)
    rows(spoilt / "ahrs.csv", lambda t, row: [f"{float(row[0]) + rng.normal(0.0, 0.005):.6f}", *row[1:]])
    heading = stream(inspected(spoilt), "heading")
    assert heading.jitter_s == pytest.approx(0.005 * np.sqrt(2.0), rel=0.15)
    assert heading.missing == 0.0


@pytest.mark.parametrize("missing", [*FILES, "vehicle"])
@pytest.mark.parametrize("how", ["gone", "empty", "garbage"])
def test_the_rest_is_inspected(spoilt, missing, how):
    path = spoilt / FILES.get(missing, "vehicle.toml")
    if how == "gone":
        path.unlink()
    else:
        path.write_bytes(b"" if how == "empty" else bytes(range(256)) * 40)
    found = inspected(spoilt)
    assert [one.what for one in found.unread] == [missing]
    assert path.name in found.unread[0].why
    assert found.refused
    assert said(found, found.unread[0].why).weight == "refused"
    assert {one.name for one in found.streams} == set(FILES) - {missing}
    assert found.drive is not None
    assert found.excited


def test_without_a_vehicle_the_fixes_scale_the_wheels(general, spoilt):
    (spoilt / "vehicle.toml").unlink()
    found = inspected(spoilt)
    assert not found.declared
    assert found.drive.distance_wheels_m == pytest.approx(general.drive.distance_wheels_m, rel=0.03)
    assert found.vehicle.track_m == pytest.approx(0.728, rel=0.05)
    assert said(found, "scaled by the fixes") is not None


def test_without_ticks_per_rev_the_fixes_tell_it(spoilt):
    text = (spoilt / "vehicle.toml").read_text()
    (spoilt / "vehicle.toml").write_text(text.replace("ticks_per_rev", "ticks_per_turn"))
    found = inspected(spoilt)
    assert found.unread[0].what == "wheels"
    # The true mean radius is 80.2 mm where 80 mm are declared.
    assert found.vehicle.ticks_per_rev == pytest.approx(32768 * 0.08 / 0.0802, rel=0.01)


def test_wheels_that_nothing_scales(spoilt):
    (spoilt / "vehicle.toml").unlink()
    (spoilt / "gnss.nmea").unlink()
    found = inspected(spoilt)
    assert [one.what for one in found.unread] == ["vehicle", "wheels", "fixes"]
    assert "cannot be scaled" in said(found, "encoder.csv").text
    assert [one.name for one in found.streams] == ["heading"]
    assert found.drive is None


@pytest.mark.parametrize("spoil", ["too short", "missing"])
@pytest.mark.parametrize("name", FILES)
def test_what_is_not_there_is_told_as_a_calibration_tells_it(spoilt, name, spoil):
    path = spoilt / FILES[name]
    if spoil == "missing":
        path.unlink()
    else:
        path.write_text("\n".join(path.read_text().splitlines()[: 1 if name == "fixes" else 2]) + "\n")
    with pytest.raises(DataError) as refused:
        read_run(*discover([spoilt]))
    [unread] = inspected(spoilt).unread
    assert unread.what == name
    assert unread.why == str(refused.value) or (spoil == "missing" and str(refused.value).startswith(unread.why))


def test_nothing_at_all(spoilt):
    for name in FILES.values():
        (spoilt / name).write_bytes(b"")
    with pytest.raises(DataError, match="is empty"):
        inspected(spoilt)


def test_streams_on_different_times(general, spoilt):
    rows(spoilt / "ahrs.csv", lambda t, row: [f"{float(row[0]) - 5000:.4f}", *row[1:]])
    found = inspected(spoilt)
    heading = stream(found, "heading")
    assert not heading.shares_time
    assert heading.rate_hz == pytest.approx(10.0, rel=1e-3)
    assert said(found, "do not overlap").weight == "refused"
    assert found.span_s[1] - found.span_s[0] == pytest.approx(150.0, abs=1.0)
    assert np.isnan(found.series.turn_yaw_radps).all()
    assert found.drive.distance_fixes_m == general.drive.distance_fixes_m


def test_streams_on_different_times_without_the_wheels(spoilt):
    (spoilt / "encoder.csv").unlink()
    rows(spoilt / "ahrs.csv", lambda t, row: [f"{float(row[0]) - 5000:.4f}", *row[1:]])
    assert said(inspected(spoilt), "share no time").weight == "refused"


def test_coarse_positions_are_told(spoilt):
    (spoilt / "gnss.nmea").unlink()
    t = np.arange(0.0, 150.0, 0.2)
    lines = [f"{1717243200 + a:.1f},{37.5256 + 4e-6 * a:.6f},{15.0744 + 1e-9 * a:.6f},4" for a in t.tolist()]
    (spoilt / "gnss.csv").write_text("t,lat_deg,lon_deg,fix_quality\n" + "\n".join(lines) + "\n")
    found = inspected(spoilt)
    assert stream(found, "fixes").resolution == pytest.approx(1e-6 * 111_320, rel=1e-3)
    assert said(found, "log more decimals").weight == "warning"


def test_further_columns_are_candidates(spoilt):
    rows(spoilt / "encoder.csv", lambda t, row: [*row, f"{0.1 * t:.3f}", "7", "" if t < 75 else "1.5"])
    path = spoilt / "encoder.csv"
    path.write_text(path.read_text().replace("right_ticks", "right_ticks,motor_current_a,mode,late", 1))
    current, mode, late = (one for one in inspected(spoilt).columns if one.source == "encoder.csv")
    assert (current.name, current.varies, current.missing) == ("motor_current_a", True, 0.0)
    assert current.values.high == pytest.approx(15.0, abs=0.1)
    assert not mode.varies
    assert late.missing == pytest.approx(0.5, abs=0.01)


def placed(t_s, quality):
    n = t_s.size
    return PlacedFixes(
        t_s, np.zeros(n), np.zeros(n), np.full(n, 0.02), quality, np.arange(n), Clock("host", 0.0, 0.0, 0.0, 2), 0.01
    )


def unstated(n):
    nan = np.full(n, np.nan)
    return FixStream(nan, nan, False, nan, nan, nan, np.zeros(n, dtype=np.int64), nan, nan, np.zeros(n))


@given(
    st.lists(st.sampled_from([1, 2, 4, 5]), min_size=3, max_size=80),
    st.lists(st.integers(0, 79), max_size=4),
)
def test_the_quality_timeline_is_whole(codes, gaps):
    steps = np.full(len(codes), 0.2)
    for k in gaps:
        steps[k % len(codes)] = 10.0
    steps[0] = 0.0
    t_s = np.cumsum(steps)
    found = fix_facts(unstated(t_s.size), placed(t_s, np.array(codes)), (0.0, float(t_s[-1])))
    assert sum(one.count for one in found.qualities) == len(codes)
    for one, after in zip(found.spans[:-1], found.spans[1:], strict=True):
        assert one.end_s == pytest.approx(after.start_s)
        assert one.code != after.code
    for code in set(codes):
        spans = sum(one.end_s - one.start_s for one in found.spans if one.code == code)
        share = next(one for one in found.qualities if one.code == code)
        assert spans == pytest.approx(share.seconds)
    assert len(found.strip) == STRIP_CELLS
    assert {code for code in found.strip if code is not None} <= set(codes)


def test_noise_and_single_jumps_make_no_distance():
    rng = np.random.default_rng(0)
    z = rng.normal(0.0, 0.02, 500) + 1j * rng.normal(0.0, 0.02, 500)
    z[100] += 40.0
    assert legs(z.real, z.imag, 0.5).size == 1
    way = np.arange(500) * 0.1 + z
    at = legs(way.real, way.imag, 0.5)
    assert np.abs(np.diff(way[at])).sum() == pytest.approx(50.0, rel=0.02)
