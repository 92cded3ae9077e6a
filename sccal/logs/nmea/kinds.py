"""The kinds of sentences: where each holds what, how it tells the quality of a fix, and how a lost fix looks in it.

One row of LAYOUTS is all that the reader and ``sccal degrade`` know of a kind. Fields are counted from 1 after the
address; after the name that follows it where a maker's address of four letters, such as $PTNL, has names of its own.
All qualities are told in the numbers of GGA. Sources:

* GGA, GNS, RMC, GLL, VTG, GST, ZDA, HDT: NMEA 0183 version 4.10 and IEC 61162-1. Mode letters: A autonomous,
  D differential, E estimated, F float RTK, M manual, N no fix, P precise, R real-time kinematic, S simulator. GNS has
  one letter for each constellation, N where it is not used: the position is as good as the best that took part, and
  this is what receivers then state in GGA. THS: IEC 61162-1; heading, mode.
* PTNL,GGK: Trimble receiver help, and Spectra Geospatial, "GGKx": date mmddyy, height above the ellipsoid after EHT.
  PTNL,AVR: Trimble receiver help: time, yaw, "Yaw", tilt, "Tilt", roll, "Roll", length of the baseline, quality.
* KSXT: Unicore N4 and reference commands: longitude first, degrees, date and time in one field, speeds in km/h, and
  east, north, up from the base. ComNav: heading in field 5, pitch in 6, roll in 9 where there are gyros.
* PASHR: Applanix POS MV V5 guide, table 20; NovAtel OEM7 and Trimble receiver help: time, heading, T, roll, pitch,
  heave, sigmas of roll, pitch and heading, quality. PASHR,POS: Ashtech.
* PUBX,00: u-blox M8 protocol specification.
* HPR: Unicore N4 reference commands: time, heading, pitch, roll, quality as in GGA, satellites, age, station. TRA: the
  same fields, ComNav and older Unicore manuals.
* PSSN,HRP: Septentrio AsteRx reference guide: time, date ddmmyy, heading, roll, pitch, their sigmas, satellites, mode
  (0 none, 1 and 3 float, 2 and 4 fixed), magnetic variation.
* PSAT,HPR: Hemisphere technical reference: time, heading, pitch, roll, N by satellites or G by gyro.
* PQTMTAR: Quectel LC02H and LC29H protocol: version, time, quality, reserved, length of the baseline, pitch, roll,
  heading, their sigmas, satellites.
* PASHR,ATT: Ashtech and Spectra manuals: seconds of the GPS week, heading, pitch, roll, errors, 0 where ambiguities
  are fixed.
* PSXN,23: Kongsberg Seapath manual: roll positive with port up, pitch positive with bow up, heading, heave.
* HDG, HDM: NMEA 0183: what a compass reads, clockwise from magnetic north.
* UNIHEADINGA: Unicore N4 reference commands; HEADINGA, HEADING2A, DUALANTENNAHEADINGA: NovAtel OEM7 documentation. A
  header with GPS week and time of week, then state, type of solution, length, heading, pitch, reserved, sigmas. They
  begin with ``#`` and end in a CRC-32.
* BESTPOSA, BESTGNSSPOSA: NovAtel OEM7 documentation: solution status, position type, latitude, longitude, height above
  sea level, undulation, datum, sigmas of latitude, longitude and height, station, ages, satellites. BESTPOS of a
  receiver with an IMU may be the inertial solution; BESTGNSSPOS never is. BESTNAVA: Unicore N4 reference commands; the
  same fields after Unicore's header. BESTVELA: status, type, latency, age, speed over ground in m/s.
* INSPVAA, INSPVAXA: NovAtel OEM7 documentation, SPAN logs: week and seconds, or status and position type, then
  latitude, longitude, height, velocities, roll, pitch, azimuth. Roll is a right-handed rotation about the forward axis
  and pitch about the one to the right: left side up and nose up are positive, as in ahrs.csv.

Unicore's second antenna sends the usual sentences with an H at the end of the address.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from types import MappingProxyType
from typing import Literal


class Kind(IntEnum):
    """The sentences that are known, whatever their talker; the rest is OTHER."""

    OTHER = 0
    GGA = 1
    GNS = 2
    RMC = 3
    VTG = 4
    GST = 5
    ZDA = 6
    HDT = 7
    THS = 8
    PASHR = 9
    AVR = 10
    GGK = 11
    KSXT = 12
    GLL = 13
    PUBX = 14
    PASHR_POS = 15
    GGA_H = 16
    RMC_H = 17
    GNS_H = 18
    GLL_H = 19
    HPR = 20
    TRA = 21
    HRP = 22
    PSAT_HPR = 23
    TAR = 24
    PASHR_ATT = 25
    PSXN = 26
    HDG = 27
    HDM = 28
    UNIHEADING = 29
    HEADING = 30
    DUAL_HEADING = 31
    BEST_POS = 32
    BEST_GNSS_POS = 33
    BEST_NAV = 34
    BEST_VEL = 35
    INS_PVA = 36
    INS_PVAX = 37


NO_FIX = 0
NOT_STATED = -1
_NOTHING: Mapping[str, int] = MappingProxyType({})


@dataclass(frozen=True)
class Claim:
    """How a kind of sentence states the quality of its fix."""

    form: Literal["number", "letter", "letters", "word"]
    """One number, one mode letter, one for each constellation (the best one counts), or one of some words."""
    read: Mapping[str, int]
    """GGA quality by what is written, worse mode letters first."""
    written: Mapping[int, str]
    """What is written for each GGA quality."""
    unknown: int = NOT_STATED
    """The quality of another number above zero."""
    others: int = NOT_STATED
    """The quality of another word."""


_MODES = {"N": 0, "S": 8, "M": 7, "E": 6, "A": 1, "P": 3, "D": 2, "F": 5, "R": 4}
MODE_LETTERS = {quality: letter for letter, quality in _MODES.items()} | {9: "D"}
"""Mode letters by GGA quality."""
_NUMBERS = {str(quality): quality for quality in range(10)}
_GGA = Claim("number", _NUMBERS, {quality: text for text, quality in _NUMBERS.items()}, unknown=NO_FIX)
_MODE = Claim("letter", _MODES, MODE_LETTERS)
_GGK = Claim(
    "number",
    dict(zip(map(str, range(15)), (0, 1, 5, 4, 2, 2, 5, 4, 5, 4, 5, 2, 5, 2, 5), strict=True)),
    {0: "0", 1: "1", 2: "4", 3: "4", 4: "3", 5: "2", 6: "1", 7: "1", 8: "3", 9: "4"},
)
"""0 none, 1 autonomous, 2 RTK float, 3 RTK fixed, 4 DGPS, 5 SBAS, 6/8 network RTK float, 7/9 network RTK fixed,
10 OmniSTAR HP, 11 OmniSTAR VBS, 12 location RTK, 13 beacon DGPS, 14 RTK global."""
_KSXT = Claim(
    "number",
    {"0": 0, "1": 1, "2": 5, "3": 4},
    {0: "0", 1: "1", 2: "1", 3: "1", 4: "3", 5: "2", 6: "1", 7: "1", 8: "3", 9: "1"},
)
_PUBX = Claim(
    "word",
    {"NF": 0, "DR": 6, "G2": 1, "G3": 1, "D2": 2, "D3": 2, "RK": 6, "TT": 0},
    {0: "NF", 1: "G3", 2: "D3", 3: "G3", 4: "D3", 5: "D3", 6: "DR", 7: "G3", 8: "G3", 9: "D3"},
)
_ASHTECH = Claim(
    "word",
    {"0": 1, "1": 2, "2": 5, "3": 4},
    {0: "", 1: "0", 2: "1", 3: "0", 4: "3", 5: "2", 6: "0", 7: "0", 8: "3", 9: "1"},
)


_SOLUTIONS = {
    **dict.fromkeys(("NONE", "DOPPLER_VELOCITY", "INS"), 0),
    **dict.fromkeys(("FIXEDPOS", "FIXEDHEIGHT"), 7),
    **dict.fromkeys(("SINGLE", "INS_PSRSP"), 1),
    **dict.fromkeys(("PSRDIFF", "INS_PSRDIFF"), 2),
    **dict.fromkeys(("WAAS", "SBAS", "INS_SBAS", "OMNISTAR"), 9),
    "PROPAGATED": 6,
    **dict.fromkeys(("L1_FLOAT", "IONOFREE_FLOAT", "NARROW_FLOAT", "WIDE_FLOAT", "FLOATCONV", "INS_RTKFLOAT"), 5),
    **dict.fromkeys(("PPP_CONVERGING", "PPP", "PPP_BASIC_CONVERGING", "PPP_BASIC"), 5),
    **dict.fromkeys(("INS_PPP_CONVERGING", "INS_PPP", "INS_PPP_BASIC_CONVERGING", "INS_PPP_BASIC"), 5),
    **dict.fromkeys(("OMNISTAR_HP", "OMNISTAR_XP", "CDGPS"), 5),
    **dict.fromkeys(("L1_INT", "WIDE_INT", "NARROW_INT", "INS_RTKFIXED"), 4),
}
"""Types of a position in long messages."""
_SOLUTION = Claim(
    "word",
    _SOLUTIONS,
    {0: "NONE", 1: "SINGLE", 2: "PSRDIFF", 3: "SINGLE", 4: "NARROW_INT", 5: "NARROW_FLOAT"}
    | {6: "PROPAGATED", 7: "FIXEDPOS", 8: "SINGLE", 9: "WAAS"},
)
_INS_FIXED = ("INS_SOLUTION_GOOD",)
_INS_LOOSE = ("INS_ALIGNMENT_COMPLETE", "INS_HIGH_VARIANCE")
_INS_NONE = ("INS_INACTIVE", "INS_ALIGNING", "INS_SOLUTION_FREE", "INS_SOLUTION_NOT_GOOD")
"""States of an inertial solution. A free one has lost its fixes, and its position drifts."""
_INS = Claim(
    "word",
    dict.fromkeys((*_INS_FIXED, *_INS_LOOSE), NOT_STATED) | dict.fromkeys(_INS_NONE, 0),
    dict.fromkeys(range(1, 10), _INS_FIXED[0]) | {0: _INS_NONE[0]},
    others=NO_FIX,
)


@dataclass(frozen=True)
class Position:
    """The fields of a position and what goes with it."""

    latitude: int
    longitude: int
    quality: int
    claim: Claim
    in_degrees: bool = False
    """Signed decimal degrees; else degrees and minutes, with the hemisphere in the field after."""
    status: int | None = None
    """Field that says whether there is a fix."""
    holds: tuple[str, ...] = ("A",)
    """What stands there with one."""
    altitude_m: int | None = None
    separation_m: int | None = None
    """What to add to the altitude for a height above the ellipsoid, where it is given."""
    hdop: int | None = None
    accuracy_m: int | None = None
    """The receiver's own error estimate."""
    sigmas_m: tuple[int, int] | None = None
    """East and north, of the position itself."""
    from_base_m: tuple[int, int] | None = None
    """East and north of the base."""
    extras: Mapping[str, int] = field(default_factory=lambda: _NOTHING)
    """Further columns."""
    emptied: tuple[int, ...] = ()
    """What a receiver without a fix leaves empty, besides the position."""
    lost: tuple[tuple[int, str], ...] = ()
    """What it writes instead of other fields."""


@dataclass(frozen=True)
class Date:
    """The field or fields of a date, and their form.

    A stamp is year, month, day and the time in one; after a GPS week its seconds or milliseconds stand.
    """

    fields: tuple[int, ...]
    form: Literal["ddmmyy", "mmddyy", "dd,mm,yyyy", "stamp", "week,s", "week,ms"]


@dataclass(frozen=True)
class Speed:
    """The fields of the speed over ground, and the one that tells whether it holds."""

    knots: int | None = None
    kmph: int | None = None
    mps: int | None = None
    told_by: int | None = None
    holds: str = ""
    """The letter or word with which it holds."""
    holds_not: str = ""
    """The letter with which it does not."""


@dataclass(frozen=True)
class Heading:
    """The fields of a heading clockwise from true north, and of what goes with it, all in degrees."""

    yaw: int
    pitch: int | None = None
    roll: int | None = None
    sigma: int | None = None
    state: int | None = None
    """Field that tells how good the heading is; None where every one counts, or where a reader of its own decides."""
    fixed: tuple[str, ...] = ()
    """What stands there with fixed ambiguities, or where there are none to fix."""
    loose: tuple[str, ...] = ()
    """What stands there with a heading that may be degrees off. Anything else is none."""
    north: Literal["true", "magnetic"] = "true"


@dataclass(frozen=True)
class Layout:
    """One kind of sentence."""

    name: str
    """As users write it."""
    fewest: int
    """Fields below which a sentence is not whole."""
    time: int | None = None
    """None: it belongs to the epoch among whose sentences it stands."""
    clock: Literal["utc", "week_s", "week_ms"] = "utc"
    """hhmmss, or seconds or milliseconds of the GPS week."""
    date: Date | None = None
    position: Position | None = None
    speed: Speed | None = None
    heading: Heading | None = None


_SOLVED = ("NARROW_INT", "WIDE_INT", "L1_INT", "INS_RTKFIXED")
_UNSOLVED = ("NARROW_FLOAT", "WIDE_FLOAT", "L1_FLOAT", "IONOFREE_FLOAT", "INS_RTKFLOAT", "PSRDIFF", "SINGLE")
"""Types of solution in long messages, Unicore's and NovAtel's."""
_LONG_HEADING = Heading(13, pitch=14, sigma=16, state=11, fixed=_SOLVED, loose=_UNSOLVED)
_BEST_POS = Layout(
    "BESTPOSA",
    fewest=24,
    time=6,
    clock="week_s",
    date=Date((5,), "week,s"),
    position=Position(
        12, 13, quality=11, claim=_SOLUTION, in_degrees=True, status=10, holds=("SOL_COMPUTED",), altitude_m=14,
        separation_m=15, sigmas_m=(18, 17), extras={"satellites": 24, "age_s": 21},
        lost=((10, "INSUFFICIENT_OBS"), (11, "NONE")),
    ),
)  # fmt: skip

LAYOUTS: dict[Kind, Layout] = {
    Kind.GGA: Layout(
        "GGA",
        fewest=6,
        time=1,
        position=Position(
            2, 4, quality=6, claim=_GGA, altitude_m=9, separation_m=11, hdop=8,
            extras={"hdop": 8, "satellites": 7, "age_s": 13},
            emptied=(9, 10, 11, 12, 13, 14), lost=((6, "0"), (7, "00"), (8, "99.99")),
        ),
    ),
    Kind.GNS: Layout(
        "GNS",
        fewest=10,
        time=1,
        position=Position(
            2, 4, quality=6, claim=replace(_MODE, form="letters"), altitude_m=9, separation_m=10, hdop=8,
            extras={"hdop": 8, "satellites": 7, "age_s": 11},
            emptied=(9, 10, 11, 12), lost=((7, "00"), (8, "99.99")),
        ),
    ),
    Kind.RMC: Layout(
        "RMC",
        fewest=9,
        time=1,
        date=Date((9,), "ddmmyy"),
        speed=Speed(knots=7, told_by=2, holds="A"),
        position=Position(
            3, 5, quality=12, claim=_MODE, status=2, emptied=(7, 8, 10, 11), lost=((2, "V"), (12, "N"))
        ),
    ),
    Kind.GLL: Layout(
        "GLL",
        fewest=5,
        time=5,
        position=Position(1, 3, quality=7, claim=_MODE, status=6, lost=((6, "V"), (7, "N"))),
    ),
    Kind.GGK: Layout(
        "PTNL,GGK",
        fewest=10,
        time=1,
        date=Date((2,), "mmddyy"),
        position=Position(
            3, 5, quality=7, claim=_GGK, altitude_m=10, hdop=9, extras={"dop": 9, "satellites": 8},
            emptied=(9, 10), lost=((7, "0"), (8, "00")),
        ),
    ),
    Kind.KSXT: Layout(
        "KSXT",
        fewest=11,
        time=1,
        date=Date((1,), "stamp"),
        speed=Speed(kmph=8),
        heading=Heading(5, pitch=6, roll=9),
        position=Position(
            3, 2, quality=10, claim=_KSXT, in_degrees=True, altitude_m=4, from_base_m=(14, 15),
            extras={"satellites": 13, "age_s": 20},
            emptied=(4, 7, 8, 14, 15, 16, 17, 18, 19), lost=((10, "0"),),
        ),
    ),
    Kind.PUBX: Layout(
        "PUBX,00",
        fewest=17,
        time=1,
        position=Position(
            2, 4, quality=7, claim=_PUBX, hdop=14, accuracy_m=8, emptied=(6, 8, 9, 10, 11, 12, 13),
            lost=((7, "NF"), (14, "99.99"), (15, "99.99"), (16, "99.99"), (17, "0")),
        ),
    ),
    Kind.PASHR_POS: Layout(
        "PASHR,POS",
        fewest=16,
        time=4,
        position=Position(
            5, 7, quality=2, claim=_ASHTECH, hdop=15, emptied=(2, 9, 11, 12, 13), lost=((3, "00"), (15, "99.99"))
        ),
    ),
    Kind.PASHR: Layout("PASHR", fewest=9, time=1, heading=Heading(2, pitch=5, roll=4, sigma=9)),
    Kind.AVR: Layout("PTNL,AVR", fewest=9, time=1, heading=Heading(2, pitch=4, roll=6)),
    Kind.THS: Layout("THS", fewest=2, heading=Heading(1)),
    Kind.HDT: Layout("HDT", fewest=1, heading=Heading(1)),
    Kind.HPR: Layout(
        "HPR", fewest=5, time=1, heading=Heading(2, pitch=3, state=5, fixed=("4",), loose=("1", "2", "5"))
    ),
    Kind.TRA: Layout(
        "TRA", fewest=5, time=1, heading=Heading(2, pitch=3, state=5, fixed=("4",), loose=("1", "2", "5"))
    ),
    Kind.HRP: Layout(
        "PSSN,HRP",
        fewest=10,
        time=1,
        heading=Heading(3, roll=4, pitch=5, sigma=6, state=10, fixed=("2", "4"), loose=("1", "3")),
    ),
    Kind.PSAT_HPR: Layout(
        "PSAT,HPR", fewest=5, time=1, heading=Heading(2, pitch=3, roll=4, state=5, fixed=("N", "G"))
    ),
    Kind.TAR: Layout(
        "PQTMTAR", fewest=8, time=2, heading=Heading(8, pitch=6, sigma=11, state=3, fixed=("4",), loose=("5", "6"))
    ),
    Kind.PASHR_ATT: Layout(
        "PASHR,ATT",
        fewest=8,
        time=2,
        clock="week_s",
        heading=Heading(3, pitch=4, state=8, fixed=("0",), loose=tuple("123456789")),
    ),
    Kind.UNIHEADING: Layout("UNIHEADINGA", fewest=17, time=5, clock="week_ms", heading=_LONG_HEADING),
    Kind.HEADING: Layout("HEADINGA", fewest=17, time=6, clock="week_s", heading=_LONG_HEADING),
    Kind.DUAL_HEADING: Layout("DUALANTENNAHEADINGA", fewest=17, time=6, clock="week_s", heading=_LONG_HEADING),
    Kind.BEST_POS: _BEST_POS,
    Kind.BEST_GNSS_POS: replace(_BEST_POS, name="BESTGNSSPOSA"),
    Kind.BEST_NAV: replace(_BEST_POS, name="BESTNAVA", time=5, clock="week_ms", date=Date((4,), "week,ms")),
    Kind.BEST_VEL: Layout(
        "BESTVELA",
        fewest=16,
        time=6,
        clock="week_s",
        speed=Speed(mps=14, told_by=10, holds="SOL_COMPUTED"),
    ),
    Kind.INS_PVAX: Layout(
        "INSPVAXA",
        fewest=30,
        time=6,
        clock="week_s",
        date=Date((5,), "week,s"),
        heading=Heading(21, pitch=20, roll=19, sigma=30, state=10, fixed=_INS_FIXED, loose=_INS_LOOSE),
        position=Position(
            12, 13, quality=11, claim=_SOLUTION, in_degrees=True, status=10, holds=(*_INS_FIXED, *_INS_LOOSE),
            altitude_m=14, separation_m=15, sigmas_m=(23, 22), lost=((10, "INS_INACTIVE"), (11, "NONE")),
        ),
    ),
    Kind.INS_PVA: Layout(
        "INSPVAA",
        fewest=21,
        time=6,
        clock="week_s",
        date=Date((5,), "week,s"),
        heading=Heading(20, pitch=19, roll=18, state=21, fixed=_INS_FIXED, loose=_INS_LOOSE),
        position=Position(
            12, 13, quality=21, claim=_INS, in_degrees=True, altitude_m=14, lost=((21, "INS_INACTIVE"),)
        ),
    ),
    Kind.PSXN: Layout("PSXN,23", fewest=3, heading=Heading(3, pitch=2, roll=1)),
    Kind.HDG: Layout("HDG", fewest=1, heading=Heading(1, north="magnetic")),
    Kind.HDM: Layout("HDM", fewest=1, heading=Heading(1, north="magnetic")),
    Kind.VTG: Layout("VTG", fewest=7, speed=Speed(knots=5, kmph=7, told_by=9, holds_not="N")),
    Kind.GST: Layout("GST", fewest=8, time=1),
    Kind.ZDA: Layout("ZDA", fewest=4, time=1, date=Date((2, 3, 4), "dd,mm,yyyy")),
}  # fmt: skip
OF_SECOND_ANTENNA = {Kind.GGA_H: Kind.GGA, Kind.RMC_H: Kind.RMC, Kind.GNS_H: Kind.GNS, Kind.GLL_H: Kind.GLL}
"""The same sentences of a second antenna, by the first one's."""
LAYOUTS |= {own: replace(LAYOUTS[first], name=f"{first.name}H") for own, first in OF_SECOND_ANTENNA.items()}

GST_SIGMAS, GST_BEARING = (3, 4, 6, 7), 5
"""Fields of GST: semi-major and semi-minor axis, north, east; and the bearing of the major axis."""
READ_FOR_POSITIONS = (
    *(Kind.GGA, Kind.BEST_GNSS_POS, Kind.BEST_POS, Kind.BEST_NAV, Kind.GNS, Kind.GGK, Kind.KSXT),
    *(Kind.INS_PVAX, Kind.RMC, Kind.INS_PVA),
)
"""By how much they say about their quality."""
READ_FOR_HEADINGS = (
    *(Kind.PASHR, Kind.AVR, Kind.KSXT, Kind.HRP, Kind.UNIHEADING, Kind.HEADING, Kind.DUAL_HEADING, Kind.TAR),
    *(Kind.INS_PVAX, Kind.INS_PVA, Kind.PASHR_ATT, Kind.HPR, Kind.TRA, Kind.PSAT_HPR, Kind.THS, Kind.HDT, Kind.PSXN),
    *(Kind.HDG, Kind.HDM),
)
"""The ones that say more about their quality first."""
PLACED = tuple(kind for kind, layout in LAYOUTS.items() if layout.position is not None)
"""All that hold a position."""
INERTIAL = (Kind.INS_PVAX, Kind.INS_PVA)
"""What a filter makes of fixes and gyros."""
LONG = (
    *(Kind.UNIHEADING, Kind.HEADING, Kind.DUAL_HEADING),
    *(Kind.BEST_POS, Kind.BEST_GNSS_POS, Kind.BEST_NAV, Kind.BEST_VEL, *INERTIAL),
)
"""Messages that begin with ``#``, part fields by ``;`` too, and end in a CRC-32."""
COURSES = (Kind.RMC, Kind.KSXT, Kind.VTG)
"""Sentences with a course over ground, which is no heading."""
READ_FOR_SPEEDS = (*COURSES, Kind.BEST_VEL)
READ_FOR_DATES = (
    *(Kind.RMC, Kind.ZDA, Kind.KSXT, Kind.GGK),
    *(Kind.BEST_GNSS_POS, Kind.BEST_POS, Kind.BEST_NAV, *INERTIAL),
)
READ = tuple({*READ_FOR_POSITIONS, *READ_FOR_HEADINGS, *READ_FOR_SPEEDS, *READ_FOR_DATES, Kind.GST})
"""What the reader takes; the rest is passed over."""
UNTIMED = tuple(kind for kind in READ if LAYOUTS[kind].time is None)
