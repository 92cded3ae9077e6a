"""NMEA 0183 sentences in a byte buffer: found, checked and cut into fields with array operations.

A sentence runs from ``$`` (a long message from ``#``) to a line end or the next ``$``; anything else between (binary
messages, prompts) is passed over. Only the places of the bytes ``$ , * \\r \\n`` are looked at; fields are read when
they are asked for.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sccal.arrays import Bools, Floats, Ints
from sccal.logs.decimals import PAD, Bytes, Decimals, Words, parse_decimals, read_decimals, words_of
from sccal.logs.limits import TIME_LIMIT_S
from sccal.logs.nmea.kinds import LAYOUTS, LONG, OF_SECOND_ANTENNA, Kind

Kinds = NDArray[np.uint8]

_LONGEST_SENTENCE = 512
_SHORTEST_SENTENCE = 7
"""``$KSXT,`` and its like; what is shorter is not even counted, so that no file holds more of them than bytes by 7."""
_ALL = slice(None)
_LONGEST_PREFIX = 64
_PIECE = 2**17
_HEX = np.full(256, 255, dtype=np.uint8)
_HEX[np.frombuffer(b"0123456789ABCDEF", dtype=np.uint8)] = np.arange(16)
_HEX[np.frombuffer(b"abcdef", dtype=np.uint8)] = np.arange(10, 16)
_BETWEEN = np.isin(np.arange(256), np.frombuffer(b" \t\r,;:|=>])}\"'", dtype=np.uint8))
_BEFORE = np.isin(np.arange(256), np.frombuffer(b" \t\r<[({\"'", dtype=np.uint8))


def _word(text: bytes) -> np.uint64:
    return np.uint64(int.from_bytes(text, "little"))


def _pattern(text: bytes) -> tuple[np.uint64, np.uint64]:
    """Eight bytes to compare with, and the mask that first makes letters upper case and later bytes zero."""
    return _word(text), _word(bytes(0xDF if 65 <= letter <= 90 else 0xFF for letter in text))


_SMALL = np.uint64(0x6060606060)
_UPPER = np.uint64(0xDFDFDFDFDFDFDFDF)
_FORMATTERS = {_word(layout.name.encode()): kind for kind, layout in LAYOUTS.items() if len(layout.name) == 3}
_OF_MAKERS = [
    *((kind, one.name) for kind, one in LAYOUTS.items() if kind not in OF_SECOND_ANTENNA and len(one.name) > 3),
    (Kind.GGK, "PTNLGGK"),
    (Kind.HEADING, "HEADING2"),
]
"""Kinds and names of sentences whose address begins with no talker, and what else they are called."""
_NAMES = [(kind, _pattern(f"{name},".encode()[:8])) for kind, name in _OF_MAKERS if "," not in name]
_NAMED_AFTER = [
    (_pattern(f"{maker},".encode()), kind, _pattern(f"{own},".encode()))
    for kind, name in _OF_MAKERS
    for maker, comma, own in (name.partition(","),)
    if comma and len(maker) == 4
]
"""Makers' addresses of four letters, and the names of sentences in the field after them."""
_ASHTECH_NAMES = {Kind.PASHR_POS: _pattern(b"POS,"), Kind.PASHR_ATT: _pattern(b"ATT,")}
"""In the field after the address ``$PASHR``."""
_LONG_NAMES = (b"HEADINGA,", b"HEADING2A,", *(f"#{LAYOUTS[kind].name},".encode() for kind in LONG))
"""Of long messages; where none is in a file, ``#`` and ``;`` part nothing."""
_REST = {Kind.BEST_GNSS_POS: _pattern(b"POSA,")}
"""What follows the first eight letters of names that begin as others do."""
_TALKER_BITS = np.uint64(16)
_LONG_ADDRESSES = {kind: _pattern(f"{first.name}H,".encode()) for kind, first in OF_SECOND_ANTENNA.items()}
"""After the talker."""
LONG_CHECKSUM_DIGITS = 8


@dataclass(frozen=True)
class Sentences:
    """All sentences of a buffer, in file order; arrays of length n unless said otherwise."""

    data: Bytes
    """The buffer, padded with zeros at its end."""
    start: Ints
    """Place of the ``$``."""
    stop: Ints
    """Place after the last field: of the ``*``, or of the sentence's end."""
    kind: Kinds
    """Of Kind."""
    talker: NDArray[np.uint16]
    """The two letters before the formatter, upper case, as one number (see talker_name); 0 for proprietary ones."""
    has_checksum: Bools
    right_checksum: Bools
    long_checksum: Bools
    """True where a right CRC-32 of 8 digits stands instead of two digits."""
    complete: Bools
    """False where the sentence is cut: by the next ``$`` or the end of the file."""
    line: Ints
    host_t_s: Floats
    """Time before the first ``$`` of the line; NaN where there is none."""
    odd_prefix: Bools
    """True for the first sentence of a line that begins with something other than a number of seconds."""
    marks: Ints
    """Places of all bytes that part fields or sentences (any length), and twice the file's size at the end."""
    first_mark: Ints
    """Index into ``marks`` of each sentence's comma before field 1."""
    fields: Ints
    """How many fields follow the address; 0 where the sentence is longer than any."""

    def take(self, rows: Ints) -> Sentences:
        """Only the sentences at the indices ``rows``."""
        return Sentences(
            self.data,
            self.start[rows],
            self.stop[rows],
            self.kind[rows],
            self.talker[rows],
            self.has_checksum[rows],
            self.right_checksum[rows],
            self.long_checksum[rows],
            self.complete[rows],
            self.line[rows],
            self.host_t_s[rows],
            self.odd_prefix[rows],
            self.marks,
            self.first_mark[rows],
            self.fields[rows],
        )

    def number(self, field: int) -> Floats:
        """Field ``field`` (from 1) as a number; NaN where it is empty, missing or not a plain decimal."""
        begin, end = self.span(field)
        return parse_decimals(self.data, begin, end)

    def decimals(self, field: int) -> Decimals:
        """Field ``field`` (from 1) as a whole number over a power of ten."""
        begin, end = self.span(field)
        return read_decimals(self.data, begin, end)

    def letter(self, field: int) -> Bytes:
        """The only byte of field ``field`` (from 1), upper case; 0 where the field has not one byte."""
        begin, end = self.span(field)
        letters = _upper(self.data[begin])
        return np.where(end - begin == 1, letters, 0).astype(np.uint8)

    def letters(self, field: int, most: int) -> Bytes:
        """The first ``most`` bytes of field ``field`` (from 1), upper case, (n, most); 0 after the field's end."""
        begin, end = self.span(field)
        place = np.minimum(begin[:, None] + np.arange(most), self.data.size - 1)
        return np.where(place < end[:, None], _upper(self.data[place]), 0).astype(np.uint8)

    def span(self, field: int, rows: Ints | slice = _ALL) -> tuple[Ints, Ints]:
        """Where field ``field`` (from 1) begins and ends in the buffer; empty where the sentence has not that many.

        Of the sentences at ``rows``, or of all.
        """
        mark = self.first_mark[rows] + (field - 1)
        short = self.fields[rows] < field
        if not short.any():
            return self.marks[mark] + 1, self.marks[mark + 1]
        mark, stop = np.where(short, 0, mark), self.stop[rows]
        return np.where(short, stop, self.marks[mark] + 1), np.where(short, stop, self.marks[mark + 1])


def kinds_in(kind: Kinds, wanted: Sequence[Kind]) -> Bools:
    """True where ``kind`` is one of ``wanted``."""
    table = np.zeros(256, dtype=np.bool_)
    table[list(wanted)] = True
    return table[kind]


def talker_name(talker: int) -> str:
    """The two letters of a talker; empty for proprietary sentences."""
    return bytes((talker & 255, talker >> 8)).decode("latin-1") if talker else ""


def find_sentences(raw: bytes) -> Sentences:
    """Find every sentence of a file's bytes."""
    size = len(raw)
    data = np.frombuffer(raw + bytes(PAD), dtype=np.uint8)
    body = data[:size]
    long_ones = b"#" in raw and any(name in raw for name in _LONG_NAMES)
    marks = np.concatenate((*_marks(body, b"*$\r\n#;" if long_ones else b"*$\r\n"), (size, size)))
    mark_byte = data[marks]
    major = np.flatnonzero((mark_byte != ord(",")) & (mark_byte != ord(";")) if long_ones else mark_byte != ord(","))
    byte = mark_byte[major]
    begins = (byte == ord("$")) | (byte == ord("#")) if long_ones else byte == ord("$")
    dollar = np.flatnonzero(begins[:-1])
    dollar = dollar[marks[major[dollar + 1]] - marks[major[dollar]] >= _SHORTEST_SENTENCE]
    start = marks[major[dollar]]
    starred = byte[dollar + 1] == ord("*")
    mark_of_stop = major[dollar + 1]
    stop = marks[mark_of_stop]
    end_index = np.minimum(dollar + 1 + starred, major.size - 1)
    end = marks[major[end_index]]
    complete = (end < size) & ~begins[end_index]
    end = np.minimum(end, start + _LONGEST_SENTENCE)
    star = np.where(starred, stop, size)
    stop = np.minimum(stop, end)

    words = words_of(data)
    kind, talker, shift = _kinds(words, start, stop)
    high, low = _HEX[data[np.minimum(star + 1, size)]], _HEX[data[np.minimum(star + 2, size)]]
    has_checksum = (star + 2 < end) & (high < 16) & (low < 16)
    right = has_checksum & (_sums(data, start, stop) == high * 16 + low) & (stop > start + 1)
    may_be_long = kinds_in(kind, (Kind.KSXT, *LONG)) | (data[start] == ord("#"))
    long = has_checksum & may_be_long & (star + LONG_CHECKSUM_DIGITS < end)
    long &= _with_long_checksum(raw, long & (_HEX[data[np.minimum(star + 3, size)]] < 16), start, star)
    right |= long
    folded = np.flatnonzero(has_checksum & ~right & all_lower(words, start))
    if folded.size:
        right[folded] = _sums(_upper(data), start[folded], stop[folded]) == high[folded] * 16 + low[folded]

    newline = byte == (ord("\n") if b"\n" in raw else ord("\r"))
    line = np.cumsum(newline)[dollar] + 1
    line_begin = np.maximum.accumulate(np.where(newline, marks[major] + 1, 0))[dollar]
    host_t_s, odd_prefix = _host_times(data, start, line, line_begin)
    first_mark = major[dollar] + 1 + shift
    return Sentences(
        data=data,
        start=start,
        stop=stop,
        kind=_with_pashr_told_apart(data, marks, first_mark, kind),
        talker=talker,
        has_checksum=has_checksum,
        right_checksum=right,
        long_checksum=long,
        complete=complete | has_checksum,
        line=line,
        host_t_s=host_t_s,
        odd_prefix=odd_prefix,
        marks=marks,
        first_mark=first_mark,
        fields=np.where(marks[mark_of_stop] > stop, 0, np.maximum(mark_of_stop - first_mark, 0)),
    )


def all_lower(words: Words, start: Ints) -> Bools:
    """Where a program has written the whole address in lower case; its checksum is that of capital letters."""
    lower: Bools = (words[start + 1] & _SMALL) == _SMALL
    return lower


def names_of(found: Sentences, rows: Bools) -> list[tuple[str, int]]:
    """What the sentences at ``rows`` (n) call themselves, and how many there are of each, the most first."""
    heads, counts = np.unique(words_of(found.data)[found.start[rows] + 1], return_counts=True)
    named: Counter[str] = Counter()
    for head, count in zip(heads.tolist(), counts.tolist(), strict=True):
        named[_name_in(head.to_bytes(8, "little").decode("latin-1").upper())] += count
    return named.most_common()


def _name_in(head: str) -> str:
    """The name in the first eight letters of a sentence; a maker's own with what follows it."""
    address, _, rest = head.partition(",")
    if address.startswith("P"):
        after = rest.partition(",")[0]
        return f"{address},{after}" if address and "," in rest and after.isalnum() else address
    usual = len(address) == 5 and address.isalpha()
    return address[2:] if usual else "".join(letter if letter.isprintable() else "?" for letter in address)


def formatters(found: Sentences) -> NDArray[np.bytes_]:
    """The three letters after the talker (n,), upper case; empty for what is not a five-letter address."""
    address = found.data[found.start[:, None] + np.arange(1, 7)]
    lower = (address >= 97) & (address <= 122)
    address = np.where(lower, address - 32, address).astype(np.uint8)
    letters = ((address[:, :5] >= 65) & (address[:, :5] <= 90)).all(axis=1)
    usual = letters & (address[:, 5] == ord(",")) & (address[:, 0] != ord("P")) & (found.start + 6 < found.stop)
    kinds = np.ascontiguousarray(address[:, 2:5]).view("S3").ravel()
    return np.where(usual, kinds, b"").astype("S3")


def _marks(body: Bytes, others: bytes) -> Iterator[Ints]:
    """Places of commas and of other bytes that part fields or sentences, in pieces that stay in a cache."""
    marked, same = np.empty(_PIECE, dtype=np.bool_), np.empty(_PIECE, dtype=np.bool_)
    for begin in range(0, body.size, _PIECE):
        piece = body[begin : begin + _PIECE]
        found = np.equal(piece, ord(","), out=marked[: piece.size])
        for byte in others:
            found |= np.equal(piece, byte, out=same[: piece.size])
        yield np.flatnonzero(found) + begin


def _upper(letters: Bytes) -> Bytes:
    return np.where((letters >= 97) & (letters <= 122), letters - np.uint8(32), letters)


def _kinds(words: Words, start: Ints, stop: Ints) -> tuple[Kinds, NDArray[np.uint16], Ints]:
    """Kind and talker of each sentence, and by how many fields its first one stands later than after the address."""
    address = words[start + 1]
    folded = address & _UPPER
    sixth = (address >> np.uint64(40)) & np.uint64(255)
    letters = folded & np.uint64(0xFFFF)
    first, second = letters & np.uint64(255), letters >> np.uint64(8)
    talks = (first >= 65) & (first <= 90) & (second >= 65) & (second <= 90) & (first != ord("P"))
    usual = talks & (sixth == ord(",")) & (start + 6 < stop)
    formatter = (folded >> np.uint64(16)) & np.uint64(0xFFFFFF)
    kind = np.zeros(start.size, dtype=np.uint8)
    for text, value in _FORMATTERS.items():
        kind[usual & (formatter == text)] = value
    talker = np.where(usual, letters, 0).astype(np.uint16)
    shift = np.zeros(start.size, dtype=np.int64)
    own = np.flatnonzero(~usual & (start + 6 < stop))
    if own.size:
        named = address[own]
        for name, pattern in _NAMES:
            hit = _reads(named, pattern)
            if name in _REST:
                hit &= _reads(words[start[own] + 9], _REST[name])
            if hit.any():
                kind[own[hit]] = name
                own, named = own[~hit], named[~hit]
            if not own.size:
                return kind, talker, shift
        for maker, name, pattern in _NAMED_AFTER:
            made = own[_reads(address[own], maker)]
            rows = made[_reads(words[start[made] + 6], pattern)]
            kind[rows], shift[rows] = name, 1
        for name, pattern in _LONG_ADDRESSES.items():
            kind[own[_reads(address[own] >> _TALKER_BITS, pattern)]] = name
    return kind, talker, shift


def _reads(words: Words, pattern: tuple[np.uint64, np.uint64]) -> Bools:
    text, mask = pattern
    same: Bools = (words & mask) == text
    return same


def _sums(data: Bytes, start: Ints, stop: Ints) -> Bytes:
    """Exclusive or of the bytes between ``$`` and stop."""
    if start.size == 0:
        return np.empty(0, dtype=np.uint8)
    bounds = np.column_stack((start + 1, np.maximum(stop, start + 2))).ravel()
    return np.asarray(np.bitwise_xor.reduceat(data, bounds)[::2])


def crc_32(text: bytes) -> int:
    """The CRC that starts from zero and is not inverted at its end, as in NovAtel's logs."""
    return zlib.crc32(text, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _with_long_checksum(raw: bytes, may: Bools, start: Ints, star: Ints) -> Bools:
    """True where a sentence ends in the eight digits of a right CRC-32 instead of two."""
    right = np.zeros(may.size, dtype=np.bool_)
    for row in np.flatnonzero(may).tolist():
        try:
            stated = int(raw[star[row] + 1 : star[row] + 1 + LONG_CHECKSUM_DIGITS], 16)
        except ValueError:
            continue
        right[row] = crc_32(raw[start[row] + 1 : star[row]]) == stated
    return right


def _with_pashr_told_apart(data: Bytes, marks: Ints, first_mark: Ints, kind: Kinds) -> Kinds:
    """PASHR that begins with a time is attitude; Ashtech receivers write other things under a name in its place."""
    rows = np.flatnonzero(kind == Kind.PASHR)
    begin = marks[first_mark[rows]] + 1
    initial = _upper(data[begin])
    named = (initial >= 65) & (initial <= 90)
    kind[rows[named]] = Kind.OTHER
    for name, pattern in _ASHTECH_NAMES.items():
        kind[rows[named & _reads(words_of(data)[begin], pattern)]] = name
    return kind


def _host_times(data: Bytes, start: Ints, line: Ints, line_begin: Ints) -> tuple[Floats, Bools]:
    """The number before the first ``$`` of each sentence's line, and first sentences with anything else there."""
    if start.size == 0:
        return np.empty(0), np.empty(0, dtype=np.bool_)
    first_of_line = np.concatenate(([True], np.diff(line) > 0))
    own = np.flatnonzero(first_of_line)
    end, begin = start[own], line_begin[own]
    near = end - begin <= _LONGEST_PREFIX
    begin = np.where(near, begin, end)
    for _ in range(4):
        loose = _BETWEEN[data[np.maximum(end - 1, 0)]] & (end > begin)
        if not loose.any():
            break
        end = end - loose
    for _ in range(3):
        loose = _BEFORE[data[begin]] & (begin < end)
        if not loose.any():
            break
        begin = begin + loose
    times = parse_decimals(data, begin, end)
    times[np.abs(times) > TIME_LIMIT_S] = np.nan
    odd = np.zeros(start.size, dtype=np.bool_)
    odd[own] = np.isnan(times) & ((end > begin) | ~near)
    return times[np.cumsum(first_of_line) - 1], odd
