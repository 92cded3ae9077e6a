"""NMEA logs for the tests of degrading, and a slow reader of them."""

from __future__ import annotations

import functools
import operator
from dataclasses import dataclass

NOON = 43200.0


def sentence(body: str) -> str:
    return f"${body}*{functools.reduce(operator.xor, body.encode(), 0):02X}"


def clock(t_s: float) -> str:
    hundredths = round(t_s * 100) % 8_640_000
    return f"{hundredths // 360000:02d}{hundredths // 6000 % 60:02d}{hundredths // 100 % 60:02d}.{hundredths % 100:02d}"


def packed(angle_deg: float, whole: int, places: int) -> str:
    unit = 10**places
    units = round(abs(angle_deg) * 60 * unit)
    degrees, rest = divmod(units, 60 * unit)
    minutes, fraction = divmod(rest, unit)
    return f"{degrees:0{whole}d}{minutes:02d}.{fraction:0{places}d}" if places else f"{degrees:0{whole}d}{minutes:02d}"


def place(lat: float, lon: float, places: int) -> str:
    north, east = "S" if lat < 0 else "N", "W" if lon < 0 else "E"
    return f"{packed(lat, 2, places)},{north},{packed(lon, 3, places)},{east}"


def gga(t_s: float, lat: float, lon: float, quality: int = 4, places: int = 8, hdop: str = "0.60") -> str:
    where = place(lat, lon, places)
    return sentence(f"GNGGA,{clock(t_s)},{where},{quality},12,{hdop},40.000,M,0.000,M,0.8,")


def rmc(t_s: float, lat: float, lon: float, mode: str = "R", places: int = 8) -> str:
    return sentence(f"GNRMC,{clock(t_s)},A,{place(lat, lon, places)},1.000,90.00,010624,,,{mode}")


def gns(t_s: float, lat: float, lon: float, places: int = 8) -> str:
    return sentence(f"GNGNS,{clock(t_s)},{place(lat, lon, places)},RRNR,20,0.60,40.0,45.0,1.0,0000,V")


def gll(t_s: float, lat: float, lon: float, places: int = 8) -> str:
    return sentence(f"GNGLL,{place(lat, lon, places)},{clock(t_s)},A,R")


def ggk(t_s: float, lat: float, lon: float, places: int = 8) -> str:
    return sentence(f"PTNL,GGK,{clock(t_s)},060124,{place(lat, lon, places)},3,12,1.9,EHT150.790,M")


def ksxt(t_s: float, lat: float, lon: float) -> str:
    return sentence(
        f"KSXT,20240601{clock(t_s)},{lon:.8f},{lat:.8f},68.3830,299.22,67.03,190.28,0.022,,3,3,46,28,"
        "10.000,20.000,3.000,-0.004,-0.021,-0.020,,"
    )


def pubx(t_s: float, lat: float, lon: float, places: int = 6) -> str:
    return sentence(
        f"PUBX,00,{clock(t_s)},{place(lat, lon, places)},546.589,D3,2.1,2.0,0.007,77.52,0.007,1.0,0.92,1.19,0.77,9,0,0"
    )


def pashr(t_s: float, lat: float, lon: float, places: int = 7) -> str:
    return sentence(f"PASHR,POS,3,10,{clock(t_s)},{place(lat, lon, places)},102.53,,308.4,0.5,0.1,1.9,1.0,1.6,1.5,Hp23")


def every_kind(t_s: float, lat: float, lon: float) -> list[str]:
    """One of each sentence that holds a position, of one epoch."""
    makers = (gga, rmc, gns, gll, ggk, ksxt, pubx, pashr)
    return [make(t_s, lat, lon) for make in makers]


UNPLACED = (
    sentence("GNGSA,A,3,01,02,03,,,,,,,,,,1.0,0.6,0.8"),
    sentence("GPGSV,1,1,01,01,45,100,40"),
    sentence("GNVTG,90.0,T,,M,1.0,N,1.8,K,R"),
    sentence("GNZDA,120000.00,01,06,2024,00,00"),
    sentence("GNHDT,123.4,T"),
    sentence("GNTXT,01,01,02,hello"),
    sentence("GPWPL,5230.00,N,00530.00,E,HOME"),
    sentence("PASHR,120000.00,1.0,T,0.1,0.2,,0.1,0.1,0.1,1,0"),
    sentence("PTNL,AVR,120000.00,+52.1531,Yaw,-0.0806,Tilt,,,12.575,3,1.4,16"),
    "$GNGGA,120000.00,5206.0,N,00518.0,E,4,12,0.6,40.0,M,0.0,M,,*00",
    "$GNGGA,1200",
    "prompt> ",
    "",
)


@dataclass(frozen=True)
class Read:
    """What one sentence says."""

    kind: str
    t: str
    lat: float | None
    lon: float | None
    fields: list[str]


_AT = {"GGA": (1, 2, 4), "RMC": (1, 3, 5), "GNS": (1, 2, 4), "GLL": (5, 1, 3), "GGK": (2, 4, 6), "PUBX": (2, 3, 5)}


def read(line: str) -> Read | None:
    """The plain reader: one sentence that holds a position and has a right checksum, or None."""
    text = line[line.find("$") + 1 :] if "$" in line else ""
    body, star, digits = text.partition("*")
    if not star or digits.strip().upper() != f"{functools.reduce(operator.xor, body.encode('latin-1'), 0):02X}":
        return None
    fields = body.split(",")
    kind = {"PTNL": "GGK", "PUBX": "PUBX", "PASHR": "PASHR", "KSXT": "KSXT"}.get(fields[0], fields[0][2:])
    if kind == "KSXT":
        lon, lat = (float(one) if one else None for one in fields[2:4])
        return Read(kind, fields[1][8:], lat, lon, fields)
    if kind == "PASHR" and fields[1] != "POS":
        return None
    at = {**_AT, "PASHR": (4, 5, 7)}.get(kind)
    if at is None or (kind == "GGK" and fields[1] != "GGK"):
        return None
    angles = []
    for field, sides in ((at[1], "NS"), (at[2], "EW")):
        if not fields[field]:
            angles.append(None)
            continue
        assert fields[field + 1] in sides
        degrees, minutes = divmod(float(fields[field]), 100)
        assert minutes < 60
        angles.append((degrees + minutes / 60) * (-1 if fields[field + 1] in "SW" else 1))
    return Read(kind, fields[at[0]], angles[0], angles[1], fields)
