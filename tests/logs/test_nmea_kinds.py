"""The table of sentences: what a row writes it reads, and no field of a row means two things."""

from __future__ import annotations

import pytest

from sccal.logs.nmea.kinds import LAYOUTS, LONG, NO_FIX, PLACED, READ, Kind, Position
from sccal.logs.nmea.sentences import find_sentences
from tests.degrade.logs import NOON, every_kind

BETTER = {4: 0, 8: 0, 5: 1, 2: 2, 9: 2, 3: 2, 1: 3, -1: 3, 7: 4, 6: 4, 0: 5}
"""GGA qualities, those with the smaller errors first; what is no measurement last."""

each_placed = pytest.mark.parametrize("kind", PLACED, ids=lambda kind: kind.name)


def position_of(kind: Kind) -> Position:
    position = LAYOUTS[kind].position
    assert position is not None
    return position


@each_placed
def test_what_is_written_is_read_as_no_better(kind):
    claim = position_of(kind).claim
    assert sorted(claim.written) == list(range(10))
    for quality, text in claim.written.items():
        if text:
            read = claim.read[text]
            assert BETTER[read] >= min(BETTER[quality], BETTER[1]), (quality, text, read)


@each_placed
def test_a_fix_that_is_written_as_lost_is_none(kind):
    fields = position_of(kind)
    lost = dict(fields.lost)
    emptied = fields.quality in fields.emptied
    voided = fields.status is not None and lost.get(fields.status) == "V"
    letters = fields.claim.form == "letters" and fields.claim.written[NO_FIX] == "N"
    assert emptied or voided or letters or fields.claim.read[lost[fields.quality]] == NO_FIX


@pytest.mark.parametrize("kind", LAYOUTS, ids=lambda kind: kind.name)
def test_a_field_means_one_thing(kind):
    layout = LAYOUTS[kind]
    fields = [
        layout.time,
        *(layout.date.fields if layout.date and layout.date.form not in ("stamp", "week,s", "week,ms") else ()),
    ]
    if layout.position is not None:
        one = layout.position
        sides = () if one.in_degrees else (one.latitude + 1, one.longitude + 1)
        fields += [one.latitude, one.longitude, *sides, one.quality, one.status, one.altitude_m, one.separation_m]
        fields += [one.hdop, one.accuracy_m, *(one.from_base_m or ())]
        kept = {one.latitude, one.longitude, *sides, layout.time}
        assert not kept & {*one.emptied, *dict(one.lost)}
        assert not set(one.emptied) & set(dict(one.lost))
    if layout.speed is not None:
        fields += [layout.speed.knots, layout.speed.kmph]
    if layout.heading is not None:
        fields += [layout.heading.yaw, layout.heading.pitch, layout.heading.roll, layout.heading.sigma]
    there = [field for field in fields if field is not None]
    assert len(there) == len(set(there))
    assert min(there) >= 1


def test_every_row_is_found_by_its_name():
    placed = find_sentences("\n".join(every_kind(NOON, 52.1, 5.3)).encode()).kind.tolist()
    assert [LAYOUTS[Kind(kind)].name for kind in placed] == [
        "GGA", "RMC", "GNS", "GLL", "PTNL,GGK", "KSXT", "PUBX,00", "PASHR,POS",
    ]  # fmt: skip
    rest = set(Kind) - {Kind.OTHER, *(Kind(kind) for kind in placed)}
    for kind in rest:
        name = LAYOUTS[kind].name
        head = "#" if kind in LONG else "$" if name.startswith("P") else "$GN"
        text = f"{head}{name},120000.00,,,,,,,,,,,,"
        assert find_sentences(text.encode()).kind.tolist() == [kind]
    assert set(LAYOUTS) == set(Kind) - {Kind.OTHER}
    assert set(READ) < set(LAYOUTS)
