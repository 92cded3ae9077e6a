"""Every sentence against pynmeagps, a parser that reads one line at a time: the same numbers to the last bit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pynmeagps import VALCKSUM, NMEAMessage, NMEAReader

from sccal.logs.decimals import read_decimals
from sccal.logs.nmea import parse_nmea, parse_nmea_heading
from sccal.logs.nmea.kinds import Kind
from sccal.logs.nmea.sentences import find_sentences
from sccal.logs.write import zda
from tests.receiver import sentence


def decimal(low: int, high: int, most_places: int = 9) -> st.SearchStrategy[str]:
    """A number's text with any number of digits after the point, and now and then a sign or zeros in front."""

    def text(whole: int, fraction: str, zeros: int, plus: bool) -> str:
        sign = "-" if whole < 0 else "+" if plus else ""
        return f"{sign}{'0' * zeros}{abs(whole)}" + (f".{fraction}" if fraction else "")

    digits = st.text("0123456789", max_size=most_places)
    return st.builds(text, st.integers(low, high), digits, st.integers(0, 2), st.booleans())


def fraction(places: int) -> st.SearchStrategy[str]:
    return st.integers(0, 10**places - 1).map(lambda value: f"{value:0{places}d}")


CLOCK = st.builds(
    "{:02d}{:02d}{:02d}.{}".format,
    st.integers(0, 23),
    st.integers(0, 59),
    st.integers(0, 59),
    st.sampled_from([1, 2, 3]).flatmap(fraction),
)
LATITUDE = st.builds(
    "{:02d}{:02d}.{},{}".format,
    st.integers(0, 89),
    st.integers(0, 59),
    st.sampled_from([4, 5, 7, 8]).flatmap(fraction),
    st.sampled_from("NS"),
)
LONGITUDE = st.builds(
    "{:03d}{:02d}.{},{}".format,
    st.integers(0, 179),
    st.integers(0, 59),
    st.sampled_from([4, 5, 7, 8]).flatmap(fraction),
    st.sampled_from("EW"),
)
TALKER = st.sampled_from(["GP", "GN", "GL", "GA", "GB", "BD", "GQ", "HE"])
DATE = st.builds(
    "{:02d}{:02d}{:02d}".format, st.integers(1, 12), st.integers(1, 12), st.integers(0, 60)
)  # a date either way round: which way is Trimble's is for another test
SMALL = decimal(0, 99, 3)
BODIES: dict[Kind, st.SearchStrategy[str]] = {
    Kind.GGA: st.builds(
        "{}GGA,{},{},{},{},{},{},{},M,{},M,{},0031".format,
        TALKER, CLOCK, LATITUDE, LONGITUDE, st.integers(1, 5), st.integers(0, 40), SMALL, decimal(-400, 9000),
        decimal(-99, 99), SMALL,
    ),
    Kind.GNS: st.builds(
        "{}GNS,{},{},{},{},{},{},{},{},{},0031,V".format,
        TALKER, CLOCK, LATITUDE, LONGITUDE, st.text("ADRFN", min_size=2, max_size=6), st.integers(0, 40), SMALL,
        decimal(-400, 9000), decimal(-99, 99), SMALL,
    ),
    Kind.RMC: st.builds(
        "{}RMC,{},A,{},{},{},{},{},,,{},V".format,
        TALKER, CLOCK, LATITUDE, LONGITUDE, SMALL, decimal(0, 359, 3), DATE, st.sampled_from("ADRF"),
    ),
    Kind.VTG: st.builds("{}VTG,{},T,,M,{},N,{},K,R".format, TALKER, decimal(0, 359, 3), SMALL, SMALL),
    Kind.GST: st.builds(
        "{}GST,{},{},{},{},{},{},{},{}".format,
        TALKER, CLOCK, SMALL, SMALL, SMALL, decimal(0, 359, 3), SMALL, SMALL, SMALL,
    ),
    Kind.ZDA: st.builds(
        "{}ZDA,{},{:02d},{:02d},{},00,00".format,
        TALKER, CLOCK, st.integers(1, 28), st.integers(1, 12), st.integers(1980, 2099),
    ),
    Kind.HDT: st.builds("{}HDT,{},T".format, TALKER, decimal(0, 359)),
    Kind.THS: st.builds("{}THS,{},{}".format, TALKER, decimal(0, 359), st.sampled_from("AEMSV")),
    Kind.PASHR: st.builds(
        "PASHR,{},{},T,{},{},+0.01,{},{},{},{},1".format,
        CLOCK, decimal(0, 359, 3), decimal(-89, 89, 3), decimal(-89, 89, 3), SMALL, SMALL, SMALL, st.integers(0, 6),
    ),
    Kind.AVR: st.builds(
        "PTNL,AVR,{},{},Yaw,{},Tilt,,,{},{},{},{}".format,
        CLOCK, decimal(-179, 359, 4), decimal(-89, 89, 4), SMALL, st.integers(0, 4), SMALL, st.integers(0, 40),
    ),
    Kind.GGK: st.builds(
        "PTNL,GGK,{},{},{},{},{},{},{},EHT{},M".format,
        CLOCK, DATE, LATITUDE, LONGITUDE, st.integers(1, 12), st.integers(0, 40), SMALL, decimal(-400, 9000),
    ),
}  # fmt: skip
NUMBERS: dict[Kind, dict[str, int]] = {
    Kind.GGA: {"quality": 6, "numSV": 7, "HDOP": 8, "alt": 9, "sep": 11, "diffAge": 13},
    Kind.GNS: {"numSV": 7, "HDOP": 8, "alt": 9, "sep": 10, "diffAge": 11},
    Kind.RMC: {"spd": 7, "cog": 8},
    Kind.VTG: {"cogt": 1, "sogn": 5, "sogk": 7},
    Kind.GST: {"rangeRms": 2, "stdMajor": 3, "stdMinor": 4, "orient": 5, "stdLat": 6, "stdLong": 7, "stdAlt": 8},
    Kind.ZDA: {"day": 2, "month": 3, "year": 4},
    Kind.HDT: {"headingT": 1},
    Kind.THS: {"headt": 1},
    Kind.PASHR: {"trueHdg": 2, "roll": 4, "pitch": 5, "rollAcc": 7, "pitchAcc": 8, "hdgAcc": 9, "gnssQual": 10},
    Kind.AVR: {"yaw": 2, "tilt": 4, "range": 8, "gpsQual": 9, "PDOP": 10, "sip": 11},
    Kind.GGK: {"gpsQual": 7, "sip": 8, "DOP": 9},
}


def parsed(line: str) -> NMEAMessage:
    return NMEAReader.parse(line + "\r\n", validate=VALCKSUM)


def each(kind: Kind) -> Callable[[Callable[..., None]], Callable[..., None]]:
    return given(st.lists(BODIES[kind], min_size=1, max_size=12))


@pytest.mark.parametrize("kind", BODIES)
def test_numbers_agree_to_the_last_bit(kind: Kind) -> None:
    @settings(max_examples=25)
    @each(kind)
    def agree(bodies: list[str]) -> None:
        lines = [sentence(body) for body in bodies]
        found = find_sentences("\r\n".join([*lines, ""]).encode())
        assert found.kind.tolist() == [kind] * len(lines)
        assert found.right_checksum.all()
        messages = [parsed(line) for line in lines]
        for name, field in NUMBERS[kind].items():
            assert found.number(field).tolist() == [float(getattr(message, name)) for message in messages], name

    agree()


@pytest.mark.parametrize("kind", [Kind.GGA, Kind.GNS, Kind.RMC, Kind.GGK])
def test_positions_and_times_agree(kind: Kind) -> None:
    """Degrees to the ten places that the other parser rounds to."""

    @settings(max_examples=25)
    @given(BODIES[kind].filter(lambda body: kind != Kind.GNS or set(body.split(",")[6]) & set("ADRF")))
    def agree(body: str) -> None:
        line = sentence(body)
        stream, _ = parse_nmea("\n".join((zda(1e9), line, "")).encode(), "gnss.nmea")
        message = parsed(line)
        assert float(stream.lat_deg[0]) == pytest.approx(message.lat, rel=0, abs=5.1e-11)
        assert float(stream.lon_deg[0]) == pytest.approx(message.lon, rel=0, abs=5.1e-11)
        stated = message.utctime if kind == Kind.GGK else message.time
        seconds = stated.hour * 3600 + stated.minute * 60 + stated.second + stated.microsecond * 1e-6
        assert float(stream.utc_s[0]) % 86400 == pytest.approx(seconds, abs=1e-6)
        if kind in (Kind.GGA, Kind.GNS):
            assert float(stream.alt_m[0]) == message.alt + message.sep
        elif kind == Kind.GGK:
            assert float(stream.alt_m[0]) == float(message.height.removeprefix("EHT"))

    agree()


@settings(max_examples=60)
@given(st.lists(st.tuples(CLOCK, *(decimal(-89, 89) for _ in range(5)), st.integers(1, 3)), min_size=1, max_size=9))
def test_ksxt_agrees(rows: list[tuple[str, ...]]) -> None:
    lines = [
        sentence(f"KSXT,20240601{t},{lon},{lat},{alt},{yaw},{pitch},1,2,,3,{quality},8,9,,,,1,2,3,,")
        for t, lon, lat, alt, yaw, pitch, quality in rows
    ]
    found = find_sentences("\n".join([*lines, ""]).encode())
    for field in (2, 3, 4, 5, 6, 11):
        stated = [float(getattr(parsed(line), f"field_{field:02d}")) for line in lines]
        assert found.number(field).tolist() == stated
    heading, _ = parse_nmea_heading((zda(1717243200.0) + "\n" + lines[0] + "\n").encode(), "gnss.nmea")
    assert heading.yaw_rad[0] == np.radians(float(rows[0][4]))


@settings(max_examples=200)
@given(st.lists(decimal(-(10**9), 10**9, 10), min_size=1, max_size=30))
def test_decimals_are_rounded_as_python_rounds(texts: list[str]) -> None:
    data = np.frombuffer((",".join(texts)).encode() + bytes(64), dtype=np.uint8)
    length = np.array([len(text) for text in texts])
    end = np.cumsum(length + 1) - 1
    numbers = read_decimals(data, end - length, end)
    for text, got, good in zip(texts, numbers.exact.tolist(), numbers.good.tolist(), strict=True):
        assert good == (len(text) <= 20)
        assert not good or got == float(text)
