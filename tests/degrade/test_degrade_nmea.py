"""NMEA logs degraded: what moves, what stays, and that every line written is a sentence."""

from __future__ import annotations

import itertools
import zlib

import numpy as np
import pynmeagps
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.degrade.faults import Faults
from sccal.degrade.nmea import DegradedNmea, degrade_nmea
from sccal.errors import DataError
from sccal.geodesy import TangentPlane
from tests.degrade.logs import NOON, UNPLACED, Read, clock, every_kind, gga, gll, ksxt, read, rmc, sentence

SPAN = (1717243200.0, 1717243200.0 + 3600.0)


def degraded(text: str | bytes, faults: Faults, span: tuple[float, float] = SPAN, name: str = "run") -> DegradedNmea:
    return degrade_nmea(text.encode("latin-1") if isinstance(text, str) else text, faults, span, name)


def lines_of(done: DegradedNmea) -> list[str]:
    return done.raw.decode("latin-1").splitlines()


def drive(count: int, lat: float = 52.1, lon: float = 5.3, step_s: float = 0.1) -> str:
    rows = [gga(NOON + i * step_s, lat + 1e-6 * i, lon + 2e-6 * i) for i in range(count)]
    return "\n".join([rmc(NOON, lat, lon), *rows]) + "\n"


def placed(done: DegradedNmea, kind: str = "GGA") -> list[Read]:
    found = [one for one in map(read, lines_of(done)) if one is not None and one.kind == kind]
    assert found
    return found


def steps_m(before: str, after: DegradedNmea) -> tuple[np.ndarray, np.ndarray]:
    """East and north of every GGA against what it was, in the tangent plane at each."""
    old = [one for one in map(read, before.splitlines()) if one is not None and one.kind == "GGA"]
    new = placed(after)
    assert len(old) == len(new)
    steps = []
    for a, b in zip(old, new, strict=True):
        assert a.lat is not None
        assert a.lon is not None
        steps.append(TangentPlane(a.lat, a.lon).to_east_north(np.array(b.lat), np.array(b.lon)))
    east, north = np.array(steps, dtype=float).T
    return east, north


@pytest.mark.parametrize(("lat", "lon"), [(52.1, 5.3), (-33.0, 179.99999), (0.0, 0.0), (89.9, -60.0), (-89.9999, 10.0)])
def test_the_noise_is_what_was_asked_for(lat: float, lon: float) -> None:
    text = "\n".join(gga(NOON + 0.1 * i, lat, lon) for i in range(400))
    east, north = steps_m(text, degraded(text, Faults(sigma_m=5)))
    done = degraded(text, Faults(sigma_m=5)).fixes
    np.testing.assert_allclose(east, done.east_m, atol=3e-5)
    np.testing.assert_allclose(north, done.north_m, atol=3e-5)


def test_noise_is_white_and_of_its_size() -> None:
    fixes = degraded(drive(6000), Faults(sigma_m=5, seed=3)).fixes
    for noise in (fixes.east_m, fixes.north_m):
        assert noise.std() == pytest.approx(5, rel=0.03)
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.05
    assert abs(np.corrcoef(fixes.east_m, fixes.north_m)[0, 1]) < 0.05


def test_multipath_is_correlated_as_asked_for() -> None:
    fixes = degraded(drive(30_000, step_s=1.0), Faults(multipath_m=2, tau_s=30), (0.0, 1e10)).fixes
    for wander in (fixes.east_m, fixes.north_m):
        assert wander.std() == pytest.approx(2, rel=0.1)
        for lag in (1, 30):
            assert np.mean(wander[lag:] * wander[:-lag]) / wander.var() == pytest.approx(np.exp(-lag / 30), abs=0.05)


def test_same_seed_same_bytes_and_no_fault_changes_anothers_noise() -> None:
    text = drive(300)
    one = degraded(text, Faults(sigma_m=5))
    assert degraded(text, Faults(sigma_m=5)).raw == one.raw
    assert degraded(text, Faults(sigma_m=5, seed=1)).raw != one.raw
    assert degraded(text, Faults(sigma_m=5), name="other").raw != one.raw
    with_loss = degraded(text, Faults(sigma_m=5, losses_s=((10.0, 20.0),), from_s=5.0))
    same = with_loss.fixes.displaced
    assert 0 < same.sum() < same.size
    np.testing.assert_array_equal(with_loss.fixes.east_m[same], one.fixes.east_m[same])
    with_jumps = degraded(text, Faults(sigma_m=5, outliers=0.1)).fixes
    np.testing.assert_array_equal(with_jumps.east_m[~with_jumps.outlier], one.fixes.east_m[~with_jumps.outlier])


def test_outliers_are_as_many_and_as_far_as_asked_for_and_keep_their_claims() -> None:
    text = drive(1000)
    done = degraded(text, Faults(outliers=0.02))
    assert done.fixes.outlier.sum() == 20
    length_m = np.hypot(*steps_m(text, done))
    assert (length_m > 0.01).sum() == 20
    assert (np.abs(length_m[length_m > 0.01] - 27.5) <= 22.501).all()
    assert all(one.fields[6] == "4" and one.fields[8] == "0.60" for one in placed(done))


def test_all_sentences_of_an_epoch_move_together() -> None:
    lines = list(itertools.chain.from_iterable(every_kind(NOON + i, 52.1 + 1e-4 * i, 5.3) for i in range(20)))
    done = degraded("\r\n".join(lines), Faults(sigma_m=5))
    assert done.raw.count(b"\r\n") == len(lines) - 1
    found = [one for line in lines_of(done) if (one := read(line)) is not None]
    assert len(found) == len(lines)
    for _, epoch in itertools.groupby(found, key=lambda one: one.t):
        group = list(epoch)
        assert len(group) == 8
        assert np.ptp([one.lat for one in group]) < 2e-8
        assert np.ptp([one.lon for one in group]) < 2e-8


def test_what_the_sentences_claim_goes_with_the_noise() -> None:
    done = degraded("\n".join(every_kind(NOON, 52.1, 5.3)), Faults(sigma_m=5))
    by_kind = {one.kind: one.fields for line in lines_of(done) if (one := read(line)) is not None}
    assert (by_kind["GGA"][6], by_kind["GGA"][7], by_kind["GGA"][8]) == ("1", "12", "1.77")
    assert (by_kind["RMC"][2], by_kind["RMC"][12]) == ("A", "A")
    assert by_kind["GNS"][6] == "AANA"
    assert by_kind["GLL"][6:8] == ["A", "A"]
    assert by_kind["GGK"][8] == "1"
    assert by_kind["KSXT"][10:12] == ["1", "3"]
    assert by_kind["PUBX"][8] == "G3"
    assert by_kind["PASHR"][2] == "0"
    assert float(by_kind["PUBX"][9]) == pytest.approx(np.hypot(2.1, 5 * np.sqrt(2)), abs=0.06)
    east, north = done.fixes.east_m[0], done.fixes.north_m[0]
    assert float(by_kind["KSXT"][14]) == pytest.approx(10 + east, abs=1e-3)
    assert float(by_kind["KSXT"][15]) == pytest.approx(20 + north, abs=1e-3)


@pytest.mark.parametrize(
    ("sigma", "before", "after"),
    [(5, 4, 1), (1, 4, 2), (0.35, 4, 5), (0.02, 4, 4), (0.02, 1, 1), (0.35, 2, 2), (5, 0, 0), (5, 5, 1), (1, 9, 9)],
)
def test_quality_is_what_the_sigma_means_and_never_better(sigma: float, before: int, after: int) -> None:
    text = "\n".join([gga(NOON, 52.1, 5.3, quality=before), gga(NOON + 1, 52.1, 5.3)])
    assert placed(degraded(text, Faults(sigma_m=sigma)))[0].fields[6] == str(after)


def test_quality_as_asked_for_without_any_noise() -> None:
    text = "\n".join([gga(NOON, 52.1, 5.3), rmc(NOON, 52.1, 5.3)])
    done = lines_of(degraded(text, Faults(quality=5)))
    assert done == [gga(NOON, 52.1, 5.3, quality=5), rmc(NOON, 52.1, 5.3, mode="F")]


def test_lost_fixes_are_written_as_receivers_write_them() -> None:
    lines = every_kind(NOON + 60, 52.1, 5.3)
    text = "\n".join([*every_kind(NOON, 52.1, 5.3), *lines])
    done = lines_of(degraded(text, Faults(losses_s=((60.0, 61.0),))))
    assert done[:8] == text.splitlines()[:8]
    assert done[8:] == [
        sentence("GNGGA,120100.00,,,,,0,00,99.99,,,,,,"),
        sentence("GNRMC,120100.00,V,,,,,,,010624,,,N"),
        sentence("GNGNS,120100.00,,,,,NNNN,00,99.99,,,,,V"),
        sentence("GNGLL,,,,,120100.00,V,N"),
        sentence("PTNL,GGK,120100.00,060124,,,,,0,00,,,M"),
        sentence("KSXT,20240601120100.00,,,,299.22,67.03,,,,0,3,46,28,,,,,,,,"),
        sentence("PUBX,00,120100.00,,,,,,NF,,,,,,,99.99,99.99,99.99,0,0,0"),
        sentence("PASHR,POS,,00,120100.00,,,,,,,,,,1.9,99.99,1.6,1.5,Hp23"),
    ]
    for before, after in zip(lines, done[8:], strict=True):
        assert before.count(",") == after.count(",")


def test_windows_are_closed_and_dropping_takes_whole_lines() -> None:
    text = drive(400)
    lost = degraded(text, Faults(losses_s=((10.0, 20.0),)))
    assert lost.fixes.lost.sum() == 101
    dropped = degraded(text, Faults(losses_s=((10.0, 20.0),), drop=True))
    kept = [line for line in text.splitlines() if not (one := read(line)) or not 120010 <= float(one.t) <= 120020]
    assert lines_of(dropped) == kept


def test_windows_go_by_the_receive_time_of_the_epochs_fix() -> None:
    lines = []
    for i in range(10):
        lines += [f"{i + 0.99:.2f} {rmc(NOON + i, 52.1, 5.3)}", f"{i + 1.01:.2f} {gga(NOON + i, 52.1, 5.3)}"]
    done = degraded("\n".join(lines), Faults(losses_s=((5.0, 7.0),)), (0.0, 11.0))
    assert np.flatnonzero(done.fixes.lost).tolist() == [4, 5]
    empty = [read(line).lat is None for line in lines_of(done)]  # type: ignore[union-attr]
    assert np.flatnonzero(empty).tolist() == [8, 9, 10, 11]
    assert [line.split()[0] for line in lines_of(done)] == [line.split()[0] for line in lines]


def test_a_clock_that_the_run_does_not_share_places_no_window() -> None:
    with pytest.raises(DataError, match=r"do not meet the encoder's \(t = 0\.000 s to 100\.000 s\)"):
        degraded(drive(10), Faults(losses_s=((5.0, 7.0),)), (0.0, 100.0))


def test_times_of_day_without_a_date_fall_on_the_runs_day() -> None:
    text = "\n".join(gga(NOON + i, 52.1, 5.3) for i in range(100))
    assert degraded(text, Faults(losses_s=((10.0, 19.5),))).fixes.lost.sum() == 10


def test_late_fixes_show_where_the_antenna_was() -> None:
    """Driving east, a late fix is further west."""
    text = "\n".join(gga(NOON + 0.2 * i, 52.1, 5.3 + 1e-5 * i) for i in range(50))
    assert not np.any(steps_m(text, degraded(text, Faults(latency_s=0.0))))
    done = degraded(text, Faults(latency_s=0.6))
    after = placed(done)
    assert [one.lat for one in after[:3]] == [None] * 3
    before = [read(line) for line in text.splitlines()]
    assert [one.fields[2:6] for one in after[3:]] == [one.fields[2:6] for one in before[:-3] if one]
    half = degraded(text, Faults(latency_s=0.3)).fixes
    assert half.lost.sum() == 2
    metres_a_second = 1e-5 * 5 * 111320 * np.cos(np.radians(52.1))
    np.testing.assert_allclose(half.east_m[2:], -0.3 * metres_a_second, rtol=5e-3)
    np.testing.assert_allclose(half.north_m[2:], 0, atol=1e-6)


def test_latency_does_not_cut_curves() -> None:
    t = 0.2 * np.arange(200)
    plane = TangentPlane(52.1, 5.3)
    lat, lon = plane.to_lat_lon(20 * np.cos(t / 10), 20 * np.sin(t / 10))
    text = "\n".join(gga(NOON + i, la, lo, places=9) for i, la, lo in zip(t.tolist(), lat, lon, strict=True))
    done = degraded(text, Faults(latency_s=0.1)).fixes
    east, north = plane.to_east_north(done.lat_deg, done.lon_deg)
    np.testing.assert_allclose(east[3:-1], 20 * np.cos((t - 0.1) / 10)[3:-1], atol=1e-4)
    np.testing.assert_allclose(north[3:-1], 20 * np.sin((t - 0.1) / 10)[3:-1], atol=1e-4)


def test_no_place_is_made_up_within_a_pause() -> None:
    times = [0.2 * i for i in range(20)] + [60 + 0.2 * i for i in range(20)]
    text = "\n".join(gga(NOON + t, 52.1, 5.3 + 1e-5 * t) for t in times)
    assert np.flatnonzero(degraded(text, Faults(latency_s=0.5)).fixes.lost).tolist() == [0, 1, 2, 20, 21, 22]


def test_gst_stays_unless_asked_for() -> None:
    error = sentence("GNGST,120000.00,0.5,0.0200,0.0100,45.0,0.0150,0.0160,0.03")
    text = "\n".join([gga(NOON, 52.1, 5.3), error, gga(NOON + 1, 52.1, 5.3)])
    assert lines_of(degraded(text, Faults(sigma_m=3)))[1] == error
    fields = lines_of(degraded(text, Faults(sigma_m=3, gst=True)))[1].partition("*")[0].split(",")
    assert fields[:3] + fields[5:6] + fields[8:] == ["$GNGST", "120000.00", "0.5", "45.0", "0.03"]
    assert [float(fields[i]) for i in (3, 4, 6, 7)] == pytest.approx([3.0001, 3.0, 3.0, 3.0], abs=1.1e-4)


def test_a_sentence_without_checksum_moves_and_gets_none() -> None:
    bare = gga(NOON, 52.1, 5.3).partition("*")[0]
    done = lines_of(degraded("\n".join([bare, gga(NOON + 1, 52.1, 5.3)]), Faults(sigma_m=5)))
    assert "*" not in done[0]
    assert done[0] != bare
    assert done[0].count(",") == bare.count(",")


def test_a_long_checksum_of_unicore_is_right_again() -> None:
    """The sentence is one that a receiver wrote."""
    body = (
        "KSXT,20201222075720.00,119.17084152,32.07387900,83.5770,269.94,1.19,207.28,0.001,,3,3,25,25,"
        "-3.617,-4.468,-7.860,-0.000,-0.001,-0.022,1.0,56,"
    )
    text = f"${body}*33736701\n"
    assert degraded(text, Faults()).raw.decode() == text
    changed = degraded(text, Faults(quality=1))
    assert changed.raw.decode().startswith(f"${body.replace(',,3,3,', ',,1,3,')}*")
    again = degraded(changed.raw, Faults(quality=5))
    assert again.rewritten["KSXT"] == 1
    assert ",,2,3," in again.raw.decode()


def test_a_long_checksum_that_begins_like_a_short_one_stays_long() -> None:
    for count in range(10_000):
        body = f"KSXT,20201222075720.00,119.17084152,32.07387900,83.5770,269.94,1.19,207.28,0.001,,3,3,25,{count},,,,,,"
        long = f"{zlib.crc32(body.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF:08X}"
        if sentence(body).endswith(long[:2]):
            break
    done = degraded(f"${body}*{long}\n", Faults(quality=1)).raw.decode()
    new = body.replace(",,3,3,", ",,1,3,")
    assert done == f"${new}*{zlib.crc32(new.encode(), 0xFFFFFFFF) ^ 0xFFFFFFFF:08X}\n"


def test_small_hex_digits_stay_small() -> None:
    text = drive(20).lower().replace("$gn", "$GN")
    lines = []
    for line in text.splitlines():
        kind, _, rest = line.partition(",")
        body = f"{kind[1:].upper()},{rest.partition('*')[0].upper()}"
        head, digits = sentence(body).split("*")
        lines.append(f"{head}*{digits.lower()}")
    for line in lines_of(degraded("\n".join(lines), Faults(sigma_m=5))):
        assert read(line) is not None
        assert line.partition("*")[2] == line.partition("*")[2].lower()


def test_the_antimeridian_the_equator_and_greenwich_are_crossed() -> None:
    for lat, lon in ((0.0, 179.9999999), (1e-9, -1e-9), (-1e-9, -179.9999999)):
        text = "\n".join(gga(NOON + i, lat, lon) for i in range(50))
        fixes = degraded(text, Faults(sigma_m=5)).fixes
        written = placed(degraded(text, Faults(sigma_m=5)))
        sides = {(one.fields[3], one.fields[5]) for one in written}
        assert len(sides) == 4
        for one, want_lat, want_lon in zip(written, fixes.lat_deg, fixes.lon_deg, strict=True):
            assert one.lat == pytest.approx(want_lat, abs=1e-10)
            assert one.lon == pytest.approx(want_lon, abs=1e-10)


def test_an_independent_parser_reads_every_line() -> None:
    lines: list[str] = []
    for i in range(30):
        lines += [line for line in every_kind(NOON + i, -0.00001, 179.99999) if "PASHR" not in line]
    for faults in (Faults(sigma_m=5), Faults(losses_s=((10.0, 20.0),)), Faults(multipath_m=300, quality=2)):
        for line in lines_of(degraded("\n".join(lines), faults)):
            mode = pynmeagps.VALCKSUM
            message = pynmeagps.NMEAReader.parse(line + "\r\n", validate=mode, msgmode=pynmeagps.GET)
            assert message is not None


@pytest.mark.parametrize("places", range(12))
def test_digits_stay_as_many_as_they_were(places: int) -> None:
    text = "\n".join(gga(NOON + i, 52.1 + i, 9.999999999, places=places) for i in range(30))
    for before, after in zip(text.splitlines(), lines_of(degraded(text, Faults(sigma_m=5))), strict=True):
        assert [len(one) for one in before.split(",")[:6]] == [len(one) for one in after.split(",")[:6]]
        assert read(after) is not None


WHERE = st.sampled_from([0.0, 1e-9, -1e-9, 52.1, -33.3, 89.99999, -89.99999, 90.0])
LON = st.sampled_from([0.0, -1e-9, 5.3, 179.9999999, -180.0, 180.0, -77.8, 99.99999999])
GARBAGE = st.one_of(st.sampled_from(UNPLACED), st.binary(max_size=30).map(lambda b: b.decode("latin-1")))
FAULTS = st.sampled_from(
    [
        Faults(sigma_m=5),
        Faults(sigma_m=0.02, outliers=0.5),
        Faults(multipath_m=2, tau_s=0.5, quality=2),
        Faults(losses_s=((0.0, 30.0),), sigma_m=1),
        Faults(losses_s=((0.0, 30.0),), sigma_m=1, drop=True),
        Faults(latency_s=0.7),
    ]
)


@settings(max_examples=150)
@given(
    st.lists(
        st.tuples(st.integers(0, 8), WHERE, LON, GARBAGE, st.sampled_from(["\n", "\r\n", " \n", "\r"])), min_size=2
    ),
    FAULTS,
    st.booleans(),
)
def test_whatever_stands_between_the_sentences_survives(
    rows: list[tuple[int, float, float, str, str]], faults: Faults, prefixed: bool
) -> None:
    text = gga(NOON, 10.0, 20.0) + "\n"
    pieces: list[tuple[str, bool]] = [(text, True)]
    for i, (kind, lat, lon, junk, end) in enumerate(rows, 1):
        junk = junk if junk and junk in UNPLACED else "#" + junk.replace("$", "?").replace("*", "?")
        if kind < 8:
            prefix = f"{1717243200 + i}.5 " if prefixed else ""
            pieces.append((f"{prefix}{every_kind(NOON + i, lat, lon)[kind]}{end}", True))
        pieces.append((junk + "\n", False))
    text = "".join(piece for piece, _ in pieces)
    assert degraded(text, Faults()).raw == text.encode("latin-1")
    done = degraded(text, faults)
    new = done.raw.decode("latin-1")
    at = 0
    for piece, holds in pieces:
        if holds:
            continue
        found = new.find(piece, at)
        assert found >= 0
        at = found + len(piece)
    true_places = {p.partition(",")[2].partition("*")[0] for p, holds in pieces if holds}
    for line in new.replace("\r", "\n").split("\n"):
        if "$" in line and line not in UNPLACED and not faults.latency_s and not faults.outliers:
            assert line[line.find("$") :].strip().partition(",")[2].partition("*")[0] not in true_places
        if "$" in line and line[line.find("$") :] not in UNPLACED:
            assert read(line) is not None


def test_broken_and_foreign_lines_stay() -> None:
    text = "\n".join([gga(NOON, 52.1, 5.3), *UNPLACED, gga(NOON + 1, 52.1, 5.3)])
    for faults in (Faults(sigma_m=5), Faults(losses_s=((0.0, 10.0),)), Faults(losses_s=((0.0, 10.0),), drop=True)):
        new = lines_of(degraded(text, faults))
        inner = new if faults.drop else new[1:-1]
        assert inner == [*UNPLACED]


def test_sentences_without_a_time_go_with_the_epoch_before() -> None:
    timeless = gll(NOON, 52.1, 5.3).replace(clock(NOON), "").partition("*")[0][1:]
    text = "\n".join([gga(NOON, 52.1, 5.3), sentence(timeless), gga(NOON + 60, 52.1, 5.3)])
    done = placed(degraded(text, Faults(sigma_m=5)), "GLL")[0]
    first = placed(degraded(text, Faults(sigma_m=5)))[0]
    assert (done.lat, done.lon) == (first.lat, first.lon)


def test_a_log_over_midnight_is_one_run() -> None:
    text = "\n".join(gga(86390 + i, 52.1, 5.3) for i in range(30))
    span = (1717286390.0, 1717286420.0)
    assert np.flatnonzero(degraded(text, Faults(losses_s=((5.0, 15.0),)), span).fixes.lost).tolist() == list(
        range(5, 16)
    )


def test_nothing_to_degrade_is_said() -> None:
    with pytest.raises(DataError, match="no position fix in"):
        degraded(
            "\n".join([*UNPLACED, ksxt(NOON, 1, 1).replace("68.38", "68.39"), gga(NOON, 1, 1, quality=0)]),
            Faults(sigma_m=1),
        )
