"""Records: everything back bit for bit, nothing of this machine in them; and pooled likelihoods give the joint fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.batch.record import FileMark, RunRecord, key_of, record_from, record_text, without_arrays
from sccal.calibration.combine import combine, combined
from sccal.calibration.options import CalibrationOptions
from sccal.calibration.shared import SharedLikelihood, far_off, own_answer, pooled
from sccal.calibration.single import calibrate_run
from sccal.results.calibration import InputFile, Provenance
from tests.calibration.test_single import GIVEN
from tests.runs import read, written

PROVENANCE = Provenance((InputFile("encoder.csv", 3, "ab"),), {"window": "30.0"}, {"sccal": "1"})


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two")
    options = CalibrationOptions(noise=GIVEN)
    return [calibrate_run(read(written(folder / str(k), seed=k, duration_s=150)), options) for k in range(2)]


def record_of(calibration, problem):
    likelihood = SharedLikelihood.of(problem, own_answer(calibration))
    return RunRecord("key", without_arrays(calibration), likelihood, {"a": FileMark.of(b"a")})


def test_a_record_comes_back_bit_for_bit(two):
    record = record_of(*two[0])
    text = record_text(record)
    again = record_from(text)
    assert record_text(again) == text
    assert again.likelihood.precision.tobytes() == record.likelihood.precision.tobytes()
    assert again.calibration.parameters == record.calibration.parameters
    assert replace(again.calibration.noise, fix_stated_m=0.0) == replace(record.calibration.noise, fix_stated_m=0.0)
    assert again.calibration.notices == record.calibration.notices
    assert [w.drift_m.tolist() for w in again.calibration.outage.windows] == [
        w.drift_m.tolist() for w in two[0][0].outage.windows
    ]


def test_numbers_that_json_does_not_know_come_back(two):
    odd = replace(two[0][0].fit, nis_gnss=float("nan"), nis_heading=float("inf"))
    again = record_from(
        record_text(replace(record_of(*two[0]), calibration=without_arrays(replace(two[0][0], fit=odd))))
    )
    assert np.isnan(again.calibration.fit.nis_gnss)
    assert again.calibration.fit.nis_heading == float("inf")


def test_a_record_is_small_and_names_no_folder(two):
    text = record_text(record_of(*two[0]))
    assert len(text) < 100_000
    assert str(two[0][0].vehicle.path.parent) not in text


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"schema": "sccal.record/1"}', '{"schema": "sccal.record/0"}'])
def test_what_is_no_record_is_told(text):
    with pytest.raises(ValueError, match=r"record|schema|Expecting"):
        record_from(text)


def test_the_key_follows_every_part_of_the_provenance():
    keys = {
        key_of("a", PROVENANCE),
        key_of("b", PROVENANCE),
        key_of("a", replace(PROVENANCE, inputs=())),
        key_of("a", replace(PROVENANCE, options={"window": "31.0"})),
        key_of("a", replace(PROVENANCE, versions={"sccal": "2"})),
    }
    assert len(keys) == 5
    assert key_of("a", replace(PROVENANCE, options=dict(PROVENANCE.options))) in keys


def test_records_give_the_vehicle_that_the_whole_runs_give(two):
    runs, problems = [run for run, _ in two], [problem for _, problem in two]
    whole = combine(runs, problems)
    likelihoods = [SharedLikelihood.of(problem, own_answer(run)) for run, problem in two]
    fit = pooled(likelihoods)
    assert far_off(likelihoods, fit) == []
    small = combined([without_arrays(run) for run in runs], problems[0].options, fit)
    for name in ("radius_right_m", "radius_left_m", "track_m"):
        one, other = getattr(whole.parameters, name), getattr(small.parameters, name)
        assert abs(one.value - other.value) < 0.02 * one.sigma
        assert other.sigma == pytest.approx(one.sigma, rel=0.02)
    assert small.parameters.heading_offset_rad == whole.parameters.heading_offset_rad


def test_a_run_linearised_far_away_is_found(two):
    likelihoods = [SharedLikelihood.of(problem, own_answer(run)) for run, problem in two]
    sigma = np.sqrt(np.diag(likelihoods[1].covariance))
    moved = replace(likelihoods[1], at=likelihoods[1].at + np.array([0.0, 0.0, 10.0 * sigma[2]]))
    assert far_off([likelihoods[0], moved], pooled(likelihoods)) == [1]
