"""An antenna off the middle: the start lies below it, and a robot that stands shows nothing of it."""

from __future__ import annotations

import numpy as np
import pytest

from sccal.effects.catalogue import CATALOGUE
from sccal.evidence.extension import Free
from sccal.evidence.model import Accepted, bare_model, refitted
from sccal.filter.iterate import At
from sccal.filter.layout import BASE_STATES
from sccal.filter.options import FilterOptions
from sccal.filter.start import Constants
from tests.evidence.logs import HEADING_HZ, aligned, bare

ARM = (2.2, -0.6)
FAR = "lever_arm=2.2,-0.6"
STOOD_S = 60.0
STOOD = (f"drive.stand_first_s={STOOD_S}",)


def with_arm(*texts: str, settings: tuple[str, ...] = (), scale: float = 1.0):
    return refitted(
        bare(*texts, settings=settings), [Accepted(Free(CATALOGUE["lever_arm"], prior_scale=scale))], reach=None
    )


def test_the_start_lies_below_the_antenna():
    """Ahead of the robot, and to its right: turned by the heading it stands at."""
    model = with_arm(FAR)
    problem, at = model.problems[0], model.at(0)
    antenna, below = problem.start, problem.laid_out(at).start
    yaw = antenna.yaw_rad
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    left = np.array([-np.sin(yaw), np.cos(yaw)])
    moved = np.array([antenna.east_m - below.east_m, antenna.north_m - below.north_m])
    assert [moved @ ahead, moved @ left] == pytest.approx(at.values.tolist(), abs=1e-9)
    assert at.values == pytest.approx(ARM, abs=0.05)


def test_a_far_antenna_is_not_held_back_by_where_the_run_was_thought_to_start():
    model = with_arm(FAR)
    sigma = np.sqrt(np.diag(model.fit.all_robust))[3:]
    assert np.all(np.abs(model.fit.values[3:] - ARM) < 3.5 * sigma)
    found = model.path(0)
    first = found.fix_nu_m[0] / np.sqrt(found.fix_var_m2[0, :2])
    assert np.abs(first).max() < 1.0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_far_antenna_is_found_on_rows_whose_turns_look_like_outliers_without_it(seed):
    log = aligned("lever_arm=2.2,-0.3", path="rows", duration_s=210.0, seed=seed)
    first = bare_model([log], FilterOptions(), HEADING_HZ)
    model = refitted(first, [Accepted(Free(CATALOGUE["lever_arm"]))])
    sigma = np.sqrt(np.diag(model.fit.all_robust))[3:]
    assert np.all(np.abs(model.fit.values[3:] - (2.2, -0.3)) < 4.0 * sigma)
    assert np.all(sigma < 0.02)


def test_a_robot_that_stands_shows_nothing_of_its_antenna():
    model = with_arm(FAR, settings=STOOD)
    problem, at = model.problems[0], model.at(0)
    run = problem.begun(at, linearise_there=True)
    t_s = problem.timeline.t_s - problem.aligned.span_s[0]

    def arm_sigmas() -> np.ndarray:
        return np.sqrt(np.diag(run.belief.covariance()))[BASE_STATES:]

    run.run_to(int(np.searchsorted(t_s, 2.0)))
    before = arm_sigmas()
    run.run_to(int(np.searchsorted(t_s, STOOD_S - 1.0)))
    assert arm_sigmas() == pytest.approx(before, rel=0.02)
    run.run_to(None)
    assert np.all(arm_sigmas() < 0.3 * before)


def test_an_earlier_path_from_elsewhere_changes_no_answer():
    """Where arms are turned by another path, h stays what it is to second order, and the fit ends at the same place."""
    model = with_arm(FAR)
    again = refitted(model, model.accepted, [At(Constants.of(model.fit.values), np.zeros(2))], reach=None)
    sigma = np.sqrt(np.diag(model.fit.covariance))
    assert np.abs((again.fit.values - model.fit.values) / sigma).max() < 0.2


def test_the_log_of_these_tests_stands_first():
    first = aligned(FAR, settings=STOOD).standing_s
    assert first[0][1] - first[0][0] > 0.9 * STOOD_S
