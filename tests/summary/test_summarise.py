"""A batch in one picture: nothing is lost, order does not matter, and what cannot be told is said."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sccal.errors import DataError, Failure, SccalError
from sccal.results.files import read_trajectory
from sccal.results.verdict import Verdict
from sccal.summary.paths import corners
from sccal.summary.summarise import summarise as summarised
from tests.results.documents import retold
from tests.summary.fleets import TRUE, estimate, history, of_vehicle, with_parameter, written


def summarise(runs, vehicles=None, failures=(), out=Path("out")):
    return summarised(runs, vehicles or {}, failures, out)


def charts(summary, vehicle=0):
    return {chart.key: chart for chart in summary.vehicles[vehicle].charts}


def trends(summary):
    return {
        (vehicle.label, chart.key): chart.trend
        for vehicle in summary.vehicles
        for chart in vehicle.charts
        if chart.trend is not None
    }


def test_a_wheel_that_wears_is_told_and_nothing_else():
    worn = history(16, change={"radius_left_m": np.linspace(0.0, -4e-4, 16)})
    found = trends(summarise(worn, of_vehicle(worn), []))
    assert list(found) == [("tracked-demo", "radius_left_m")]
    trend = found["tracked-demo", "radius_left_m"]
    assert trend.shape == "drift"
    assert trend.change == pytest.approx(-4e-4, abs=4 * trend.sigma)
    assert trend.days == pytest.approx(60.0)


def test_the_order_of_the_runs_does_not_matter():
    runs = history(12, change={"track_m": np.linspace(0.0, 0.01, 12)})
    failures = [Failure("z", DataError("no")), Failure("a", SccalError("bug"))]
    one = summarise(runs, of_vehicle(runs), failures)
    other = summarise(runs[::-1], of_vehicle(runs), failures[::-1])
    assert [run.run for run in one.runs] == [run.run for run in other.runs]
    assert one.failures == other.failures
    assert [(failed.run, failed.exit_code) for failed in one.failures] == [("a", 4), ("z", 3)]
    assert str(one.vehicles) == str(other.vehicles)


def test_runs_stand_in_order_of_their_dates_not_of_their_names():
    runs = history(10, change={"track_m": np.linspace(0.0, 0.02, 10)})
    renamed = [replace(one, run=f"{9 - k}") for k, one in enumerate(runs)]
    trend = trends(summarise(renamed))["tracked-demo", "track_m"]
    assert trend.change > 0.0


def test_without_dates_the_order_of_the_names_counts():
    runs = history(12, with_dates=False, change={"track_m": np.linspace(0.0, 0.02, 12)})
    chart = charts(summarise(runs))["track_m"]
    assert not chart.by_date
    assert chart.trend.days is None


def test_a_single_run_without_a_date_is_left_out_of_charts_by_date():
    runs = history(12)
    runs[4] = replace(runs[4], started="yesterday")
    chart = charts(summarise(runs))["track_m"]
    assert chart.by_date
    assert chart.left_out == 1
    assert runs[4].run not in chart.runs


@pytest.mark.parametrize("status", ["unobserved", "at_bound", "held"])
def test_only_what_was_estimated_takes_part(status):
    runs = history(10)
    runs[3] = with_parameter(runs[3], "track_m", estimate(9.0, 0.001, status))
    chart = charts(summarise(runs))["track_m"]
    assert len(chart.runs) == 9
    assert chart.left_out == 1
    assert chart.upper.max() < 1.0


def test_a_run_outside_the_limits_is_flagged():
    runs = history(20)
    far = estimate(runs[6].parameters.radius_right_m.value + 3e-4, 2.5e-5)
    runs[6] = with_parameter(runs[6], "radius_right_m", far)
    chart = charts(summarise(runs))["radius_right_m"]
    assert [run for run, out in zip(chart.runs, chart.outside, strict=True) if out] == [runs[6].run]


def test_offsets_that_belong_to_the_runs_have_no_chart_and_that_is_said():
    runs = history(8, change={"heading_offset_deg": np.linspace(0.0, 170.0, 8)})
    vehicle = summarise(runs).vehicles[0]
    assert "heading_offset_deg" not in {chart.key for chart in vehicle.charts}
    assert "belongs to each run" in {one.key: one.reason for one in vehicle.no_charts}["heading_offset_deg"]


def test_offsets_about_the_back_are_one_direction():
    runs = [
        with_parameter(run, "heading_offset_deg", estimate(179.9 if k % 2 else -179.9, 0.15))
        for k, run in enumerate(history(8))
    ]
    chart = charts(summarise(runs))["heading_offset_deg"]
    assert np.ptp(chart.value) == pytest.approx(0.2)


def test_effects_have_charts_too():
    runs = [
        retold(
            run,
            effects={
                "lever_arm": {"forward_m": estimate(0.3, 0.01), "left_m": estimate(-0.1 + 0.05 * k, 0.01)},
                "heading_step": {"deg": estimate(1.0, 0.1), "at_s": estimate(50.0, 1.0)},
            },
        )
        for k, run in enumerate(history(9))
    ]
    summary = summarise(runs)
    assert {"lever_arm.forward_m", "heading_step.deg"} <= set(charts(summary))
    assert "heading_step.at_s" not in charts(summary)
    assert list(trends(summary)) == [("tracked-demo", "lever_arm.left_m")]


def test_vehicles_of_one_name_stay_apart_by_their_files():
    first, second = history(5, prefix="a"), history(5, prefix="b", seed=3)
    summary = summarise(first + second, of_vehicle(first, "vehicle-x.json") | of_vehicle(second, "vehicle-x-2.json"))
    assert [(one.label, one.file, one.runs) for one in summary.vehicles] == [
        ("tracked-demo", "vehicle-x-2.json", 5),
        ("tracked-demo (2)", "vehicle-x.json", 5),
    ]
    assert {run.vehicle for run in summary.runs if run.run.startswith("a")} == {"tracked-demo (2)"}


@pytest.mark.parametrize("count", [0, 1, 3])
def test_few_runs_make_a_summary_too(count):
    runs = history(count)
    summary = summarise(runs, of_vehicle(runs) if runs else {}, [Failure("x", DataError("empty"))])
    assert summary.totals.runs == count + 1
    assert (summary.totals.good, summary.totals.failed) == (count, 1)
    assert not trends(summary)
    assert summary.totals.duration_s == 300.0 * count


def test_verdicts_are_counted(tmp_path):
    levels = ("partial", "doubtful", "good")
    runs = [replace(run, verdict=Verdict(level, ("why",))) for run, level in zip(history(3), levels, strict=True)]
    totals = summarise(runs).totals
    assert (totals.good, totals.partial, totals.doubtful, totals.failed) == (1, 1, 1, 0)


def test_paths_are_read_thinly_and_a_missing_one_is_empty(tmp_path):
    runs = history(3)
    written(runs, tmp_path, rows=3000)
    (tmp_path / runs[1].run / "trajectory.csv").unlink()
    (tmp_path / runs[2].run / "trajectory.csv").write_text("t,east_m\n1,2\n")
    summary = summarise(runs, out=tmp_path)
    whole = read_trajectory(tmp_path / runs[0].run)
    path = summary.runs[0].path
    assert 2 < len(path.east_m) <= 160
    assert path.east_m[[0, -1]].tolist() == whole.east_m[[0, -1]].tolist()
    assert [len(run.path.east_m) for run in summary.runs[1:]] == [0, 0]


def test_corners_keep_every_point_near_the_line():
    rng = np.random.default_rng(0)
    yaw = np.cumsum(rng.normal(0.0, 0.1, 600))
    east, north = np.cumsum(np.cos(yaw)), np.cumsum(np.sin(yaw))
    kept = np.flatnonzero(corners(east, north, 10_000))
    extent = max(np.ptp(east), np.ptp(north))
    for first, last in pairwise(kept):
        between = np.arange(first, last + 1)
        along = np.array([east[last] - east[first], north[last] - north[first]])
        offsets = np.column_stack([east[between] - east[first], north[between] - north[first]])
        share = np.clip(offsets @ along / (along @ along), 0.0, 1.0)
        assert np.linalg.norm(offsets - share[:, None] * along, axis=1).max() <= extent / 250 + 1e-9
    assert corners(east, north, 12).sum() <= 12


@pytest.mark.parametrize(
    "points", [[], [1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0, 1.0, 0.0]], ids=["none", "one", "standing", "there and back"]
)
def test_corners_of_odd_paths(points):
    east = np.array(points)
    kept = corners(east, np.zeros(len(points)), 100)
    assert kept.sum() >= min(2, len(points))
    if len(points) == 5:
        assert kept.all()


def test_a_trajectory_read_thinly_is_some_of_its_rows(tmp_path):
    runs = history(1)
    written(runs, tmp_path, rows=1001)
    whole = read_trajectory(tmp_path / runs[0].run)
    for most in (1, 2, 7, 600, 5000):
        thin = read_trajectory(tmp_path / runs[0].run, most)
        assert len(thin.t_s) <= max(most, 2)
        assert thin.t_s[-1] == whole.t_s[-1]
        assert np.isin(thin.east_m, whole.east_m).all()
    assert len(read_trajectory(tmp_path / runs[0].run, 5000).t_s) == 1001


def test_the_truth_of_the_fleet_is_within_its_limits():
    summary = summarise(history(30, seed=9), [], [])
    for key, chart in charts(summary).items():
        assert abs(chart.centre - TRUE[key]) < 3 * chart.sigma[0] / np.sqrt(15)
        assert chart.outside.sum() <= 1
