"""Sentences as receivers write them, for tests: each by what it states."""

from __future__ import annotations

from datetime import UTC, datetime

from sccal.logs.write import checksum


def sentence(body: str) -> str:
    """With ``$`` and the right checksum."""
    return f"${body}*{checksum(body)}"


def moment(utc_s: float) -> datetime:
    return datetime.fromtimestamp(round(utc_s * 100) / 100, UTC)


def clock(utc_s: float) -> str:
    now = moment(utc_s)
    return f"{now:%H%M%S}.{now.microsecond // 10_000:02d}"


def packed(angle_deg: float, digits: int, sides: str) -> str:
    """``dddmm.mmmmmmmm,side``, or empty fields for NaN."""
    units = round(abs(angle_deg) * 60 * 10**8)
    degrees, units = divmod(units, 60 * 10**8)
    minutes, fraction = divmod(units, 10**8)
    return f"{degrees:0{digits}d}{minutes:02d}.{fraction:08d},{sides[angle_deg < 0]}"


def place(lat_deg: float, lon_deg: float) -> str:
    return f"{packed(lat_deg, 2, 'NS')},{packed(lon_deg, 3, 'EW')}"


def gns(utc_s: float, lat_deg: float, lon_deg: float, mode: str, talker: str = "GN") -> str:
    return sentence(f"{talker}GNS,{clock(utc_s)},{place(lat_deg, lon_deg)},{mode},15,0.7,40.5,44.5,1.2,0031,V")


def ggk(utc_s: float, lat_deg: float, lon_deg: float, quality: int, height: str = "EHT85.250") -> str:
    date = moment(utc_s).strftime("%m%d%y")
    return sentence(f"PTNL,GGK,{clock(utc_s)},{date},{place(lat_deg, lon_deg)},{quality},12,1.7,{height},M")


def ksxt(
    utc_s: float,
    lat_deg: float = 52.1,
    lon_deg: float = 5.3,
    quality: int = 3,
    compass_deg: float | None = None,
    pitch_deg: float | None = None,
    heading_quality: int = 3,
    speed_kmph: float = 3.6,
    roll: str = "",
) -> str:
    now = moment(utc_s)
    stamp = f"{now:%Y%m%d%H%M%S}.{now.microsecond // 10_000:02d}"
    heading = "" if compass_deg is None else f"{compass_deg:.2f}"
    pitch = "" if pitch_deg is None else f"{pitch_deg:.2f}"
    return sentence(
        f"KSXT,{stamp},{lon_deg:.8f},{lat_deg:.8f},85.2500,{heading},{pitch},190.28,{speed_kmph:.3f},{roll},"
        f"{quality},{heading_quality},28,27,,,,-0.012,0.021,0.020,,"
    )


def vtg(course_deg: float, speed_kmph: float, talker: str = "GN") -> str:
    return sentence(f"{talker}VTG,{course_deg:.2f},T,,M,{speed_kmph / 1.852:.3f},N,{speed_kmph:.3f},K,R")


def hdt(compass_deg: float, talker: str = "GN", digits: int = 2) -> str:
    return sentence(f"{talker}HDT,{compass_deg:.{digits}f},T")


def ths(compass_deg: float, mode: str = "A", talker: str = "GN") -> str:
    return sentence(f"{talker}THS,{compass_deg:.2f},{mode}")


def pashr(
    utc_s: float,
    compass_deg: float,
    roll_deg: float = 0.0,
    pitch_deg: float = 0.0,
    sigma_deg: float = 0.1,
    quality: int = 2,
) -> str:
    angles = f"{compass_deg:.2f},T,{roll_deg:+.2f},{pitch_deg:+.2f},+0.01"
    return sentence(f"PASHR,{clock(utc_s)}0,{angles},0.029,0.031,{sigma_deg:.3f},{quality},1")


def avr(
    utc_s: float,
    compass_deg: float,
    tilt_deg: float = 0.0,
    quality: int = 3,
    length_m: float = 1.2,
    across: bool = False,
) -> str:
    angles = f",,{tilt_deg:+.4f},Roll" if across else f"{tilt_deg:+.4f},Tilt,,"
    return sentence(f"PTNL,AVR,{clock(utc_s)},{compass_deg:+.4f},Yaw,{angles},{length_m:.3f},{quality},1.4,16")
