"""Several runs as one problem: what they share, what is their own, and sigmas that own up to disagreement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.evidence.extension import Free
from sccal.evidence.held_out_gain import held_out_gain
from sccal.evidence.joint import RunLikelihood, _learnt, _stretch_ends, at_least, disagreement
from sccal.evidence.model import Accepted, Model
from sccal.evidence.saturated import posterior_of
from tests.evidence.linear import CENTRE, CORE_SIGMA, LinearRun, Made, fitted, true_values
from tests.evidence.logs import bare

EFFECTS = (Made("common", 2), Made("own", 1, "run"), Made("other"))


def runs_with(truths, effects=EFFECTS, stretches=12):
    values = [true_values(effects, one) for one in truths]
    return [LinearRun(effects, value, stretches, seed) for seed, value in enumerate(values)]


def one_big_problem(runs):
    """Posterior mean and covariance of all parameters in one regression: shared ones first, then each run's own."""
    keys = [("", name, -1) for name in ("radius_right_m", "radius_left_m", "track_m")]
    sigmas, centre = list(CORE_SIGMA), list(CENTRE.as_array())
    for scope in ("vehicle", "run"):
        for number, run in enumerate(runs):
            for effect, parameter in run.extension.parameters:
                key = (effect.name, parameter.name, number if parameter.scope == "run" else -1)
                if parameter.scope == scope and key not in keys:
                    keys.append(key)
                    sigmas.append(parameter.prior_sigma)
                    centre.append(0.0)
    precision = np.diag(np.array(sigmas) ** -2)
    vector = precision @ np.array(centre)
    for number, run in enumerate(runs):
        mine = [("", name, -1) for name in ("radius_right_m", "radius_left_m", "track_m")]
        mine += [(e.name, p.name, number if p.scope == "run" else -1) for e, p in run.extension.parameters]
        X = np.zeros((run.measured.size, len(keys)))
        X[:, [keys.index(key) for key in mine]] = run.design.reshape(run.measured.size, -1)
        precision += X.T @ X
        vector += X.T @ run.measured.ravel()
    covariance = np.linalg.inv(precision)
    return keys, covariance @ vector, covariance


@pytest.mark.parametrize("count", [1, 2, 4])
def test_it_is_one_big_regression_with_the_prior_counted_once(count, monkeypatch):
    runs = runs_with([{"common": (0.2, -0.1), "own": (0.3 - 0.2 * k,)} for k in range(count)])
    fit = fitted(runs, monkeypatch)
    keys, mean, covariance = one_big_problem(runs)
    order = [keys.index(key) for key in fit.places.keys]
    np.testing.assert_allclose(fit.values, mean[order], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(fit.covariance, covariance[np.ix_(order, order)], rtol=1e-7, atol=1e-15)
    assert fit.places.shared == 6
    np.testing.assert_allclose(fit.mode, fit.values[:6])


def test_what_a_run_has_of_its_own_stays_there(monkeypatch):
    fit = fitted(runs_with([{"own": (0.3,)}, {"own": (-0.3,)}, {}]), monkeypatch)
    rows = [fit.places.keys.index(("own", "p0", run)) for run in range(3)]
    sigma = np.sqrt(np.diag(fit.covariance))[rows]
    assert np.all(np.abs(fit.values[rows] - [0.3, -0.3, 0.0]) < 4.0 * sigma)
    for run, row in enumerate(rows):
        assert fit.each[run][5] == fit.values[row]
        others = [one for one in rows if one != row]
        assert np.all(np.abs(fit.covariance[row, others]) < 0.02 * sigma[run] ** 2)


def test_runs_with_different_effects_share_what_both_have(monkeypatch):
    first, second = Made("first"), Made("second")
    common = Made("common", 2)
    values = {"common": (0.2, -0.1), "first": (0.1,), "second": (-0.2,)}
    one = LinearRun((common, first), true_values((common, first), values), seed=1)
    two = LinearRun((second, common), true_values((second, common), values), seed=2)
    fit = fitted([one, two], monkeypatch)
    assert [key[0] for key in fit.places.keys[3:]] == ["common", "common", "first", "second"]
    assert fit.values[3:] == pytest.approx([0.2, -0.1, 0.1, -0.2], abs=0.25)
    assert fit.each[1][3:] == pytest.approx(fit.values[[6, 3, 4]])


def test_runs_that_agree_have_a_chi2_of_one_per_degree_of_freedom(monkeypatch):
    fit = fitted(runs_with([{"common": (0.2, -0.1)}] * 12), monkeypatch)
    assert fit.chi2_per_dof == pytest.approx(1.0, abs=0.35)
    apart = fitted(runs_with([{"common": (0.5 * (-1) ** k, -0.1)} for k in range(12)]), monkeypatch)
    assert apart.chi2_per_dof > 10.0
    assert disagreement(fit.runs[:1], fit.each[0], np.eye(fit.each[0].size)) is None


def test_sigmas_grow_where_stretches_disagree_and_hardly_where_they_agree(monkeypatch):
    truth = true_values(EFFECTS, {"common": (0.2, -0.1)})
    swinging = np.tile(truth, (20, 1))
    swinging[:, 3] += 0.8 * np.where(np.arange(20) % 2, 1.0, -1.0)
    ratios = []
    for values in (truth, swinging):
        fit = fitted([LinearRun(EFFECTS, values, 20)], monkeypatch)
        ratios.append(np.sqrt(np.diag(fit.all_robust) / np.diag(fit.covariance)))
    assert np.all(ratios[0] >= 1.0 - 1e-12)
    assert np.all(ratios[0] < 1.6)
    assert ratios[1][3] > 3.0
    assert ratios[1][3] > 1.5 * np.max(np.delete(ratios[1], 3))


def test_sigmas_grow_where_runs_disagree(monkeypatch):
    truths = [{"common": (0.2 + 0.5 * (-1) ** k, -0.1)} for k in range(6)]
    fit = fitted(runs_with(truths), monkeypatch)
    sigma = np.sqrt(np.diag(fit.robust))
    assert sigma[3] == pytest.approx(0.5 / np.sqrt(6.0), rel=0.4)
    assert abs(fit.mode[3] - 0.2) < 3.0 * sigma[3]


def test_raising_sigmas_keeps_correlations():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(4, 4))
    covariance = root @ root.T
    other = np.diag(np.diag(covariance) * [0.5, 4.0, 0.1, 9.0])
    raised = at_least(covariance, other)
    before, after = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(raised))
    assert after / before == pytest.approx([1.0, 2.0, 1.0, 3.0])
    np.testing.assert_allclose(raised / np.outer(after, after), covariance / np.outer(before, before))


def test_stretches_add_up_to_the_whole_less_the_first():
    """Of a real pass: what the filter learnt after it had settled, cut into pieces."""
    model = bare("lever_arm=0.3,-0.1", duration_s=120.0)
    problem, at = model.problems[0], model.at(0)
    whole = RunLikelihood.of(problem, at, with_stretches=True)
    run = problem.begun(at, True)
    run.run_to(_stretch_ends(problem)[0])
    first = _learnt(run.belief.covariance(), np.concatenate((run.belief.x, run.belief.p)))
    prior = np.linalg.inv(problem.prior)
    precision = first[0] + sum(one.precision for one in whole.stretches)
    vector = first[1] + sum(one.vector for one in whole.stretches)
    scale = np.sqrt(np.diag(precision))
    difference = (precision - prior - whole.precision) / np.outer(scale, scale)
    assert np.abs(difference).max() < 1e-6
    theta = np.concatenate((at.constants.as_array(), at.values))
    assert np.abs((vector - prior @ theta - whole.vector) / scale).max() < 1e-3
    assert len(whole.stretches) == 8
    assert RunLikelihood.of(problem, at).stretches == ()
    assert RunLikelihood.of(problem, at).nll == pytest.approx(whole.nll, abs=1e-6)


def test_no_pass_of_an_estimate_unlearns_a_constant():
    """Fixes that jump time and again make the filter open up; what it knew of radii and track it still knows."""
    model = bare(duration_s=240.0)
    problem, at = model.problems[0], model.at(0)
    aligned = problem.aligned
    jump = np.floor((aligned.fix_t_s - aligned.fix_t_s[0]) / 6.0)
    jumping = replace(aligned, fix_east_m=aligned.fix_east_m + 30.0 * jump)
    found = RunLikelihood.of(replace(problem, aligned=jumping), at)
    assert found.path.recoveries >= 5
    unit = np.sqrt(np.diag(problem.prior))
    assert np.linalg.eigvalsh(found.precision * np.outer(unit, unit)).min() > -1e-3


# What an effect brings on data that did not fit it


def gain_of(fit, name):
    return held_out_gain(fit, [row for row, key in enumerate(fit.places.keys) if key[0] == name])


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_real_effect_brings_likelihood_where_it_was_not_fitted(count, monkeypatch):
    fit = fitted(runs_with([{"common": (0.3, -0.1)}] * count), monkeypatch)
    expected = 0.5 * count * 12 * 40 * (0.3**2 + 0.1**2)
    assert gain_of(fit, "common") == pytest.approx(expected, rel=0.4)


@pytest.mark.parametrize("count", [1, 4])
def test_nonsense_brings_less_than_nothing(count, monkeypatch):
    gains = []
    for seed in range(25):
        runs = [LinearRun(EFFECTS, true_values(EFFECTS, {}), 12, 100 * seed + k) for k in range(count)]
        gains.append(gain_of(fitted(runs, monkeypatch), "other"))
    assert np.mean(gains) < 0.0
    assert np.mean(np.array(gains) > 0.0) < 0.5
    assert max(gains) < 8.0


def test_what_one_run_alone_has_does_not_pass_for_the_vehicles(monkeypatch):
    fit = fitted(runs_with([{"other": (0.5,)}, {}, {}, {}]), monkeypatch)
    assert gain_of(fit, "other") < 0.0


def test_what_differs_between_runs_is_judged_within_each(monkeypatch):
    fit = fitted(runs_with([{"own": (0.3,)}, {"own": (-0.3,)}, {"own": (0.3,)}]), monkeypatch)
    assert gain_of(fit, "own") > 0.5 * 3 * 12 * 40 * 0.5 * 0.3**2


def test_the_evidence_counts_so_much_less_as_the_stretches_disagree(monkeypatch):
    """A log in which everything differs from stretch to stretch keeps its values, and most of its nats mean nothing."""
    truth = true_values(EFFECTS, {"common": (0.2, -0.1)})
    steady = fitted([LinearRun(EFFECTS, truth, 24, 3)], monkeypatch)
    rng = np.random.default_rng(8)
    differs = truth + np.array([0.0] * 3 + [0.3] * (truth.size - 3)) * rng.normal(size=(24, truth.size))
    wild = fitted([LinearRun(EFFECTS, differs, 24, 3)], monkeypatch)
    assert steady.dispersion == pytest.approx(1.0, abs=0.3)
    assert wild.dispersion > 3.0
    accepted = tuple(Accepted(Free(one)) for one in EFFECTS)
    price = dict.fromkeys([one.key for one in accepted], 3.0)
    told = {}
    for name, fit in (("steady", steady), ("wild", wild)):
        posterior = posterior_of(Model(accepted, (), fit, 10.0), price)
        mean, _ = posterior.of("common", ["common", "other"])
        told[name] = posterior.worth("common", ["common", "other"])
        of_model = fit.covariance[np.ix_(rows := posterior.rows["common"], rows)] / 0.4**2
        everything = posterior.of("common", list(posterior.rows))[1]
        np.testing.assert_allclose(np.diag(everything) / np.diag(of_model), fit.dispersion, rtol=0.1)
        assert mean * 0.4 == pytest.approx([0.2, -0.1], abs=0.15)
    assert told["wild"] < 0.5 * told["steady"]
