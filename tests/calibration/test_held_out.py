"""Judged on what did not fit: a measurement that is held out has no say in the constants it is held against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.calibration import held_out
from sccal.calibration.held_out import STRETCHES, expected_of_one_more, how, judge, stretches, without
from tests.evidence.logs import bare, several

WINDOW_S = 15.0


def moved(problem, first_s, last_s, metres=4.0, degrees=10.0):
    """The problem with its fixes and headings between two times wrong."""
    aligned = problem.aligned
    fixes = (aligned.fix_t_s > first_s) & (aligned.fix_t_s <= last_s)
    headings = (aligned.heading_t_s > first_s) & (aligned.heading_t_s <= last_s)
    assert fixes.sum() > 100
    return replace(
        problem,
        aligned=replace(
            aligned,
            fix_east_m=aligned.fix_east_m + metres * fixes,
            fix_north_m=aligned.fix_north_m - metres * fixes,
            yaw_rad=aligned.yaw_rad + np.radians(degrees) * headings,
        ),
    )


def blind_in(problem):
    """The stretches that a problem has no fixes in."""
    t_s = problem.timeline.t_s[problem.timeline.fix_row >= 0]
    return tuple(k for k, (a, b) in enumerate(stretches(problem)) if not np.any((t_s > a) & (t_s <= b)))


def judged(model, monkeypatch):
    """What the model is judged to be, and the fits on which it was: by the runs that made each, and what it lacked."""
    fits = {}
    honest = held_out.fit_jointly

    def noted(problems, *others, **more):
        fit = honest(problems, *others, **more)
        fits[tuple(problem.aligned.name for problem in problems), blind_in(problems[0])] = fit
        return fit

    with monkeypatch.context() as patch:
        patch.setattr(held_out, "fit_jointly", noted)
        found = judge(model, WINDOW_S)
    return found, fits


def test_stretches_are_equal_parts_of_the_settled_run():
    problem = bare().problems[0]
    found = stretches(problem)
    assert len(found) == STRETCHES
    assert found[0][0] >= problem.start.moving_from_s + 20.0
    assert found[-1][1] == problem.aligned.span_s[1]
    assert [b for _, b in found[:-1]] == [a for a, _ in found[1:]]
    assert np.ptp([b - a for a, b in found]) == pytest.approx(0.0, abs=1e-6)


def test_without_a_stretch_there_are_no_measurements_in_it_and_all_the_others():
    timeline = bare().problems[0].timeline
    first, last = stretches(bare().problems[0])[1]
    found = without(timeline, (first, last))
    inside = (timeline.t_s > first) & (timeline.t_s <= last)
    for before, after in ((timeline.heading_row, found.heading_row), (timeline.fix_row, found.fix_row)):
        assert np.count_nonzero(before[inside] >= 0) > 100
        assert np.all(after[inside] == -1)
        assert np.array_equal(after[~inside], before[~inside])
        assert after.dtype == before.dtype
    assert np.array_equal(found.right_rad, timeline.right_rad)


@pytest.mark.parametrize("stretch", [0, STRETCHES - 1])
def test_a_stretch_has_no_say_in_the_fit_that_judges_it(stretch, monkeypatch):
    model = bare()
    first, last = stretches(model.problems[0])[stretch]
    wrong = replace(model, problems=(moved(model.problems[0], first, last),))
    right_found, right = judged(model, monkeypatch)
    wrong_found, bad = judged(wrong, monkeypatch)
    assert {lacking for _, lacking in right} == {lacking for _, lacking in bad} == {(k,) for k in range(STRETCHES)}
    for who, one in right.items():
        other = bad[who]
        blind = who[1] == (stretch,)
        assert np.array_equal(one.each[0], other.each[0]) == blind
        assert np.array_equal(one.runs[0].precision, other.runs[0].precision) == blind
    assert wrong_found.gnss_innovation_rms_m > 1.2 * right_found.gnss_innovation_rms_m
    assert wrong_found.heading_innovation_rms_rad > 1.2 * right_found.heading_innovation_rms_rad


@pytest.mark.parametrize("run", [0, 2])
def test_a_run_has_no_say_in_the_constants_that_judge_it(run, monkeypatch):
    model = several()
    names = [problem.aligned.name for problem in model.problems]
    assert len(set(names)) == 3
    first, last = model.problems[run].aligned.span_s
    problems = list(model.problems)
    problems[run] = moved(problems[run], first + 60.0, last)
    _, right = judged(model, monkeypatch)
    _, bad = judged(replace(model, problems=tuple(problems)), monkeypatch)
    others = tuple(name for name in names if name != names[run])
    assert {who for who, _ in right} == {who for who, _ in bad} == {tuple(n for n in names if n != o) for o in names}
    for (who, lacking), one in right.items():
        assert lacking == ()
        assert np.array_equal(one.mode, bad[who, lacking].mode) == (who == others)


def test_every_window_of_a_run_is_judged_once():
    for model in (bare(), several()):
        found = judge(model, WINDOW_S)
        assert len(found.windows) >= len(model.problems) * 2
        assert all(window.end_s - window.start_s <= WINDOW_S + 1e-6 for window in found.windows)
        if len(model.problems) == 1:
            starts = [window.start_s for window in found.windows]
            assert starts == sorted(set(starts))
            parts = stretches(model.problems[0])
            assert all(any(a <= w.start_s and w.end_s <= b + 1e-6 for a, b in parts) for w in found.windows)
            assert found.window_s == WINDOW_S


def test_only_settled_measurements_are_judged_and_each_once():
    model = bare()
    problem = model.problems[0]
    found = judge(model, WINDOW_S)
    first = stretches(problem)[0][0]
    headings = problem.aligned.heading_t_s[problem.timeline.heading_index]
    fixes = problem.aligned.fix_t_s[problem.timeline.fix_index]
    assert found.heading_rad2.size == np.count_nonzero(headings > first)
    # One fix in a hundred is an outlier, which nothing is judged by.
    assert 0.97 * np.count_nonzero(fixes > first) < found.fix_m2.size < np.count_nonzero(fixes > first)


def test_a_single_wild_fix_judges_nothing():
    model = bare()
    problem = model.problems[0]
    aligned = problem.aligned
    middle = aligned.fix_t_s[aligned.fix_t_s.size // 2]
    wild = moved_one(problem, middle, 500.0)
    before, after = judge(model, WINDOW_S), judge(replace(model, problems=(wild,)), WINDOW_S)
    assert after.gnss_innovation_rms_m == pytest.approx(before.gnss_innovation_rms_m, rel=0.05)
    assert after.nll_per_measurement < before.nll_per_measurement + 0.05


def moved_one(problem, t_s, metres):
    """The problem with one fix far away."""
    aligned = problem.aligned
    return replace(
        problem,
        aligned=replace(aligned, fix_east_m=aligned.fix_east_m + metres * (aligned.fix_t_s == t_s)),
    )


def test_it_is_told_which_data_judged():
    assert how(bare()).startswith(f"each of {STRETCHES} stretches")
    assert how(several()).startswith("each of 3 runs")


def test_one_more_run_is_expected_among_the_others_and_less_surely_where_they_are_few():
    rng = np.random.default_rng(2)
    for count in (3, 6, 30):
        drawn = rng.normal(1.0, 2.0, (4000, count + 1))
        told = [expected_of_one_more(each[:-1]) for each in drawn]
        scores = np.array(
            [(each[-1] - mean) / np.sqrt(variance) for each, (mean, variance) in zip(drawn, told, strict=True)]
        )
        assert np.median(np.abs(scores)) < 0.75
        assert np.mean(np.abs(scores) < 2.0) > 0.88
    assert expected_of_one_more(np.array([1.0, 3.0])) == (2.0, np.inf)
