"""Mutations that know what a log looks like: lines, fields and numbers of text; lengths and numbers of binary files."""

from __future__ import annotations

import contextlib
import re
import struct
from random import Random

from fuzz.seeds import with_checksum

_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?")
_VALUES = (
    b"nan", b"inf", b"-inf", b"1e300", b"-1e300", b"1e-300", b"", b"-1", b"0", b"0.0", b"1", b"90", b"91", b"-90.0001",
    b"180", b"360", b"361", b"1e9", b"1e17", b"9007199254740993", b"9223372036854775807", b"9223372036854775808",
    b"-9223372036854775808", b"-9223372036854775809", b"18446744073709551615", b"18446744073709551616", b"1e19",
    b"4294967295", b"65535", b"x", b'"1"', b"#", b"?", b"\xff", b"True", b"1,5", b"0x10", b"1_0",
    b"99999999999999999999", b"9060.0000", b"18000.1",
    b"0.00000000000000000001", b"99999999999999999999.9", b"246060.99", b"240000",
)  # fmt: skip
_WORDS = tuple(
    struct.pack("<Q", value) for value in (0, 1, 2**31, 2**32 - 1, 2**63 - 1, 2**63, 2**64 - 1, 10**18)
) + tuple(struct.pack("<d", value) for value in (float("nan"), float("inf"), -0.0, 1e300, 5e-324, 91.0, 1e9, -1e18))


def mutated_text(data: bytes, random: Random) -> bytes:
    """A text with one to four mutations of its numbers, fields and lines."""
    lines = data.split(b"\n")
    for _ in range(random.randint(1, 4)):
        _CHANGES[random.randrange(len(_CHANGES))](lines, random)
    return b"\n".join(lines)


def mutated_nmea(data: bytes, random: Random) -> bytes:
    """The same for sentences, most of which get their right checksum again."""
    lines = mutated_text(data, random).split(b"\n")
    for i, line in enumerate(lines):
        head, dollar, rest = line.partition(b"$")
        if dollar and random.random() < 0.95:
            lines[i] = head + with_checksum(dollar + rest.rstrip(b"\r")) + b"\r"
    return b"\n".join(lines)


def mutated_binary(data: bytes, random: Random) -> bytes:
    """A binary file with some words overwritten, bytes inserted, left out or repeated."""
    raw = bytearray(data)
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(raw) + 1)
        size = random.choice((1, 2, 4, 8, 8, 8, 64, 500))
        change = random.randrange(6)
        if change <= 1:
            width = random.choice((1, 2, 4, 8))
            raw[at : at + width] = random.choice(_WORDS)[:width]
        elif change == 2:
            raw[at : at + 1] = bytes([random.randrange(256)])
        elif change == 3:
            del raw[at : at + size]
        elif change == 4:
            other = random.randrange(len(raw) + 1)
            raw[at:at] = raw[other : other + size]
        else:
            other = random.randrange(len(raw) + 1)
            raw[at : at + size] = raw[other : other + size]
    return bytes(raw)


def _number(lines: list[bytes], random: Random) -> None:
    i = random.randrange(len(lines))
    found = list(_NUMBER.finditer(lines[i]))
    if found:
        one = random.choice(found)
        lines[i] = lines[i][: one.start()] + random.choice(_VALUES) + lines[i][one.end() :]


def _field(lines: list[bytes], random: Random) -> None:
    i = random.randrange(len(lines))
    fields = lines[i].split(b",")
    j = random.randrange(len(fields))
    change = random.randrange(4)
    if change == 0:
        fields[j] = random.choice(_VALUES)
    elif change == 1:
        del fields[j]
    elif change == 2:
        fields.insert(j, random.choice((*fields, *_VALUES)))
    else:
        k = random.randrange(len(fields))
        fields[j], fields[k] = fields[k], fields[j]
    lines[i] = b",".join(fields)


def _column(lines: list[bytes], random: Random) -> None:
    """One column of all lines from some line on takes one value, or is scaled."""
    first, j = random.randrange(len(lines)), random.randrange(6)
    value, scale = random.choice(_VALUES), random.choice((0.0, -1.0, 1e3, 1e9, 1e-6, 1e15, 1e30))
    for i in range(max(first, 1), len(lines)):
        fields = lines[i].split(b",")
        if j < len(fields):
            if random.random() < 0.5:
                with contextlib.suppress(ValueError):
                    value = b"%r" % (float(fields[j]) * scale)
            fields[j] = value
            lines[i] = b",".join(fields)


def _digit(lines: list[bytes], random: Random) -> None:
    i = random.randrange(len(lines))
    line = bytearray(lines[i])
    if line:
        j = random.randrange(len(line))
        line[j : j + random.randrange(2)] = bytes([random.choice(b"0123456789.,-+eE $*\"';#\t\r\0\xff")])
        lines[i] = bytes(line)


def _order(lines: list[bytes], random: Random) -> None:
    a, b = sorted((random.randrange(len(lines)), random.randrange(len(lines))))
    change = random.randrange(5)
    if change == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif change == 1:
        lines[a:b] = reversed(lines[a:b])
    elif change == 2:
        del lines[a : min(b, a + 5)]
    elif change == 3:
        lines[a:a] = lines[a:b][:50]
    else:
        lines[a:a] = [lines[b]] * random.choice((1, 2, 30))
    if not lines:
        lines.append(b"")


_CHANGES = (_number, _number, _field, _column, _digit, _order, _order)


def mutator_of(reader: str, text: bool):  # type: ignore[no-untyped-def]
    """The mutation for a reader: bytes and a Random to bytes."""
    if not text:
        return mutated_binary
    if reader in ("nmea", "nmea_heading"):
        return mutated_nmea
    return lambda data, random: (mutated_nmea if data.startswith(b"gnss.nmea\n") else mutated_text)(data, random)
