"""Fixes from every kind of sentence: which is chosen, what quality it has, and that one epoch is one fix."""

from __future__ import annotations

import calendar
import math

import numpy as np
import pytest

from sccal.errors import DataError
from sccal.logs.nmea import parse_nmea
from sccal.logs.nmea.kinds import Kind
from sccal.logs.nmea.sentences import find_sentences
from sccal.logs.streams import FixStream, Notice
from sccal.logs.write import gga, gst, rmc, zda
from tests.receiver import ggk, gns, ksxt, sentence, vtg

NOON_S = float(calendar.timegm((2024, 6, 1, 12, 0, 0)))


def read(lines: list[str]) -> tuple[FixStream, tuple[Notice, ...]]:
    return parse_nmea(("\n".join(lines) + "\n").encode(), "gnss.nmea")


def at(i: int) -> float:
    return NOON_S + 0.1 * i


def place(i: int) -> tuple[float, float]:
    return 52.1 + 1e-6 * i, 5.3 - 2e-6 * i


def fix(i: int, quality: int = 4, talker: str = "GN", east_m: float = 0.0) -> str:
    lat, lon = place(i)
    line = gga(at(i), lat, lon + east_m / 68_400.0, 40.0, quality, 12, 0.6, 0.8)
    return sentence(talker + line[3:].partition("*")[0])


def told(notices: tuple[Notice, ...], words: str) -> Notice:
    matches = [notice for notice in notices if words in notice.what]
    assert len(matches) == 1, [str(notice) for notice in notices]
    return matches[0]


@pytest.mark.parametrize(
    ("mode", "quality"),
    [
        ("A", 1),
        ("AA", 1),
        ("DAN", 2),
        ("NNR", 4),
        ("RF", 4),
        ("FAAA", 5),
        ("NF", 5),
        ("PN", 3),
        ("EE", 6),
        ("MN", 7),
        ("SS", 8),
        ("rn", 4),
        ("", -1),
    ],
)
def test_gns_is_as_good_as_its_best_constellation(mode: str, quality: int) -> None:
    stream, _ = read([zda(NOON_S), *(gns(at(i), *place(i), mode) for i in range(3))])
    assert stream.quality.tolist() == [quality] * 3


@pytest.mark.parametrize("mode", ["N", "NN", "NNNN"])
def test_gns_without_any_constellation_is_no_fix(mode: str) -> None:
    with pytest.raises(DataError, match="without a fix"):
        read([gns(at(i), *place(i), mode) for i in range(3)])


@pytest.mark.parametrize(
    ("trimble", "quality"),
    [(1, 1), (2, 5), (3, 4), (4, 2), (5, 2), (6, 5), (7, 4), (8, 5), (9, 4), (10, 5), (11, 2), (12, 5), (13, 2)],
)
def test_ggk_counts_qualities_as_trimble_does(trimble: int, quality: int) -> None:
    stream, _ = read([ggk(at(i), *place(i), trimble) for i in range(3)])
    assert stream.quality.tolist() == [quality] * 3


@pytest.mark.parametrize(("stated", "quality"), [(1, 1), (2, 5), (3, 4)])
def test_ksxt_counts_qualities_as_unicore_does(stated: int, quality: int) -> None:
    stream, _ = read([ksxt(at(i), *place(i), quality=stated) for i in range(3)])
    assert stream.quality.tolist() == [quality] * 3


@pytest.mark.parametrize("kind", ["gns", "ggk", "ksxt"])
@pytest.mark.parametrize("south_west", [False, True])
def test_each_kind_alone_gives_dated_places(kind: str, south_west: bool) -> None:
    sign = -1 if south_west else 1
    make = {"gns": lambda *a: gns(*a, "RR"), "ggk": lambda *a: ggk(*a, 3), "ksxt": ksxt}[kind]
    lines = [make(at(i), sign * place(i)[0], sign * place(i)[1]) for i in range(5)]
    stream, notices = read([zda(NOON_S), *lines] if kind == "gns" else lines)
    i = np.arange(5)
    np.testing.assert_allclose(stream.utc_s, NOON_S + 0.1 * i, atol=1e-6)
    np.testing.assert_allclose(stream.lat_deg, sign * (52.1 + 1e-6 * i), atol=1e-8)
    np.testing.assert_allclose(stream.lon_deg, sign * (5.3 - 2e-6 * i), atol=1e-8)
    np.testing.assert_allclose(stream.alt_m, 85.0 if kind == "gns" else 85.25)
    assert stream.utc_has_date
    assert told(notices, "there is no GGA").severity == "info"


@pytest.mark.parametrize(("height", "alt_m"), [("EHT-6.777", -6.777), ("EHT85.25", 85.25), ("85.25", 85.25)])
def test_heights_of_ggk_come_with_letters(height: str, alt_m: float) -> None:
    stream, _ = read([ggk(at(i), *place(i), 3, height) for i in range(2)])
    assert stream.alt_m.tolist() == [alt_m] * 2


def test_trimble_ggk_as_one_word() -> None:
    line = ggk(NOON_S, 52.1, 5.3, 3)
    stream, _ = read([sentence(line[1:].partition("*")[0].replace("PTNL,GGK", "PTNLGGK"))] * 2)
    assert stream.quality.tolist() == [4]


def test_trimble_dates_put_the_month_first_unless_that_is_impossible() -> None:
    june, _ = read([ggk(at(i), *place(i), 3) for i in range(2)])
    assert june.utc_s[0] == NOON_S
    turned = [sentence(ggk(at(i), *place(i), 3)[1:].partition("*")[0].replace("060124", "250624")) for i in range(2)]
    stream, _ = read(turned)
    assert stream.utc_s[0] == NOON_S + 24 * 86400


def test_all_kinds_of_one_epoch_are_one_fix() -> None:
    lines = []
    for i in range(20):
        here = place(i)
        lines += [
            rmc(at(i), *here, 1.0, 90.0, "A"),
            fix(i),
            gns(at(i), *here, "AA"),
            ggk(at(i), *here, 1),
            ksxt(at(i), *here, quality=1),
            gst(at(i), 0.012, 0.015),
        ]
    stream, notices = read(lines)
    assert stream.quality.tolist() == [4] * 20
    np.testing.assert_allclose(stream.sigma_north_m, 0.015)
    assert not notices


@pytest.mark.parametrize(
    ("first", "second", "quality"), [("gns", "ggk", 5), ("ggk", "ksxt", 5), ("ksxt", "rmc", 5), ("gns", "rmc", 5)]
)
def test_without_gga_the_kind_that_says_most_is_read(first: str, second: str, quality: int) -> None:
    make = {
        "gns": lambda i, best: gns(at(i), *place(i), "FF" if best else "AA"),
        "ggk": lambda i, best: ggk(at(i), *place(i), 2 if best else 1),
        "ksxt": lambda i, best: ksxt(at(i), *place(i), quality=2 if best else 1),
        "rmc": lambda i, best: rmc(at(i), *place(i), 1, 1, "F" if best else "A"),
    }
    for order in (1, -1):
        lines = [line for i in range(9) for line in (make[first](i, True), make[second](i, False))[::order]]
        stream, _ = read(lines)
        assert stream.quality.tolist() == [quality] * 9


def test_a_few_gga_do_not_hide_a_log_of_another_kind() -> None:
    lines = [zda(NOON_S), fix(0), *(ksxt(at(i), *place(i)) for i in range(50))]
    stream, notices = read(lines)
    assert stream.lat_deg.size == 50
    assert told(notices, "only 1 GGA").severity == "warning"


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(("other", "quality"), [("GP", 1), ("GL", 2), ("GB", 5)])
def test_of_two_talkers_the_better_one_is_read(order: int, other: str, quality: int) -> None:
    lines = [line for i in range(20) for line in (fix(i), fix(i, quality, other))[::order]]
    stream, notices = read([zda(NOON_S), *lines])
    assert stream.quality.tolist() == [4] * 20
    assert told(notices, "seen before").count == 20


def test_a_receiver_that_changes_its_talker_is_one() -> None:
    lines = [fix(i, 4, "GP" if 30 <= i < 60 else "GN") for i in range(100)]
    stream, notices = read([zda(NOON_S), *lines])
    assert stream.lat_deg.size == 100
    assert told(notices, "in the pauses").count == 30


@pytest.mark.parametrize("shift_s", [0.0, 0.05])
def test_two_receivers_of_two_names_are_not_mixed(shift_s: float) -> None:
    lines = []
    for i in range(100):
        lat, lon = place(i)
        other = gga(at(i) + shift_s, lat + 2e-5, lon, 40.0, 5, 12, 0.6)
        lines += [fix(i), sentence("GP" + other[3:].partition("*")[0])]
    stream, notices = read([zda(NOON_S), *lines])
    assert stream.quality.tolist() == [4] * 100
    notice = told(notices, "two receivers")
    assert (notice.count, notice.severity) == (100, "warning")
    assert "m away" in notice.what


@pytest.mark.parametrize("keeps_order", [True, False])
def test_two_receivers_of_one_name_are_told_apart_by_their_place(keeps_order: bool) -> None:
    """The robot turns on the spot: the line between the antennas turns with it."""
    lines = []
    for i in range(200):
        angle = 0.05 * i
        lat = 52.1 + 0.5 * math.sin(angle) / 111_320.0
        lon = 5.3 + 0.5 * math.cos(angle) / 68_400.0
        pair = [
            gga(at(i), lat, lon, 40.0, 4, 12, 0.6),
            gga(at(i), 2 * 52.1 - lat, 2 * 5.3 - lon, 40.0, 4, 12, 0.6),
        ]
        lines += pair if keeps_order or i % 3 else pair[::-1]
    stream, notices = read([zda(NOON_S), *lines])
    assert stream.lat_deg.size == 200
    steps_m = 111_320.0 * np.hypot(np.diff(stream.lat_deg), np.diff(stream.lon_deg) * math.cos(math.radians(52.1)))
    assert steps_m.max() < 0.05
    assert told(notices, "two receivers").doubt


def test_sigmas_of_the_own_talker_come_first() -> None:
    lines = []
    for i in range(5):
        other = gst(at(i), 3.0, 4.0)
        lines += [sentence("GP" + other[3:].partition("*")[0]), gst(at(i), 0.012, 0.015), fix(i)]
    stream, _ = read([zda(NOON_S), *lines])
    np.testing.assert_allclose(stream.sigma_east_m, 0.012)


@pytest.mark.parametrize("kind", ["rmc", "vtg", "ksxt"])
def test_the_receivers_speed_belongs_to_its_epoch(kind: str) -> None:
    lines = [zda(NOON_S)]
    for i in range(20):
        lines.append(fix(i))
        if i == 7:
            continue
        speed_mps = 0.5 + 0.01 * i
        lines.append(
            {
                "rmc": rmc(at(i), *place(i), speed_mps, 10.0, "R"),
                "vtg": vtg(10.0, speed_mps * 3.6),
                "ksxt": ksxt(at(i), *place(i), speed_kmph=3.6 * speed_mps),
            }[kind]
        )
    stream, _ = read(lines)
    assert stream.speed_mps is not None
    expected = np.where(np.arange(20) == 7, np.nan, 0.5 + 0.01 * np.arange(20))
    np.testing.assert_allclose(stream.speed_mps, expected, atol=3e-4)
    assert "speed_mps" not in stream.extras


def test_without_speeds_there_is_no_speed() -> None:
    stream, _ = read([zda(NOON_S), fix(0), fix(1)])
    assert stream.speed_mps is None


def test_a_void_rmc_says_nothing_about_speed() -> None:
    void = rmc(at(0), *place(0), 1.0, 1.0, "N")
    stream, _ = read([zda(NOON_S), fix(0), void, fix(1), rmc(at(1), *place(1), 1.0, 1.0, "A")])
    assert np.isnan(stream.speed_mps).tolist() == [True, False]


def test_ksxt_of_comnav_ends_in_a_crc32() -> None:
    """A line as such a receiver wrote it."""
    body = (
        "KSXT,20201222075720.00,119.17084152,32.07387900,83.5770,269.94,1.19,207.28,0.001,,3,3,25,25,"
        "-3.617,-4.468,-7.860,-0.000,-0.001,-0.022,1.0,56,"
    )
    assert find_sentences(f"${body}*33736701\r\n".encode()).right_checksum.tolist() == [True]
    assert find_sentences(f"${body}*33736702\r\n".encode()).right_checksum.tolist() == [False]
    assert find_sentences(f"${body.replace('269', '268')}*33736701\r\n".encode()).right_checksum.tolist() == [False]


def test_ksxt_of_unicore_as_its_manual_prints_it() -> None:
    line = (
        b"$KSXT,20190909084745.00,116.23662400,40.07897925,68.3830,299.22,-67.03,190.28,0.022,,1,3,46,28,,,,"
        b"-0.004,-0.021,-0.020,,*27\r\n"
    )
    stream, _ = parse_nmea(line, "gnss.nmea")
    assert stream.utc_s[0] == calendar.timegm((2019, 9, 9, 8, 47, 45))
    assert (stream.lat_deg[0], stream.lon_deg[0], stream.alt_m[0]) == (40.07897925, 116.23662400, 68.3830)
    assert stream.quality.tolist() == [1]


def test_other_sentences_of_ashtech_under_the_same_name_are_no_attitude() -> None:
    lines = [sentence("PASHR,POS,2,10,120000.00"), sentence("PASHR,ATT,1,2,3,4,5,6,0"), sentence("PTNL,VGK,1,2")]
    assert find_sentences("\n".join(lines).encode()).kind.tolist() == [Kind.PASHR_POS, Kind.PASHR_ATT, Kind.OTHER]
    _, notices = read([zda(NOON_S), *lines, fix(0), fix(1)])
    assert told(notices, "other sentences").count == 2


@pytest.mark.parametrize("prefix", ["[12.5] ", "12.5: ", "12.5|", "12.5;", "(12.5) ", '"12.5","', "12.5 > "])
def test_further_ways_to_write_the_receive_time(prefix: str) -> None:
    stream, notices = read([prefix + line for line in (zda(NOON_S), fix(0), fix(1))])
    assert stream.host_t_s.tolist() == [12.5, 12.5]
    assert not notices


def test_text_before_sentences_that_is_no_time_is_told() -> None:
    stream, notices = read([f"row {7 * i} of many {fix(i)}" for i in range(5)])
    assert np.isnan(stream.host_t_s).all()
    assert told(notices, "no receive time read").severity == "warning"


def test_a_sentence_without_end_is_no_sentence() -> None:
    endless = sentence("GNGGA,120000.50,5206.0,N,00518.0,E,4,12,0.6,40,M,0,M,," + "1" * 600)
    stream, _ = read([zda(NOON_S), fix(0), endless, fix(1)])
    assert stream.lat_deg.size == 2


def test_fields_beyond_the_standard_are_passed_over() -> None:
    long = [sentence(fix(i)[1:].partition("*")[0] + ",1,2,3,x") for i in range(3)]
    stream, notices = read([zda(NOON_S), *long])
    assert stream.quality.tolist() == [4] * 3
    assert not notices


@pytest.mark.parametrize("whose", ["of capitals", "own", "none"])
def test_a_log_in_lower_case_is_read(whose: str) -> None:
    lines = [zda(NOON_S), *(fix(i) for i in range(5))]
    if whose == "of capitals":
        lines = [line.lower() for line in lines]
    elif whose == "own":
        lines = [sentence(line[1:].partition("*")[0].lower()) for line in lines]
    else:
        lines = [line.partition("*")[0].lower() for line in lines]
    stream, _ = read(lines)
    assert stream.quality.tolist() == [4] * 5
    np.testing.assert_allclose(stream.lat_deg, [place(i)[0] for i in range(5)])


def test_a_wrong_checksum_is_wrong_in_lower_case_too() -> None:
    lines = [fix(0).lower(), fix(1).lower().replace("5206", "5207"), fix(2).lower()]
    stream, notices = read([zda(NOON_S), *lines])
    assert stream.lat_deg.size == 2
    assert told(notices, "wrong checksum").count == 1
