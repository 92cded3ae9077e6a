"""Decimals are read with the digits that they have, and written back the same."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sccal.logs.decimals import PAD, Digits, read_digits, write_decimals

PLAIN = re.compile(r"([-+]?)([0-9]*)(\.?)([0-9]*)")
FIELDS = st.one_of(
    st.from_regex(r"\A[-+]?[0-9]{0,10}\.?[0-9]{0,10}\Z"),
    st.text("0123456789.+-eE ,x", max_size=25),
)


def read(texts: list[str]) -> Digits:
    """All fields of one buffer, a comma after each."""
    length = np.array([len(text) for text in texts], dtype=np.int64)
    end = np.cumsum(length + 1) - 1
    data = np.frombuffer((",".join(texts) + ",").encode() + bytes(PAD), dtype=np.uint8)
    return read_digits(data, end - length, end)


@given(st.lists(FIELDS, min_size=1, max_size=40))
def test_each_part_of_a_number_is_told(texts):
    found = read(texts)
    for i, text in enumerate(texts):
        match = PLAIN.fullmatch(text)
        good = match is not None and 0 < len(match[2]) + len(match[4]) <= 18
        assert bool(found.good[i]) == good
        if match is None or not good:
            assert np.isnan(found.values[i])
            assert not any((found.mantissa[i], found.whole[i], found.places[i], found.dotted[i], found.negative[i]))
            continue
        assert found.mantissa[i] == int(match[2] + match[4])
        assert (found.whole[i], found.places[i]) == (len(match[2]), len(match[4]))
        assert (bool(found.negative[i]), bool(found.dotted[i])) == (match[1] == "-", match[3] == ".")
        assert found.values[i] == float(text)


@given(st.lists(st.from_regex(r"\A-?[0-9]{1,9}(\.[0-9]{0,9})?\Z"), min_size=1, max_size=40))
def test_what_is_read_is_written_the_same(texts):
    found = read(texts)
    rows = write_decimals(found.mantissa, found.negative, found.whole, found.places, found.dotted)
    again = [row.tobytes().rstrip(b"\0").decode() for row in rows]
    assert again == [text.removeprefix("-") if float(text) == 0 else text for text in texts]
