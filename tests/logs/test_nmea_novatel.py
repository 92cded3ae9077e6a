"""NovAtel's long messages: positions, sigmas, qualities, GPS time, and the attitude of an inertial receiver."""

from __future__ import annotations

import calendar

import numpy as np
import pytest

from sccal.degrade.faults import Faults
from sccal.degrade.nmea import degrade_nmea
from sccal.errors import DataError
from sccal.logs.nmea import parse_nmea, parse_nmea_heading
from sccal.logs.nmea.sentences import crc_32
from sccal.logs.streams import FixStream, Notice
from sccal.logs.write import gga, zda
from tests.receiver import sentence

NOON_S = float(calendar.timegm((2024, 6, 1, 12, 0, 0)))
WEEK, OF_WEEK_S = 2316, 561618.0
"""Of NOON_S: a Saturday, 18 leap seconds ahead of UTC."""
REST = '"0004",1.000,0.000,21,19,19,17,0,06,39,33'
FROM_NOVATEL = (
    "#INSPVAXA,USB1,0,65.5,FINESTEERING,2209,490782.000,02000020,46eb,16809;INS_SOLUTION_GOOD,INS_PPP,51.15043710672,"
    "-114.03067871892,1097.3598,-17.0001,-0.0016,0.0002,0.0029,-0.308665944,0.297893298,157.960833016,0.1816,0.1816,"
    "0.1808,0.0018,0.0018,0.0016,0.0292,0.0292,0.0582,13000045,0*a74644a2"
)
"""The example of its manual."""


def long_message(body: str) -> str:
    return f"#{body}*{crc_32(body.encode()):08x}"


def header(name: str, i: int) -> str:
    return f"{name},COM1,0,72.0,FINESTEERING,{WEEK},{OF_WEEK_S + 0.1 * i:.3f},02000020,cdba,16248"


def best(i: int, name: str = "BESTPOSA", state: str = "SOL_COMPUTED", type_: str = "NARROW_INT") -> str:
    place = f"{52.1 + 1e-6 * i:.11f},{-5.3 - 2e-6 * i:.11f},450.1230,46.1000"
    return long_message(f"{header(name, i)};{state},{type_},{place},WGS84,0.0121,0.0118,0.0246,{REST}")


def inertial(i: int, state: str = "INS_SOLUTION_GOOD") -> str:
    place = f"{52.1 + 1e-6 * i:.11f},{-5.3 - 2e-6 * i:.11f},450.1230"
    return long_message(
        f"{header('INSPVAA', i)};{WEEK},{OF_WEEK_S + 0.1 * i:.9f},{place},0.1,0.2,0.0,3.0,-2.0,{90.0 + i:.9f},{state}"
    )


def extended(i: int, state: str = "INS_SOLUTION_GOOD") -> str:
    place = f"{52.1 + 1e-6 * i:.11f},{-5.3 - 2e-6 * i:.11f},450.1230,46.1000"
    return long_message(
        f"{header('INSPVAXA', i)};{state},INS_RTKFIXED,{place},0.1,0.2,0.0,3.0,-2.0,{90.0 + i:.9f},"
        "0.0121,0.0118,0.0246,0.01,0.01,0.01,0.02,0.02,0.15,13000045,0"
    )


def text(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()


def read(lines: list[str]) -> tuple[FixStream, tuple[Notice, ...]]:
    return parse_nmea(text(lines), "gnss.nmea")


def test_best_positions_have_place_sigmas_quality_height_and_utc() -> None:
    fixes, notices = read([best(i) for i in range(5)])
    i = np.arange(5)
    np.testing.assert_allclose(fixes.utc_s, NOON_S + 0.1 * i, atol=1e-6)
    assert fixes.utc_has_date
    np.testing.assert_allclose(fixes.lat_deg, 52.1 + 1e-6 * i, atol=1e-11)
    np.testing.assert_allclose(fixes.lon_deg, -5.3 - 2e-6 * i, atol=1e-11)
    np.testing.assert_allclose(fixes.sigma_north_m, 0.0121)
    np.testing.assert_allclose(fixes.sigma_east_m, 0.0118)
    np.testing.assert_allclose(fixes.alt_m, 496.223)
    assert fixes.quality.tolist() == [4] * 5
    assert fixes.extras["satellites"].tolist() == [19.0] * 5
    assert any("BESTPOSA sentences read" in notice.what for notice in notices)


@pytest.mark.parametrize("of_week_s", [17.999, 18.0, 86417.999, 86418.0, 604799.0])
def test_the_day_goes_with_the_time_of_day_about_midnight(of_week_s: float) -> None:
    lines = [best(i).replace(f"{OF_WEEK_S + 0.1 * i:.3f}", f"{of_week_s + 0.001 * i:.3f}") for i in range(3)]
    lines = [long_message(line[1 : line.index("*")]) for line in lines]
    fixes, _ = read(lines)
    week_s = calendar.timegm((1980, 1, 6, 0, 0, 0)) + 7 * 86400.0 * WEEK
    np.testing.assert_allclose(fixes.utc_s, week_s + of_week_s - 18.0 + 0.001 * np.arange(3), atol=1e-6)


@pytest.mark.parametrize(
    ("type_", "quality"),
    [
        ("SINGLE", 1), ("PSRDIFF", 2), ("WAAS", 9), ("NARROW_FLOAT", 5), ("L1_INT", 4), ("INS_RTKFIXED", 4),
        ("PPP", 5), ("PROPAGATED", 6), ("FIXEDPOS", 7), ("NEVER_HEARD_OF", -1),
    ],
)  # fmt: skip
def test_a_type_of_position_is_a_quality(type_: str, quality: int) -> None:
    fixes, _ = read([best(i, type_=type_) for i in range(3)])
    assert fixes.quality.tolist() == [quality] * 3


def test_what_is_not_computed_is_no_fix() -> None:
    lines = [best(0), best(1, state="INSUFFICIENT_OBS"), best(2, type_="NONE"), best(3)]
    fixes, notices = read(lines)
    np.testing.assert_allclose(fixes.utc_s, NOON_S + np.array([0.0, 0.3]), atol=1e-6)
    assert [n.count for n in notices if "without a fix" in n.what] == [2]


def test_gnss_alone_comes_before_what_an_inertial_receiver_says() -> None:
    lines = [
        line for i in range(5) for line in (best(i, type_="INS_RTKFIXED"), best(i, "BESTGNSSPOSA", type_="L1_INT"))
    ]
    _, notices = read(lines)
    assert any("BESTGNSSPOSA sentences read" in notice.what for notice in notices)


def test_a_velocity_is_no_position_and_gives_the_speed() -> None:
    def velocity(i: int, name: str, state: str = "SOL_COMPUTED") -> str:
        return long_message(f"{header(name, i)};{state},DOPPLER_VELOCITY,0.150,0.000,{1.0 + 0.1 * i:.4f},90.0,0.0,0.0")

    lines = [line for i in range(4) for line in (best(i), velocity(i, "BESTGNSSVELA"))]
    fixes, notices = read(lines)
    assert fixes.speed_mps is None
    assert any("other sentences passed over" in notice.what and notice.count == 4 for notice in notices)
    lines = [
        line for i in range(4) for line in (best(i), velocity(i, "BESTVELA", "SOL_COMPUTED" if i else "COLD_START"))
    ]
    fixes, _ = read(lines)
    np.testing.assert_allclose(fixes.speed_mps, [np.nan, 1.1, 1.2, 1.3])


def test_a_unicore_receiver_counts_milliseconds_and_its_week_stands_elsewhere() -> None:
    lines = [
        long_message(
            f"BESTNAVA,97,GPS,FINE,{WEEK},{561618000 + 100 * i},0,0,18,20;SOL_COMPUTED,NARROW_FLOAT,"
            f"52.1,5.3,450.1230,46.1000,WGS84,0.3,0.2,0.5,{REST}"
        )
        for i in range(3)
    ]
    fixes, _ = read(lines)
    np.testing.assert_allclose(fixes.utc_s, NOON_S + 0.1 * np.arange(3), atol=1e-6)
    assert fixes.quality.tolist() == [5] * 3
    np.testing.assert_allclose((fixes.sigma_north_m, fixes.sigma_east_m), ((0.3,) * 3, (0.2,) * 3))


def test_gga_stays_the_fixes_where_it_is_there() -> None:
    lines = [zda(NOON_S)]
    for i in range(5):
        lines += [best(i), gga(NOON_S + 0.1 * i, 52.2, 5.3, 40.0, 4, 12, 0.6, 0.8)]
    fixes, _ = read(lines)
    np.testing.assert_allclose(fixes.lat_deg, 52.2)
    assert np.isnan(fixes.sigma_north_m).all()


@pytest.mark.parametrize("make", [inertial, extended])
def test_an_inertial_solution_gives_position_and_attitude_with_the_signs_of_ahrs_csv(make) -> None:  # type: ignore[no-untyped-def]
    lines = [make(i) for i in range(5)]
    fixes, notices = read(lines)
    np.testing.assert_allclose(fixes.lat_deg, 52.1 + 1e-6 * np.arange(5), atol=1e-11)
    assert fixes.quality.tolist() == [4 if make is extended else -1] * 5
    assert any("inertial solution" in notice.what and notice.severity == "warning" for notice in notices)
    heading, told = parse_nmea_heading(text(lines), "gnss.nmea")
    assert heading.convention == "ned"
    assert heading.utc_s is not None
    assert heading.pitch_rad is not None
    assert heading.roll_rad is not None
    np.testing.assert_allclose(heading.utc_s, NOON_S + 0.1 * np.arange(5), atol=1e-6)
    np.testing.assert_allclose(np.degrees(heading.yaw_rad), 90.0 + np.arange(5))
    np.testing.assert_allclose(np.degrees(heading.pitch_rad), -2.0)
    np.testing.assert_allclose(np.degrees(heading.roll_rad), 3.0)
    assert (heading.yaw_sigma_rad is not None) == (make is extended)
    assert not any("baseline" in notice.what for notice in told)


@pytest.mark.parametrize("make", [inertial, extended])
@pytest.mark.parametrize("state", ["INS_ALIGNING", "INS_SOLUTION_FREE", "WAITING_AZIMUTH"])
def test_an_inertial_solution_without_fixes_is_none(make, state: str) -> None:  # type: ignore[no-untyped-def]
    lines = [make(0, state), make(1), make(2)]
    fixes, _ = read(lines)
    assert fixes.lat_deg.size == 2
    heading, _ = parse_nmea_heading(text(lines), "gnss.nmea")
    assert heading.yaw_rad.size == 2


def test_the_manuals_example_is_whole_and_read() -> None:
    raw = text([FROM_NOVATEL])
    fixes, _ = parse_nmea(raw, "gnss.nmea")
    assert (fixes.lat_deg[0], fixes.lon_deg[0]) == pytest.approx((51.15043710672, -114.03067871892))
    assert (fixes.alt_m[0], fixes.sigma_north_m[0]) == pytest.approx((1080.3597, 0.1816))
    assert fixes.quality.tolist() == [5]
    assert fixes.utc_s[0] == calendar.timegm((2022, 5, 13, 16, 19, 24))
    heading, _ = parse_nmea_heading(raw, "gnss.nmea")
    assert np.degrees(heading.yaw_rad[0]) == pytest.approx(157.960833016)
    assert heading.pitch_rad is not None
    assert np.degrees(heading.pitch_rad[0]) == pytest.approx(0.297893298)


def test_a_wrong_crc_is_dropped() -> None:
    broken = best(1).replace("52.1", "53.1")
    fixes, notices = read([best(0), broken, best(2)])
    assert fixes.lat_deg.size == 2
    assert any("wrong checksum" in notice.what for notice in notices)


def test_a_long_message_without_a_position_is_named() -> None:
    with pytest.raises(DataError, match=r"#RANGEA, a long message that is not read"):
        read([long_message(f"{header('RANGEA', 0)};1,2,3")])
    with pytest.raises(DataError, match=r"no GGA, BESTGNSSPOSA, BESTPOSA"):
        read([sentence("GNHDT,123.4,T")])


@pytest.mark.parametrize("make", [best, extended])
def test_a_degraded_message_is_whole_moved_and_less_sure(make) -> None:  # type: ignore[no-untyped-def]
    lines = [make(i) for i in range(40)]
    done = degrade_nmea(text(lines), Faults(sigma_m=2.0, losses_s=((2.0, 3.0),)), None, "run")
    fixes, notices = parse_nmea(done.raw, "gnss.nmea")
    lost = int(done.fixes.lost.sum())
    assert lost in (10, 11)
    assert fixes.lat_deg.size == 40 - lost
    assert not any("checksum" in notice.what for notice in notices)
    moved_m = 111_320.0 * (fixes.lat_deg[:20] - 52.1 - 1e-6 * np.arange(20))
    assert 1.0 < moved_m.std() < 3.0
    np.testing.assert_allclose(fixes.sigma_north_m, np.hypot(0.0121, 2.0), atol=1e-3)


def test_long_messages_that_are_not_read_are_told_as_whole() -> None:
    other = long_message(f"{header('TRACKSTATA', 0)};SOL_COMPUTED,PSRDIFF,5.0,30")
    _, notices = read([best(0), other, best(1)])
    assert not any("checksum" in notice.what for notice in notices)
    assert any("passed over" in notice.what for notice in notices)
