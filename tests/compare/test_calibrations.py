"""Two calibrations side by side: differences are B − A, judged by the sigma of both."""

import copy
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sccal.compare.calibrations import compare_calibrations
from sccal.report.comparison.text import compare_text, headline
from sccal.results.converter import document_of
from tests.results.documents import calibration, estimate, saved, vehicle

SIGMAS = st.floats(1e-4, 1e-2)


def pairs(a, b, sigmas=3.0):
    return {pair.name.partition(".")[2]: pair for pair in compare_calibrations(saved(a), saved(b), sigmas).pairs}


def with_inputs(document, *hashes, **options):
    inputs = [{"name": f"{one}.csv", "bytes": 1, "sha256": one} for one in hashes]
    inputs.append({"name": "vehicle.toml", "bytes": 1, "sha256": "same for all"})
    provenance = {"inputs": inputs, "options": options, "versions": {"sccal": "0.1.0"}}
    return copy.deepcopy(document) | {"provenance": provenance}


def remarks(a, b):
    return " / ".join(compare_calibrations(saved(a), saved(b), 3.0).remarks)


@given(SIGMAS, SIGMAS, st.floats(-0.1, 0.1), st.floats(0.5, 5.0))
def test_what_changed_is_beyond_the_sigma_of_both(sigma_a, sigma_b, moved, sigmas):
    a = calibration(track_m=estimate(0.7, sigma_a))
    b = calibration(track_m=estimate(0.7 + moved, sigma_b))
    there, back = pairs(a, b, sigmas)["track_m"], pairs(b, a, sigmas)["track_m"]
    ours = abs(0.7 + moved - 0.7) > sigmas * math.hypot(sigma_a, sigma_b)
    assert (there.change == "changed") is ours
    assert there.difference.amount == pytest.approx(moved, abs=1e-12)
    assert back.difference.amount == -there.difference.amount
    assert back.change == there.change


def test_the_offset_goes_the_short_way_round():
    a, b = (calibration(heading_offset_deg=estimate(value, 0.2)) for value in (179.8, -179.8))
    pair = pairs(a, b)["heading_offset_deg"]
    assert (pair.change, pair.difference.amount) == ("unchanged", pytest.approx(0.4))


@pytest.mark.parametrize("status", ["unobserved", "held", "at_bound"])
def test_what_was_not_estimated_is_not_compared(status):
    other = calibration(track_m=estimate(0.7, 1e-3, status, "turn both ways"))
    assert pairs(other, calibration())["track_m"].reason.startswith("A: ")
    pair = pairs(calibration(), other)["track_m"]
    assert (pair.change, pair.difference) == ("not comparable", None)
    assert pair.reason.startswith("B: ")
    assert "turn both ways" in pair.reason
    assert "turn both ways" in compare_text(compare_calibrations(saved(calibration()), saved(other), 3.0))


def test_effects_are_compared_where_both_have_them():
    a = calibration() | {"effects": {"lever_arm": {"left_m": estimate(0.1, 0.01)}, "slope": {"ratio": estimate(1, 1)}}}
    b = calibration() | {"effects": {"lever_arm": {"left_m": estimate(0.2, 0.01)}}}
    both = pairs(a, b)
    assert both["lever_arm.left_m"].change == "changed"
    assert (both["slope.ratio"].change, both["slope.ratio"].reason) == ("not comparable", "only A has it")


def test_nothing_estimated_is_nothing_compared():
    keys = calibration()["parameters"]
    blank = calibration(**{key: estimate(1.0, 1.0, "unobserved") for key in keys})
    assert not compare_calibrations(saved(blank), saved(calibration()), 3.0).comparable
    assert compare_calibrations(saved(calibration()), saved(calibration()), 3.0).comparable


def test_shared_data_is_told():
    a, b = calibration("a"), calibration("b")
    assert "both are of the same data" in remarks(with_inputs(a, "x", "y"), with_inputs(b, "x", "y"))
    assert "share 1 files of data (2 in A, 3 in B)" in remarks(with_inputs(a, "x", "y"), with_inputs(b, "x", "z", "w"))
    assert remarks(with_inputs(a, "x"), with_inputs(b, "z")) == ""
    assert "not told" in remarks(a, with_inputs(b, "z"))
    assert remarks(a, b | {"started": "2026-05-02T12:00:00Z"}) == ""


def test_without_hashes_names_may_tell():
    assert "both have the run yard, by its name" in remarks(calibration("yard"), vehicle())
    assert "2 runs, by its name" in remarks(vehicle(), vehicle())
    assert "two vehicles: demo and other" in remarks(calibration(), calibration(vehicle="other"))


def test_options_that_differ_are_told():
    a = with_inputs(calibration(), "x", window="30")
    b = with_inputs(calibration(), "x", window="60", effects="lever_arm")
    assert "options differ: window 30 and 60, effects not told and lever_arm" in remarks(a, b)


def test_the_text_gives_the_change_first():
    a, b = calibration(track_m=estimate(0.70, 1e-3)), calibration(track_m=estimate(0.71, 1e-3))
    b["outage"]["end_rms_m"] = 0.16
    comparison = compare_calibrations(saved(a), saved(b), 3.0)
    assert headline(comparison) == "1 of 4 parameters changed by more than 3 sigma: track"
    lines = compare_text(comparison, 80).splitlines()
    assert lines[0] == headline(comparison)
    (track,) = [line for line in lines if line.startswith("track mm")]
    assert track.split() == ["track", "mm", "700.0", "±1.0", "710.0", "±1.0", "+10.0", "±1.4", "+7.1", "changed"]
    assert max(map(len, lines)) <= 80
    assert any(line.split() == ["outage.end_rms_m", "0.0800", "0.160", "2.00"] for line in lines)


def test_the_json_is_the_same_comparison():
    a, b = calibration(track_m=estimate(0.70, 3e-3)), calibration(track_m=estimate(0.71, 4e-3))
    document = document_of(compare_calibrations(saved(a), saved(b), 1.0))
    assert (document["schema"], document["kind"]) == ("sccal.comparison/1", "calibration")
    assert document["changed"] == ["parameters.track_m"]
    track = next(one for one in document["parameters"] if one["name"] == "parameters.track_m")
    assert (track["difference"], track["sigma"], track["in_sigmas"]) == pytest.approx((0.01, 5e-3, 2.0))
    assert {"name": "outage.rms_m", "a": 0.05, "b": 0.05} in document["figures"]
