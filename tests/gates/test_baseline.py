"""Drift from earlier results: what is compared with what, and how far it may be off."""

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.errors import DataError, UsageError
from sccal.gates.allowance import parse_allowance
from sccal.gates.baseline import Baseline, Earlier, judge_drift, read_baseline
from sccal.results.calibration import Estimate
from tests.results.documents import calibration, estimate, saved, stored, vehicle

SIZES = st.floats(1e-4, 1e-2)


def baseline(folder, document, name="previous.json"):
    folder.mkdir(exist_ok=True)
    (folder / name).write_text(json.dumps(document), encoding="utf-8")
    return read_baseline(folder / name)


def summary(runs=(), vehicles=()):
    keep = ("run", "vehicle", "parameters")
    return {
        "schema": "sccal.summary/1",
        "runs": [{key: one[key] for key in keep} for one in runs],
        "vehicles": [{key: one[key] for key in keep[1:]} for one in vehicles],
    }


def drift(folder, before, after, *allowed, of="parameters.track_m"):
    allowances = [parse_allowance(text) for text in allowed]
    judged = judge_drift(baseline(folder, before), allowances, [saved(after)])
    return next(one for one in judged if of in one.expression)


@pytest.mark.parametrize(
    ("text", "amount", "unit"),
    [
        ("2sigma", 2.0, "sigma"),
        ("2.5 sigmas", 2.5, "sigma"),
        ("3σ", 3.0, "sigma"),
        ("1%", 1.0, "%"),
        ("0.5mm", 5e-4, "m"),
        ("0.5 cm", 5e-3, "m"),
        ("1e-3m", 1e-3, "m"),
        (".2deg", 0.2, "deg"),
        ("0.1rad", math.degrees(0.1), "deg"),
    ],
)
def test_allowances_have_units(text, amount, unit):
    allowance = parse_allowance(text)
    assert (allowance.amount, allowance.unit) == (pytest.approx(amount), unit)


@pytest.mark.parametrize("text", ["", "2", "sigma", "-1mm", "0mm", "2 parsec", "nan%", "1e999m", "1mm2", "2sigma,1%"])
def test_what_is_no_allowance_is_refused(text):
    with pytest.raises(UsageError, match=r"write 2sigma, 1%, 0\.5mm or 0\.2deg"):
        parse_allowance(text)


@given(SIZES, SIZES, st.floats(-0.05, 0.05), st.floats(0.5, 5.0))
def test_sigmas_are_of_both_together(before, after, moved, allowed):
    earlier = Earlier("yard", "demo", {"parameters.track_m": Estimate(0.7, before, "estimated")})
    judged = judge_drift(
        Baseline(Path("previous.json"), (earlier,)),
        [parse_allowance(f"{allowed!r}sigma")],
        [saved(calibration(track_m=estimate(0.7 + moved, after)))],
    )
    result = next(one for one in judged if "track_m" in one.expression)
    ours = abs(0.7 + moved - 0.7)
    assert (result.outcome == "passed") is (ours <= allowed * math.hypot(before, after))
    assert result.measured == pytest.approx(moved, abs=1e-12)


@pytest.mark.parametrize(
    ("allowed", "moved", "kept"),
    [
        ("1%", 0.0069, True),
        ("1%", 0.0071, False),
        ("1%", -0.0071, False),
        ("0.5mm", -0.00049, True),
        ("0.5mm", 0.00051, False),
    ],
)
def test_shares_are_of_the_baseline_and_amounts_are_amounts(tmp_path, allowed, moved, kept):
    before, after = calibration(track_m=estimate(0.7, 0.1)), calibration(track_m=estimate(0.7 + moved, 0.1))
    result = drift(tmp_path, before, after, allowed)
    assert (result.outcome == "passed") is kept
    assert result.measured == pytest.approx(moved)


def test_a_share_of_a_negative_value_is_as_large(tmp_path):
    before, after = (calibration() | {"effects": {"slope": {"ratio": estimate(one, 0.1)}}} for one in (-1.0, -1.05))
    assert drift(tmp_path, before, after, "10%", of="slope").outcome == "passed"
    assert drift(tmp_path, before, after, "1%", of="slope").outcome == "failed"


def test_the_offset_goes_the_short_way_round(tmp_path):
    before = calibration(heading_offset_deg=estimate(179.9, 0.1))
    after = calibration(heading_offset_deg=estimate(-179.9, 0.1))
    result = drift(tmp_path, before, after, "2sigma", of="heading_offset")
    assert (result.outcome, result.measured) == ("passed", pytest.approx(0.2))
    assert drift(tmp_path, before, after, "0.1deg", of="heading_offset").outcome == "failed"


def test_each_parameter_is_judged_by_what_is_for_its_unit(tmp_path):
    same = calibration()
    assert drift(tmp_path, same, same, "0.5mm", of="heading_offset").outcome == "skipped"
    assert drift(tmp_path, same, same, "1%", of="heading_offset").outcome == "skipped"
    assert drift(tmp_path, same, same, "0.5mm", "0.2deg", of="heading_offset").outcome == "passed"
    assert drift(tmp_path, same, same, "0.2deg", of="track_m").outcome == "skipped"


@pytest.mark.parametrize("status", ["unobserved", "held", "at_bound"])
def test_what_is_not_estimated_on_either_side_is_skipped(tmp_path, status):
    other = calibration(track_m=estimate(0.9, 1e-3, status, "turn both ways"))
    for before, after in ((other, calibration()), (calibration(), other)):
        result = drift(tmp_path, before, after, "2sigma")
        assert result.outcome == "skipped"
        assert "turn both ways" in result.reason


def test_an_estimate_without_its_numbers_fails(tmp_path):
    assert drift(tmp_path, calibration(), calibration(track_m=estimate(None, None)), "2sigma").outcome == "failed"
    assert drift(tmp_path, calibration(), calibration(track_m=estimate(0.728, None)), "2sigma").outcome == "failed"


def runs_compared(folder, before, *after):
    """By run: what its track is compared with, by the value there."""
    judged = judge_drift(baseline(folder, before), [parse_allowance("2sigma")], [saved(one) for one in after])
    return {one.run: one.reason for one in judged if "track_m" in one.expression}


def test_a_run_is_compared_with_the_run_of_its_name_else_with_the_vehicle(tmp_path):
    before = summary(
        [calibration("yard", track_m=estimate(0.701, 1e-3)), calibration("lane", track_m=estimate(0.702, 1e-3))],
        [vehicle(track_m=estimate(0.703, 1e-3))],
    )
    told = runs_compared(tmp_path, before, calibration("yard"), calibration("field"), vehicle())
    assert "against 0.701 m of run yard in previous.json" in told["yard"]
    assert "against 0.703 m of vehicle demo in previous.json" in told["field"]
    assert "against 0.703 m of vehicle demo" in told["(vehicle)"]
    told = runs_compared(tmp_path, vehicle(track_m=estimate(0.703, 1e-3)), calibration("lane"), calibration("field"))
    assert "against 0.728 m of run lane" in told["lane"]
    assert "against 0.703 m of vehicle demo" in told["field"]
    told = runs_compared(tmp_path, calibration("yard"), calibration("field"), vehicle())
    assert all("of run yard" in one for one in told.values())


def test_vehicles_are_told_apart_by_name(tmp_path):
    before = summary([calibration("yard", "other"), calibration("yard", "demo", track_m=estimate(0.701, 1e-3))])
    assert "against 0.701" in runs_compared(tmp_path, before, calibration("yard", "demo"))["yard"]
    with pytest.raises(UsageError, match="is of demo, other, the new results are of third"):
        runs_compared(tmp_path, before, calibration("yard", "third"))
    judged = judge_drift(
        baseline(tmp_path, before),
        [parse_allowance("2sigma")],
        [saved(calibration("yard", "third")), saved(calibration())],
    )
    assert (judged[0].outcome, judged[0].reason) == ("skipped", "the baseline has no vehicle third")


def test_several_runs_of_other_names_are_no_baseline(tmp_path):
    before = summary([calibration("a"), calibration("b")])
    (result,) = judge_drift(baseline(tmp_path, before), [parse_allowance("2sigma")], [saved(calibration("c"))])
    assert result.outcome == "skipped"
    assert "none of this name" in result.reason


def test_effects_are_compared_where_both_have_them(tmp_path):
    before = calibration() | {"effects": {"lever_arm": {"left_m": estimate(0.1, 0.001)}}}
    after = calibration() | {"effects": {"lever_arm": {"left_m": estimate(0.2, 0.001)}}}
    assert drift(tmp_path, before, after, "3sigma", of="lever_arm").outcome == "failed"
    assert drift(tmp_path, calibration(), after, "3sigma", of="lever_arm").outcome == "skipped"
    moment = {"heading_step": {"at_s": estimate(60.0, 0.1)}}
    moved = {"heading_step": {"at_s": estimate(90.0, 0.1)}}
    result = drift(tmp_path, calibration() | {"effects": moment}, calibration() | {"effects": moved}, "3s", of="at_s")
    assert result.outcome == "skipped"


def test_a_folder_gives_what_it_holds(tmp_path):
    stored(tmp_path / "run", calibration("yard"))
    assert read_baseline(tmp_path / "run").results[0].run == "yard"
    stored(tmp_path / "out", vehicle(), "vehicle.json")
    assert len(read_baseline(tmp_path / "out").results) == 3
    baseline(tmp_path / "out", summary([calibration("a")]), "summary.json")
    assert [one.run for one in read_baseline(tmp_path / "out").results] == ["a"]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "JSON"),
        ("[" * 100_000, "JSON"),
        ("[]", "schema is None"),
        ('{"schema": "sccal.diagnosis/1"}', "sccal.diagnosis/1"),
        ('{"schema": "sccal.calibration/1"}', "calibrate again"),
        ('{"schema": "sccal.summary/1", "runs": [{"parameters": {}}]}', "run: is missing"),
        ('{"schema": "sccal.summary/1", "runs": [{"run": "a", "parameters": {"track_m": {}}}]}', "parameters.radius"),
    ],
)
def test_what_is_no_baseline_is_refused(tmp_path, content, says):
    (tmp_path / "previous.json").write_text(content)
    with pytest.raises(DataError, match=says):
        read_baseline(tmp_path / "previous.json")


def test_a_baseline_that_is_not_there_is_a_wrong_name(tmp_path):
    with pytest.raises(UsageError, match="no such file"):
        read_baseline(tmp_path / "previous.json")
