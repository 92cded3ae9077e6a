"""Where each kind of NMEA sentence holds a position and what goes with it.

Fields are counted from 1 after the address, $PTNL's after the name that follows it.

GGA, RMC, GNS and GLL after IEC 61162-1; $PTNL,GGK after Trimble's NMEA-0183 message descriptions; $PUBX,00 after the
u-blox M8 protocol specification; $KSXT after the Unicore reference commands (decimal degrees, and east, north, up from
the base); $PASHR,POS after Ashtech's. Unicore's second antenna sends the usual sentences with an H at the end of the
address.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Ints
from sccal.degrade.quality import MODE_LETTERS
from sccal.logs.nmea.positions import KIND_NAMES, POSITION_KINDS
from sccal.logs.nmea.sentences import Kind, Sentences

Claim = Literal["gga", "mode", "modes", "ggk", "ksxt", "pashr", "pubx"]

CLAIMS: dict[str, dict[int, str]] = {
    "gga": {code: str(code) for code in range(10)},
    "mode": MODE_LETTERS,
    "modes": MODE_LETTERS,
    "ggk": {0: "0", 1: "1", 2: "4", 3: "4", 4: "3", 5: "2", 6: "1", 7: "1", 8: "3", 9: "4"},
    "ksxt": {0: "0", 1: "1", 2: "1", 3: "1", 4: "3", 5: "2", 6: "1", 7: "1", 8: "3", 9: "1"},
    "pashr": {0: "", 1: "0", 2: "1", 3: "0", 4: "3", 5: "2", 6: "0", 7: "0", 8: "3", 9: "1"},
    "pubx": {0: "NF", 1: "G3", 2: "D3", 3: "G3", 4: "D3", 5: "D3", 6: "DR", 7: "G3", 8: "G3", 9: "D3"},
}
"""How each way of stating the quality writes a GGA quality."""
READ_AS: dict[str, dict[str, int]] = {
    "mode": {"N": 0, "A": 1, "D": 2, "P": 3, "R": 4, "F": 5, "E": 6, "M": 7, "S": 8},
    "pashr": {"0": 1, "1": 2, "2": 5, "3": 4},
    "pubx": {"NF": 0, "DR": 6, "G2": 1, "G3": 1, "D2": 2, "D3": 2, "RK": 6, "TT": 0},
}
"""And how it is read back, where ``sccal.logs`` does not read it."""


@dataclass(frozen=True)
class Layout:
    """One kind of sentence."""

    name: str
    time: int
    latitude: int
    longitude: int
    claim: Claim
    quality: int
    emptied: tuple[int, ...]
    """What a receiver without a fix leaves empty, besides the position."""
    lost: tuple[tuple[int, str], ...]
    """What it writes instead of other fields."""
    fewest: int
    """Fields below which a sentence without a checksum is not whole."""
    in_degrees: bool = False
    """Signed decimal degrees; else degrees and minutes, with the hemisphere in the field after."""
    status: int | None = None
    """Field that is A with a fix and V without."""
    hdop: int | None = None
    accuracy: int | None = None
    """Field with the receiver's own error estimate, m."""
    from_base: tuple[int, int] | None = None
    """Fields with the position east and north of the base, m."""

    @property
    def read_as(self) -> Kind | None:
        """The kind as which ``sccal.logs`` reads positions out of it, if it does."""
        return next((kind for kind in POSITION_KINDS if KIND_NAMES[kind] == self.name), None)


LAYOUTS = (
    Layout("GGA", 1, 2, 4, "gga", 6, (9, 10, 11, 12, 13, 14), ((6, "0"), (7, "00"), (8, "99.99")), 13, hdop=8),
    Layout("RMC", 1, 3, 5, "mode", 12, (7, 8, 10, 11), ((2, "V"), (12, "N")), 9, status=2),
    Layout("GNS", 1, 2, 4, "modes", 6, (9, 10, 11, 12), ((7, "00"), (8, "99.99")), 10, hdop=8),
    Layout("GLL", 5, 1, 3, "mode", 7, (), ((6, "V"), (7, "N")), 5, status=6),
    Layout("PTNL,GGK", 1, 3, 5, "ggk", 7, (9, 10), ((7, "0"), (8, "00")), 10, hdop=9),
    Layout(
        name="KSXT",
        time=1,
        latitude=3,
        longitude=2,
        claim="ksxt",
        quality=10,
        emptied=(4, 7, 8, 14, 15, 16, 17, 18, 19),
        lost=((10, "0"),),
        fewest=11,
        in_degrees=True,
        from_base=(14, 15),
    ),
    Layout(
        name="PUBX,00",
        time=2,
        latitude=3,
        longitude=5,
        claim="pubx",
        quality=8,
        emptied=(7, 9, 10, 11, 12, 13, 14),
        lost=((8, "NF"), (15, "99.99"), (16, "99.99"), (17, "99.99"), (18, "0")),
        fewest=18,
        hdop=15,
        accuracy=9,
    ),
    Layout("PASHR,POS", 4, 5, 7, "pashr", 2, (2, 9, 11, 12, 13), ((3, "00"), (15, "99.99")), 16, hdop=15),
)
"""Best position first: where an epoch has several, the first of these says where the fix was."""
SECOND_ANTENNA = len(LAYOUTS)
"""Codes from here on are the first four layouts for the second antenna."""
NOT_A_POSITION = -1
_STANDARD = {b"GGA": 0, b"RMC": 1, b"GNS": 2, b"GLL": 3}
_PROPRIETARY = ((b"KSXT,", 5), (b"PUBX,00,", 6), (b"PASHR,POS,", 7))


def layout_of(code: int) -> Layout:
    """The layout of a code given by ``find_layouts``."""
    return LAYOUTS[code if code < SECOND_ANTENNA else code - SECOND_ANTENNA]


def find_layouts(found: Sentences) -> Ints:
    """For every sentence (n,) its code: the index of its layout, NOT_A_POSITION for others."""
    codes = np.full(found.start.size, NOT_A_POSITION, dtype=np.int64)
    formatter = formatters(found)
    for kind, code in _STANDARD.items():
        codes[formatter == kind] = code
    address = found.data[found.start[:, None] + np.arange(1, 3)] & 0xDF
    codes[found.kind == Kind.GGK] = 4
    for first, second in (b"KS", b"PU", b"PA"):
        for text, code in _PROPRIETARY:
            if text[0] == first and text[1] == second:
                rows = np.flatnonzero((address[:, 0] == first) & (address[:, 1] == second))
                codes[rows[_begins(found, rows, text)]] = code
    sixth = found.data[found.start + 6] & 0xDF
    rows = np.flatnonzero((sixth == ord("H")) & (found.data[np.minimum(found.start + 7, found.stop)] == ord(",")))
    for kind, code in _STANDARD.items():
        codes[rows[_begins(found, rows, kind + b"H,", 3)]] = SECOND_ANTENNA + code
    return codes


def formatters(found: Sentences) -> NDArray[np.bytes_]:
    """The three letters after the talker (n,), upper case; empty for what is not a five-letter address."""
    address = found.data[found.start[:, None] + np.arange(1, 7)]
    lower = (address >= 97) & (address <= 122)
    address = np.where(lower, address - 32, address).astype(np.uint8)
    letters = ((address[:, :5] >= 65) & (address[:, :5] <= 90)).all(axis=1)
    usual = letters & (address[:, 5] == ord(",")) & (address[:, 0] != ord("P")) & (found.start + 6 < found.stop)
    kinds = np.ascontiguousarray(address[:, 2:5]).view("S3").ravel()
    return np.where(usual, kinds, b"").astype("S3")


def _begins(found: Sentences, rows: Ints, text: bytes, at: int = 1) -> Bools:
    """Which of the sentences have ``text`` at that place after the ``$``, capitals or not."""
    same: Bools = np.ones(rows.size, dtype=np.bool_)
    for place, mark in enumerate(text):
        byte = found.data[found.start[rows] + at + place]
        small = (byte >= ord("a")) & (byte <= ord("z"))
        same &= np.where(small, byte - 32, byte) == mark
    whole: Bools = same & (found.start[rows] + at + len(text) <= found.stop[rows])
    return whole
