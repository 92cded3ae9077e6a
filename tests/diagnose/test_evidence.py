"""What one run says of every candidate: which blocks count, and in which units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.calibration.extension import view_run
from sccal.diagnose.evidence import blocks, gather, place, prior_sigmas, rows_of
from sccal.diagnose.loop import evidence_of
from sccal.diagnose.model import TRANSPORT, names_of, without_transport
from sccal.diagnose.pool import Pool
from sccal.effects.catalogue import CATALOGUE
from sccal.effects.lever_arm import LeverArm
from tests.diagnose.logs import bare


class WideArm(LeverArm):
    """The lever arm with twice the prior."""

    name = "wide_arm"
    parameters = tuple(replace(one, prior_sigma=2.0 * one.prior_sigma) for one in LeverArm.parameters)


def lasting(duration_s):
    """A problem that says that it lasts so long; only its times are of use."""
    problem = bare().problems[0]
    first = problem.timeline.t_s[0]
    return replace(problem, timeline=replace(problem.timeline, t_s=np.linspace(first, first + duration_s, 20001)))


@pytest.mark.parametrize(
    ("duration_s", "count"), [(60.0, 12), (200.0, 12), (320.0, 14), (500.0, 23), (820.0, 39), (3000.0, 40)]
)
def test_blocks_are_of_20_s_but_neither_few_nor_many(duration_s, count):
    problem = lasting(duration_s)
    block, used = blocks(problem)
    assert used == 1
    assert np.all(np.diff(block) >= 0)
    assert block.max() == pytest.approx(count, abs=1)
    lengths = np.bincount(block)[1:]
    assert lengths.min() > 0.99 * lengths.max() - 2
    settled = problem.timeline.t_s[block > 0][0]
    assert settled - problem.start.moving_from_s == pytest.approx(20.0, abs=0.2)


def test_of_a_very_short_run_half_counts():
    block, _ = blocks(lasting(10.0))
    assert np.mean(block == 0) == pytest.approx(0.5, abs=0.01)
    assert block.max() == 12


def test_the_first_20_s_do_not_count():
    model = bare()
    problem = model.problems[0]
    timeline = problem.timeline
    evidence = gather(problem, model.at(0), [CATALOGUE["lever_arm"]])
    late = timeline.t_s >= problem.start.moving_from_s + 20.0
    assert np.count_nonzero(~late) > 0
    scalars = np.count_nonzero(timeline.heading_row[late] >= 0) + 2 * np.count_nonzero(timeline.fix_row[late] >= 0)
    outliers = 0.02 * scalars
    assert scalars - outliers < evidence.count.sum() <= scalars
    assert len(evidence.u) == len(evidence.information) == len(evidence.cost) == blocks(problem)[0].max()


def test_noise_that_was_estimated_makes_innovations_as_large_as_expected():
    model = bare()
    (evidence,) = evidence_of(model, [CATALOGUE["lever_arm"]])
    assert evidence.nis == pytest.approx(1.0, abs=0.15)


def test_it_is_in_units_of_the_prior_sigma():
    model = bare()
    candidates = [LeverArm(), WideArm()]
    assert prior_sigmas(candidates) == pytest.approx([0.5, 0.5, 1.0, 1.0])
    assert [rows.tolist() for rows in rows_of(candidates).values()] == [[0, 1], [2, 3]]
    evidence = gather(model.problems[0], model.at(0), candidates)
    assert evidence.u[:, 2:] == pytest.approx(2.0 * evidence.u[:, :2])
    assert evidence.information[:, 2:, 2:] == pytest.approx(4.0 * evidence.information[:, :2, :2])
    assert evidence.information[:, :2, 2:] == pytest.approx(2.0 * evidence.information[:, :2, :2])


def test_information_is_symmetric_and_never_negative():
    model = bare()
    evidence = gather(model.problems[0], model.at(0), [CATALOGUE["lever_arm"], CATALOGUE["soft_iron"]])
    for one in evidence.information:
        assert one == pytest.approx(one.T)
        assert np.linalg.eigvalsh(one).min() > -1e-9 * np.trace(one)


def test_effects_that_need_a_search_have_no_rows():
    candidates = [CATALOGUE["lever_arm"], CATALOGUE["heading_step"], CATALOGUE["turn_slip"]]
    assert {name: rows.size for name, rows in rows_of(candidates).items()} == {
        "lever_arm": 2,
        "heading_step": 1,
        "turn_slip": 1,
    }


@pytest.mark.parametrize(
    ("text", "truth"),
    [("lever_arm=0.3,-0.1", (0.3, -0.1)), ("soft_iron=4,-3", (4.0, -3.0)), ("turn_slip=0.22", (0.22,))],
)
def test_one_linear_step_has_the_sign_and_the_unit(text, truth):
    """Before anything is fitted: the score's values are in the files' units."""
    model = bare(text)
    effect = CATALOGUE[text.split("=")[0]]
    score = Pool(evidence_of(model, [effect]), [effect]).score(effect)
    assert score.values == pytest.approx(truth, rel=0.5)
    assert score.t > 10.0


def test_columns_are_numbered_as_their_rows():
    model = bare()
    candidates = [CATALOGUE["lever_arm"], CATALOGUE["turn_slip"], CATALOGUE["eccentric_left"]]
    problem, at = model.problems[0], model.at(0)
    placed = place(candidates, view_run(problem, at, problem.clear_steps(at.constants)))
    assert sorted({one.parameter for one in placed}) == list(range(5))


def test_the_time_that_lines_take_is_held_at_zero_while_candidates_are_scored():
    model = bare()
    problem, at = model.problems[0], model.at(0)
    assert names_of(problem) == [("gnss_latency", "s")]
    assert at.values[0] != 0.0
    frozen, zero = without_transport(problem, at)
    assert zero.values.tolist() == [0.0]
    assert frozen.extension.prior_sigmas[0] < 1e-4 * TRANSPORT.parameters[0].prior_sigma
    assert problem.extension.prior_sigmas[0] == pytest.approx(0.1 * TRANSPORT.parameters[0].prior_sigma)
