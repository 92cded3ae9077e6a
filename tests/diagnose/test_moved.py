"""Stamps that the alignment put right are findings of a diagnosis, with their sign."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sccal.align.aligned import Moved
from sccal.diagnose.moved import with_moved
from sccal.results.calibration import Estimate
from tests.evidence.logs import aligned


def run(**moved):
    return replace(aligned(), moved=moved)


def test_fixes_moved_to_a_later_time_were_ahead_of_their_stamp():
    """Stamps to which 0.38 s had to be added show where the antenna was only then: a latency below zero."""
    (found,) = with_moved([], [run(fixes=Moved(0.38, 0.001))])
    assert found.name == "gnss_latency"
    assert found.parameters["s"].value == pytest.approx(-0.38)
    assert found.parameters["s"].sigma == pytest.approx(0.015, rel=0.01)
    assert found.aligned
    assert found.t == pytest.approx(0.38 / 0.015, rel=0.01)


def test_headings_moved_to_an_earlier_time_were_old():
    (found,) = with_moved([], [run(headings=Moved(-0.4, 0.002))])
    assert found.name == "heading_latency"
    assert found.parameters["s"].value == pytest.approx(0.4)


@pytest.mark.parametrize("moved", [{}, {"fixes": Moved(0.03, 0.001)}, {"fixes": Moved(40.0, 0.001)}])
def test_what_was_not_moved_or_is_no_latency_is_no_finding(moved):
    assert with_moved([], [run(**moved)]) == ()


def test_what_the_fit_still_finds_of_it_is_added():
    (moved,) = with_moved([], [run(fixes=Moved(-0.3, 0.001))])
    fitted = replace(moved, parameters={"s": Estimate(0.1, 0.02, "estimated")}, aligned=False)
    (found,) = with_moved([fitted], [run(fixes=Moved(-0.3, 0.001))])
    assert found.parameters["s"].value == pytest.approx(0.4)
    assert not found.aligned


def test_each_run_has_its_own():
    (found,) = with_moved([], [run(fixes=Moved(-0.3, 0.001)), run(), run(fixes=Moved(-0.5, 0.001))])
    assert [one.value for one in found.per_run["s"]] == pytest.approx([0.3, 0.0, 0.5])
    assert found.parameters["s"].value == pytest.approx(0.4)
