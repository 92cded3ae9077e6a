"""Processes, threads and one after the other: the same numbers, and the first failure is raised."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.logged import LoggedColumn
from sccal.effects.patterns import PATTERNS
from sccal.errors import DataError, SccalError
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, refitted
from sccal.evidence.parallel import each_apart, shared_among
from sccal.processes import Processes
from sccal.results.model import Range
from tests.evidence.logs import several


@pytest.fixture(scope="module")
def workers():
    processes = Processes(2, ("sccal.diagnose.diagnose",))
    yield processes
    processes.stop()


def root(number: float) -> float:
    if number < 0.0:
        raise DataError(f"{number} has no root")
    return float(np.sqrt(number))


def both(number: float) -> list[float]:
    """Asks for more of the same from within."""
    return each_apart(root, [number, number])


@pytest.mark.parametrize("function", [root, both])
def test_results_come_in_the_order_of_the_items(workers, function):
    items = [9.0, 4.0, 1.0, 16.0]
    here = each_apart(function, items)
    with shared_among(workers):
        assert each_apart(function, items) == here == [function(one) for one in items]


def test_the_first_failure_is_raised_as_it_is(workers):
    with shared_among(workers), pytest.raises(DataError, match=r"-2\.0 has no root"):
        each_apart(root, [1.0, -2.0, -3.0])


def test_whatever_cannot_be_done_elsewhere_is_an_error_and_not_a_gap(workers):
    with shared_among(workers), pytest.raises((SccalError, AttributeError, pickle.PicklingError)):
        each_apart(lambda number: number, [1.0, 2.0])


def test_a_model_is_the_same_to_the_bit_in_processes(workers):
    wanted = [Accepted(Free(CATALOGUE["lever_arm"]))]
    here = refitted(several(), wanted, reach=None)
    with shared_among(workers):
        there = refitted(several(), wanted, reach=None)
    assert there.fit.values.tolist() == here.fit.values.tolist()


@pytest.mark.parametrize("effect", [*PATTERNS, *CATALOGUE.values()], ids=lambda one: one.name)
def test_every_effect_goes_to_another_process(effect):
    there = pickle.loads(pickle.dumps(effect))
    assert (there.name, there.parameters, type(there)) == (effect.name, effect.parameters, type(effect))


def test_a_logged_column_goes_too():
    column = LoggedColumn("heading", "motor_current_a", Range.of([np.array([0.0, 1.0, 2.0])]))
    assert pickle.loads(pickle.dumps(column)).name == column.name
