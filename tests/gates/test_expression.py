"""The language of --gate: what is right is read as meant, what is wrong is told with its place."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.errors import UsageError
from sccal.gates.expression import OPERATORS, parse_gate, parse_gates, require_effects
from sccal.gates.names import FIXED, OPEN, SINGLE, look_up, single_values, why_impossible
from tests.report.conftest import run
from tests.results.documents import calibration

NAMES = ("outage.percent_of_distance", "parameters.track_m.sigma", "fit.nis_gnss", "effects.heading~a.b.c", "verdict")
blanks = st.text(" \t", max_size=3)


@given(
    st.sampled_from(NAMES),
    st.sampled_from(sorted(OPERATORS)),
    st.floats(allow_nan=False, allow_infinity=False),
    st.booleans(),
    st.lists(blanks, min_size=5, max_size=5),
)
def test_what_is_written_is_read(name, sign, threshold, of_vehicle, gaps):
    prefix = "vehicle:" if of_vehicle else ""
    gate = parse_gate(f"{gaps[0]}{prefix}{gaps[1]}{name}{gaps[2]}{sign}{gaps[3]}{threshold!r}{gaps[4]}")
    assert (gate.of_vehicle, gate.name, gate.sign, gate.threshold) == (of_vehicle, name, sign, threshold)


@given(st.lists(st.sampled_from((*"<>=!.:019ef_-+ \x00é", "verdict", "fit.nis_gnss", "vehicle:"))).map("".join))
def test_whatever_is_written_is_read_or_refused_in_one_line(text):
    try:
        gate = parse_gate(text)
    except UsageError as error:
        told = re.match(r'--gate ".*", character (\d+): .', str(error))
        place = int(told.group(1)) if told else 0
    else:
        place = 1
        assert parse_gate(gate.text) == gate
    assert 1 <= place <= len(text) + 1


@pytest.mark.parametrize(
    ("text", "character", "says"),
    [
        ("", 1, "no operator"),
        ("outage.percent_of_distance", 27, "no operator"),
        ("fit.nis_gnss<", 14, "nothing after <"),
        ("<3", 1, "no name before <"),
        ("vehicle:<3", 9, "no name"),
        ("verdict=good", 8, "write =="),
        ("fit.nis_gnss=<3", 13, "write <="),
        ("0.1<fit.nis_gnss<3", 17, "two gates"),
        ("3>fit.nis_gnss", 1, "the name comes first"),
        ("verdict<good", 9, "only be compared by =="),
        ("parameters.track_m<750mm", 20, "no units"),
        ("fit.nis_gnss<1e999", 14, "too large"),
        ("fit.nis_gnss<nan", 14, "no number"),
        ("  parameters.trak_m<3", 3, "did you mean parameters.track_m"),
        ("nis_gnss<3", 1, "did you mean fit.nis_gnss"),
        ("outage.percent<3", 1, "outage.percent_of_distance"),
        ("outage<3", 1, "try outage."),
        ("bogus.name<3", 1, "names begin with"),
        ("vehicle:verdct==good", 9, "did you mean verdict"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(text, character, says):
    with pytest.raises(UsageError, match=re.escape(says)) as caught:
        parse_gate(text)
    assert f"character {character}:" in str(caught.value)


def test_doubles_are_judged_once_in_the_order_asked_for():
    gates = parse_gates(["verdict==good", "fit.nis_gnss<3", " verdict==good "])
    assert [gate.name for gate in gates] == ["verdict", "fit.nis_gnss"]


def test_an_effect_must_have_been_asked_for():
    gates = parse_gates(["effects.lever_arm.forward_m.sigma<0.05"])
    require_effects(gates, ("lever_arm",))
    with pytest.raises(UsageError, match="--effects lever_arm"):
        require_effects(gates, ("soft_iron",))


def test_every_name_of_a_document_may_stand_in_a_gate():
    """The names known beforehand must not refuse what calibration.json has."""
    from sccal.results.converter import document_of

    document = document_of(run())
    for name in set(single_values(document)) - set(OPEN):
        assert why_impossible(name) == "", name
    for block, keys in FIXED.items():
        for key in keys:
            look_up(document, f"{block}.{key}")
    for name in set(SINGLE) - {"consistency_chi2_per_dof"}:
        look_up(document, name)


def test_names_with_dots_are_found_by_what_the_document_holds():
    document = calibration()
    document["effects"] = {"heading~bms.cell.v": {"deg": {"value": 1.5, "sigma": 0.1, "status": "estimated"}}}
    assert look_up(document, "effects.heading~bms.cell.v.deg").value == 1.5
    assert look_up(document, "effects.heading~bms.cell.v.deg.sigma").value == 0.1
