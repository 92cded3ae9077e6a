"""A few field cases: a log with nothing wrong, one that has to be refused with its reason, and the judge itself."""

from __future__ import annotations

from dataclasses import replace

import pytest

from studies.field.catalogue import CASES
from studies.field.commands import Said
from studies.field.judging import judge
from studies.field.study import case_of, chosen, report
from studies.field.wanted import Truth, doubted, refused, right


def test_there_are_known_and_further_cases_each_with_a_name_of_its_own():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    assert sum(case.part == "known" for case in CASES) >= 110
    assert sum(case.part == "further" for case in CASES) >= 45
    assert all(case.ways for case in CASES)


def test_cases_are_chosen_by_name_by_its_beginning_and_by_number():
    assert chosen(["0", "wheels-r"], "known") == [
        case.name for case in CASES if case.part == "known" and case.name.startswith((CASES[0].name, "wheels-r"))
    ]
    assert chosen(["wheels-rpm"], "") == ["wheels-rpm"]
    assert chosen(["wheels-rpm"], "further") == []


@pytest.mark.parametrize("name", ["control-2001", "counter-right-reversed"])
def test_cases_that_are_right_today_stay_right(tmp_path, name):
    mark = judge(case_of(name), tmp_path)
    assert mark.ok, mark.faults


def test_a_wrong_number_and_a_reason_that_is_not_told_are_faults(tmp_path):
    case = case_of("control-2001")

    def untrue(folder):
        truth = case.build(folder)
        return Truth(({**truth.readings[0], "track_m": truth.readings[0]["track_m"] * 1.1},))

    mark = judge(replace(case, build=untrue, ways=(right(2.0), doubted("mud"), refused("mud"))), tmp_path)
    assert not mark.ok
    assert any("track_m estimated" in fault for fault in mark.faults)


def test_words_are_found_whatever_their_letters():
    said = Said(3, "sccal: Encoder.csv counts backwards", "")
    assert said.has("encoder")
    assert not said.has(r"(?-i:encoder)")
    assert "case" in report([])
