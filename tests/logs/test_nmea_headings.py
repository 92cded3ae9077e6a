"""Headings from NMEA: every kind, its signs, what is not measured, and when it stands in for ahrs.csv."""

from __future__ import annotations

import calendar
from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError
from sccal.logs.nmea import parse_nmea_heading
from sccal.logs.nmea.sentences import crc_32
from sccal.logs.run import discover, read_run
from sccal.logs.streams import HeadingStream, Notice
from sccal.logs.write import gga, rmc, zda
from tests.receiver import avr, hdt, ksxt, pashr, sentence, ths

NOON_S = float(calendar.timegm((2024, 6, 1, 12, 0, 0)))
VEHICLE = "[nominal]\nwheel_radius_m = 0.08\ntrack_m = 0.7\n[encoder]\nticks_per_rev = 1000\n"


def at(i: int) -> float:
    return NOON_S + 0.1 * i


def fix(i: int) -> str:
    return gga(at(i), 52.1, 5.3, 40.0, 4, 12, 0.6, 0.8)


def compass(i: int) -> float:
    return (350.0 + 0.5 * i) % 360.0


MAKE = {
    "HDT": lambda i: hdt(compass(i)),
    "THS": lambda i: ths(compass(i)),
    "PASHR": lambda i: pashr(at(i), compass(i)),
    "PTNL,AVR": lambda i: avr(at(i), compass(i)),
    "KSXT": lambda i: ksxt(at(i), compass_deg=compass(i)),
}


def log(*makers: object, count: int = 40) -> list[str]:
    return [zda(NOON_S), *(line for i in range(count) for line in (fix(i), *(make(i) for make in makers)))]


def read(lines: list[str]) -> tuple[HeadingStream, tuple[Notice, ...]]:
    return parse_nmea_heading(("\n".join(lines) + "\n").encode(), "gnss.nmea")


def told(notices: tuple[Notice, ...], words: str) -> Notice:
    matches = [notice for notice in notices if words in notice.what]
    assert len(matches) == 1, [str(notice) for notice in notices]
    return matches[0]


@pytest.mark.parametrize("kind", MAKE)
def test_each_kind_is_read_at_its_epochs(kind: str) -> None:
    heading, notices = read(log(MAKE[kind]))
    i = np.arange(40)
    assert heading.utc_s is not None
    np.testing.assert_allclose(heading.utc_s, NOON_S + 0.1 * i, atol=1e-6)
    np.testing.assert_allclose(heading.t_s, heading.utc_s)
    np.testing.assert_allclose(np.degrees(heading.yaw_rad), [compass(k) for k in i], atol=1e-9)
    assert (heading.convention, heading.source) == ("ned", f"gnss.nmea ({kind})")
    assert told(notices, "headings read").count == 40


@pytest.mark.parametrize("kind", MAKE)
def test_provisional_times_are_on_the_logging_clock(kind: str) -> None:
    lines = [f"{i * 0.1 / 2 + 7.0:.3f} {line}" for i, line in enumerate(log(MAKE[kind])[1:])]
    heading, _ = read(["6.9 " + zda(NOON_S), *lines])
    np.testing.assert_allclose(heading.t_s - 7.0, heading.utc_s - NOON_S, atol=0.06)
    assert (np.diff(heading.t_s) > 0).all()


def test_pashr_gives_sigmas_and_attitude_with_the_signs_of_ahrs_csv() -> None:
    """Nose up and left side up are positive in both."""
    heading, _ = read(log(lambda i: pashr(at(i), compass(i), roll_deg=3.0, pitch_deg=-2.0, sigma_deg=0.25)))
    np.testing.assert_allclose(np.degrees(heading.roll_rad), 3.0)
    np.testing.assert_allclose(np.degrees(heading.pitch_rad), -2.0)
    np.testing.assert_allclose(np.degrees(heading.yaw_sigma_rad), 0.25)


def test_sigmas_of_zero_are_not_stated() -> None:
    heading, _ = read(log(lambda i: pashr(at(i), compass(i), sigma_deg=0.0 if i % 2 else 0.1)))
    assert np.isnan(heading.yaw_sigma_rad).sum() == 20
    heading, _ = read(log(lambda i: pashr(at(i), compass(i), sigma_deg=0.0)))
    assert heading.yaw_sigma_rad is None


def test_avr_says_itself_whether_it_tilts_or_rolls() -> None:
    heading, _ = read(log(lambda i: avr(at(i), compass(i), 1.5)))
    np.testing.assert_allclose(np.degrees(heading.pitch_rad), 1.5)
    assert heading.roll_rad is None
    heading, _ = read(log(lambda i: avr(at(i), compass(i), 1.5, across=True)))
    np.testing.assert_allclose(np.degrees(heading.roll_rad), 1.5)
    assert heading.pitch_rad is None


def test_ksxt_gives_pitch_and_where_there_are_gyros_roll() -> None:
    heading, notices = read(log(lambda i: ksxt(at(i), compass_deg=1.0, pitch_deg=-4.0)))
    np.testing.assert_allclose(np.degrees(heading.pitch_rad), -4.0)
    assert heading.roll_rad is None
    assert "baseline" in told(notices, "headings read").what
    heading, _ = read(log(lambda i: ksxt(at(i), compass_deg=1.0, pitch_deg=-4.0, roll="2.5")))
    np.testing.assert_allclose(np.degrees(heading.roll_rad), 2.5)


@pytest.mark.parametrize("mode", "EMSVN")
def test_ths_that_does_not_measure_is_no_heading(mode: str) -> None:
    heading, notices = read(log(lambda i: ths(compass(i), mode if 10 <= i < 20 else "A")))
    assert heading.yaw_rad.size == 30
    assert told(notices, "without a heading").count == 10
    with pytest.raises(DataError, match="no heading"):
        read(log(lambda i: ths(compass(i), mode)))


@pytest.mark.parametrize(
    "void",
    [
        sentence("GNHDT,,T"),
        sentence("GNHDT,12.5,M"),
        sentence("GNTHS,,V"),
        sentence("PASHR,120000.000,,T,,,,,,,0,0"),
        sentence("PASHR,120000.000,12.5,M,0.1,0.1,0,0.1,0.1,0.1,1,1"),
        sentence("PASHR,120000.000,12.5,T,0.1,0.1,0,0.1,0.1,0.1,0,1"),
        sentence("PTNL,AVR,120000.00,,,,,,,,0,,"),
        sentence("PTNL,AVR,120000.00,+12.5,Yaw,+0.1,Tilt,,,1.2,0,1.4,9"),
        sentence("KSXT,20240601120000.00,5.3,52.1,85.0,0.00,0.00,0.00,0.000,,3,0,28,0,,,,0,0,0,,"),
    ],
)
def test_what_states_no_heading_is_none(void: str) -> None:
    with pytest.raises(DataError, match="without a heading"):
        read([zda(NOON_S), fix(0), void, fix(1)])


def test_impossible_headings_are_dropped_and_told() -> None:
    heading, notices = read(log(lambda i: hdt(compass(i)) if i != 7 else sentence("GNHDT,1e9,T")))
    assert heading.yaw_rad.size == 39
    assert told(notices, "impossible heading").where == "line 17"
    heading, _ = read(log(lambda i: avr(at(i), -170.0)))
    np.testing.assert_allclose(np.degrees(heading.yaw_rad), -170.0)


@pytest.mark.parametrize("kind", ["avr", "ksxt"])
def test_headings_without_fixed_ambiguities_are_left_out_where_there_are_others(kind: str) -> None:
    def make(i: int, fixed: bool) -> str:
        if kind == "avr":
            return avr(at(i), compass(i), quality=3 if fixed else 2)
        return ksxt(at(i), compass_deg=compass(i), heading_quality=3 if fixed else 2)

    heading, notices = read(log(lambda i: make(i, i >= 10)))
    assert heading.yaw_rad.size == 30
    assert told(notices, "without fixed").count == 10
    heading, notices = read(log(lambda i: make(i, i == 3)))
    assert heading.yaw_rad.size == 40
    assert told(notices, "without fixed").doubt


def test_headings_over_a_baseline_of_another_length_are_wrong() -> None:
    heading, notices = read(log(lambda i: avr(at(i), compass(i), length_m=1.2 if i % 5 else 1.6)))
    assert heading.yaw_rad.size == 32
    assert "1.20 m" in told(notices, "baseline is not the usual").what


@pytest.mark.parametrize("others", [("HDT",), ("HDT", "THS"), ("KSXT", "HDT"), ("PTNL,AVR", "THS")])
def test_the_kind_that_says_most_is_read(others: tuple[str, ...]) -> None:
    heading, notices = read(log(*(MAKE[kind] for kind in (*others, "PASHR"))))
    assert heading.source == "gnss.nmea (PASHR)"
    assert heading.yaw_rad.size == 40
    assert len([notice for notice in notices if "not used" in notice.what]) == len(others)


def test_a_kind_that_comes_seldom_does_not_hide_one_that_comes_often() -> None:
    heading, _ = read(log(MAKE["HDT"], lambda i: MAKE["KSXT"](i) if i % 10 == 0 else fix(i)))
    assert heading.source == "gnss.nmea (HDT)"


def test_one_talker_of_two_is_read() -> None:
    heading, notices = read(log(lambda i: hdt(compass(i)), lambda i: hdt(90.0, "HE") if i % 2 else sentence("GPGSV,1")))
    np.testing.assert_allclose(np.degrees(heading.yaw_rad), [compass(i) for i in range(40)], atol=1e-9)
    assert told(notices, "talker HE").severity == "warning"


def test_a_receiver_that_changes_its_talker_is_one() -> None:
    heading, _ = read(log(lambda i: hdt(compass(i), "GN" if i < 25 else "GP")))
    assert heading.yaw_rad.size == 40


def test_headings_oftener_than_fixes_are_true_when_they_come() -> None:
    lines = [f"0.0 {zda(NOON_S)}"]
    for i in range(200):
        lines.append(f"{0.02 * i + 0.001:.4f} {hdt(0.5 * i, 'HE')}")
        if i % 5 == 0:
            lines.append(f"{0.02 * i + 0.03:.4f} {fix(i // 5)}")
    heading, notices = read(lines)
    assert heading.utc_s is None
    np.testing.assert_allclose(heading.t_s, 0.02 * np.arange(200) + 0.001, atol=1e-9)
    assert told(notices, "oftener").count == 200


def test_over_midnight() -> None:
    start_s = float(calendar.timegm((2023, 12, 31, 23, 59, 58)))
    lines = [rmc(start_s, 52.1, 5.3, 1.0, 1.0)]
    for i in range(40):
        lines += [gga(start_s + 0.1 * i, 52.1, 5.3, 1.0, 4, 9, 1.0), hdt(float(i))]
    heading, _ = read(lines)
    np.testing.assert_allclose(heading.utc_s, start_s + 0.1 * np.degrees(heading.yaw_rad), atol=1e-6)


def run_folder(folder: Path, lines: list[str]) -> Path:
    (folder / "encoder.csv").write_text("t,left_ticks,right_ticks\n0,0,0\n0.1,1,1\n0.2,2,2\n")
    (folder / "gnss.nmea").write_text("\n".join(lines) + "\n")
    (folder / "vehicle.toml").write_text(VEHICLE)
    return folder


def test_without_ahrs_csv_the_heading_is_the_receivers(tmp_path: Path) -> None:
    folder = run_folder(tmp_path, log(MAKE["THS"]))
    run = read_run(discover([folder])[0])
    assert run.heading.source == "gnss.nmea (THS)"
    assert "headings read" in str(run.notices)
    (folder / "ahrs.csv").write_text("t,yaw_deg\n0,1\n0.1,1\n")
    run = read_run(discover([folder])[0])
    assert (run.heading.source, run.heading.convention) == ("ahrs.csv", None)


def test_without_any_heading_the_error_says_what_would_do(tmp_path: Path) -> None:
    folder = run_folder(tmp_path, log())
    with pytest.raises(DataError, match=r"lacks ahrs\.csv; found encoder\.csv, gnss\.nmea.*HDT, THS, KSXT") as caught:
        read_run(discover([folder])[0])
    assert "PTNL,AVR, PASHR" in str(caught.value)


def test_one_heading_is_too_few(tmp_path: Path) -> None:
    folder = run_folder(tmp_path, [*log(), hdt(1.0)])
    with pytest.raises(DataError, match=r"gnss\.nmea \(HDT\): 1 usable rows"):
        read_run(discover([folder])[0])


def long_message(text: str) -> str:
    return f"#{text}*{crc_32(text.encode()):08x}"


OF_MAKERS = {
    "HPR": sentence("GNHPR,120000.00,123.45,-0.40,0.00,4,21,0.00,0999"),
    "TRA": sentence("GPTRA,120000.00,123.45,-0.40,0.00,4,23,0.00,0000"),
    "PSSN,HRP": sentence("PSSN,HRP,120000.00,010624,123.45,,-0.40,0.17,,0.25,19,2,2.4,E"),
    "PSAT,HPR": sentence("PSAT,HPR,120000.00,123.45,-0.40,,N"),
    "PQTMTAR": sentence("PQTMTAR,1,120000.000,4,,0.752,-0.40,0.0,123.45,0.2,0.0,0.17,24"),
    "PASHR,ATT": sentence("PASHR,ATT,561618.00,123.45,-0.40,0.0,0.001,0.002,0"),
    "PSXN,23": sentence("PSXN,23,0.12,-0.40,123.45,0.00"),
    "HDG": sentence("HCHDG,123.45,,,,"),
    "HDM": sentence("HCHDM,123.45,M"),
    "UNIHEADINGA": long_message(
        'UNIHEADINGA,95,GPS,FINE,2316,561618000,0,0,18,10;SOL_COMPUTED,NARROW_INT,0.8,123.45,-0.40,0.0,0.17,0.25,"9",3'
    ),
    "HEADINGA": long_message(
        'HEADINGA,COM2,0,61.5,FINESTEERING,2316,561618.000,02000000,0000,16248;SOL_COMPUTED,L1_INT,0.9,123.45,-0.40,0.0,'
        '0.17,0.25,"4",15'
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_MAKERS)
def test_a_makers_heading_is_read(name: str) -> None:
    lines = [zda(NOON_S), fix(0), OF_MAKERS[name], fix(1), ""]
    heading, notices = parse_nmea_heading("\n".join(lines).encode(), "gnss.nmea")
    assert heading.source == f"gnss.nmea ({name})"
    assert np.degrees(heading.yaw_rad) == pytest.approx([123.45])
    assert heading.utc_s == pytest.approx([NOON_S])
    assert heading.pitch_rad is None or np.degrees(heading.pitch_rad) == pytest.approx([-0.40])
    assert any("magnetic" in notice.what for notice in notices) == (name in ("HDG", "HDM"))


def test_a_makers_heading_without_a_solution_is_none() -> None:
    lines = [zda(NOON_S), fix(0), sentence("GNHPR,120000.00,123.45,-0.40,0.00,0,3,0.00,0999"), ""]
    with pytest.raises(DataError, match="without a heading"):
        parse_nmea_heading("\n".join(lines).encode(), "gnss.nmea")


def test_what_is_no_heading_is_named_where_there_is_none() -> None:
    lines = [zda(NOON_S), fix(0), sentence("PXYZW,ATT,120000.00,1.0"), sentence("GNVTG,1.0,T,,M,1.5,N,2.8,K,D"), ""]
    with pytest.raises(DataError, match=r"1 RMC, KSXT or VTG state a course.*PXYZW 1"):
        parse_nmea_heading("\n".join(lines).encode(), "gnss.nmea")


def test_headings_that_lost_their_tails_are_dropped() -> None:
    whole = [sentence(f"GNHDT,{10 + number}.000,T") for number in range(6)]
    lines = [
        zda(NOON_S),
        *(text for number in range(6) for text in (fix(number), whole[number])),
        fix(6),
        "$GNHDT,1",
        "",
    ]
    heading, _ = parse_nmea_heading("\n".join(lines).encode(), "gnss.nmea")
    assert np.degrees(heading.yaw_rad) == pytest.approx(np.arange(10, 16))
