"""The timeline: nothing of the wheels' motion is lost, and every measurement stands exactly at its time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sccal.align import align, build_timeline, clear_steps
from sccal.align.timeline import LOOSE_FLOOR_M, LOOSE_FRACTION, thin

RADIUS_M = 0.08
gaps_s = st.lists(st.integers(1, 400), min_size=12, max_size=60)
steps_rad = st.floats(-3.0, 3.0, allow_subnormal=False)


def times(gaps: list[int]) -> np.ndarray:
    """Strictly increasing times in milliseconds, so that streams often share a time."""
    return np.cumsum(gaps) / 1000.0


@st.composite
def logs(draw):
    wheel_t_s = times(draw(gaps_s))
    steps = draw(st.lists(st.tuples(steps_rad, steps_rad, st.booleans()), min_size=wheel_t_s.size, max_size=60))
    right, left, loose = (np.array(column[: wheel_t_s.size]) for column in zip(*steps, strict=True))

    def inside(t_s: np.ndarray) -> np.ndarray:
        return t_s[(t_s >= wheel_t_s[0]) & (t_s <= wheel_t_s[-1])]

    right_rad, left_rad = np.cumsum(right), np.cumsum(left)
    return {
        "wheel_t_s": wheel_t_s,
        "right_rad": right_rad - right_rad[0],
        "left_rad": left_rad - left_rad[0],
        "loose": loose.astype(bool),
        "heading_t_s": inside(times(draw(gaps_s))),
        "fix_t_s": inside(times(draw(gaps_s))),
    }


@given(logs())
@settings(max_examples=60)
def test_increments_add_up_to_the_whole_angle(aligned_by_hand, log):
    timeline = build_timeline(aligned_by_hand(**log), heading_rate_hz=np.inf, fix_rate_hz=np.inf)
    for steps, cumulative in ((timeline.right_rad, log["right_rad"]), (timeline.left_rad, log["left_rad"])):
        assert steps[0] == 0.0
        assert steps.sum() == pytest.approx(cumulative[-1], abs=1e-9)
        at_events = np.interp(timeline.t_s, log["wheel_t_s"], cumulative)
        assert np.max(np.abs(np.cumsum(steps) - at_events)) < 1e-9


@given(logs())
@settings(max_examples=60)
def test_every_measurement_has_one_row_at_its_own_time(aligned_by_hand, log):
    aligned = aligned_by_hand(**log)
    assume(not aligned.standing_s)
    timeline = build_timeline(aligned, heading_rate_hz=np.inf, fix_rate_hz=np.inf)
    assert np.all(np.diff(timeline.t_s) > 0)
    assert (timeline.t_s[0], timeline.t_s[-1]) == (log["wheel_t_s"][0], log["wheel_t_s"][-1])
    assert np.isin(log["wheel_t_s"], timeline.t_s).all()
    for rows, t_s in (
        (timeline.heading_row, log["heading_t_s"][timeline.heading_index]),
        (timeline.fix_row, log["fix_t_s"][timeline.fix_index]),
        (timeline.out_row, timeline.out_t_s),
    ):
        events = np.flatnonzero(rows >= 0)
        assert rows[events].tolist() == list(range(t_s.size))
        assert timeline.t_s[events].tolist() == t_s.tolist()
    assert timeline.heading_index.size == log["heading_t_s"].size
    assert timeline.fix_index.size == log["fix_t_s"].size


@given(logs())
@settings(max_examples=60)
def test_loose_variance_adds_up(aligned_by_hand, log):
    timeline = build_timeline(aligned_by_hand(**log))
    expected = 0.0
    for i in range(1, log["wheel_t_s"].size):
        if log["loose"][i]:
            longest = max(abs(np.diff(log[side])[i - 1]) for side in ("right_rad", "left_rad")) * RADIUS_M
            expected += (LOOSE_FRACTION * longest + LOOSE_FLOOR_M) ** 2
    assert timeline.loose_m2.sum() == pytest.approx(expected, abs=1e-12)
    assert timeline.loose_m2.min() >= 0.0


def test_loose_variance_stands_between_the_two_samples(aligned_by_hand):
    t_s = np.arange(20.0)
    loose = t_s == 8.0
    wheels = 2.0 * t_s
    timeline = build_timeline(aligned_by_hand(t_s, wheels, wheels, t_s, t_s, loose), output_rate_hz=4.0)
    rows = np.flatnonzero(timeline.loose_m2)
    assert timeline.t_s[rows].tolist() == [7.25, 7.5, 7.75, 8.0]
    assert timeline.loose_m2[rows] == pytest.approx((0.25 * 2.0 * RADIUS_M + 0.02) ** 2 / 4)


@given(logs(), st.floats(0.0, 0.45), st.floats(0.55, 1.0))
@settings(max_examples=60)
def test_a_part_holds_only_what_is_between_its_ends(aligned_by_hand, log, begin, end):
    whole_s = log["wheel_t_s"][-1] - log["wheel_t_s"][0]
    inside = (float(log["wheel_t_s"][0] + share * whole_s) for share in (begin, end))
    first, last = (min(at_s, float(log["wheel_t_s"][-1])) for at_s in inside)
    aligned = aligned_by_hand(**log)
    assume(not aligned.standing_s)
    timeline = build_timeline(aligned, heading_rate_hz=np.inf, fix_rate_hz=np.inf, between_s=(first, last))
    assert (timeline.t_s[0], timeline.t_s[-1]) == (first, last)
    for index, t_s in ((timeline.heading_index, log["heading_t_s"]), (timeline.fix_index, log["fix_t_s"])):
        assert index.tolist() == np.flatnonzero((t_s >= first) & (t_s <= last)).tolist()
    assert np.all((timeline.out_t_s >= first) & (timeline.out_t_s <= last))
    turned = np.diff(np.interp([first, last], log["wheel_t_s"], log["right_rad"]))[0]
    assert timeline.right_rad.sum() == pytest.approx(turned, abs=1e-9)


def test_a_part_ends_where_the_run_ends(aligned_by_hand):
    t_s = np.arange(30) * 0.5
    timeline = build_timeline(aligned_by_hand(t_s, t_s, t_s, t_s, t_s), between_s=(-100.0, 100.0))
    assert (timeline.t_s[0], timeline.t_s[-1]) == (t_s[0], t_s[-1])


def test_outputs_stand_on_whole_multiples(aligned_by_hand):
    t_s = 1717243200.03 + np.arange(100) * 0.05
    timeline = build_timeline(aligned_by_hand(t_s, t_s, t_s, t_s, t_s), output_rate_hz=4.0)
    assert timeline.out_t_s.tolist() == [1717243200.25 + 0.25 * i for i in range(19)]


@given(
    st.floats(1.0, 500.0),
    st.floats(0.5, 100.0),
    st.integers(2, 400),
)
def test_thinning_keeps_order_and_hardly_more_than_the_rate(stream_hz, asked_hz, count):
    t_s = np.arange(count) / stream_hz
    index = thin(t_s, asked_hz)
    assert index[0] == 0
    assert np.all(np.diff(index) > 0)
    assert np.unique(np.diff(index)).size <= 1
    if index.size > 1:
        kept_hz = 1.0 / (t_s[index[1]] - t_s[index[0]])
        assert kept_hz <= 1.12 * asked_hz
        assert kept_hz >= min(stream_hz, asked_hz) / 2.0 * (1 - 1e-9)


@pytest.mark.parametrize(("stream_hz", "kept_hz"), [(50.0, 10.0), (100.0, 10.0), (10.0, 10.0), (5.0, 5.0)])
def test_whole_multiples_are_thinned_to_the_rate_asked_for(stream_hz, kept_hz):
    t_s = np.arange(200) / stream_hz
    assert 1.0 / np.diff(t_s[thin(t_s, 10.0)]) == pytest.approx(kept_hz)


def test_jitter_does_not_halve_a_stream_at_the_rate_asked_for():
    t_s = np.arange(200) * 0.0998
    assert thin(t_s, 10.0).size == 200


@pytest.mark.parametrize("stream_hz", [12.5, 14.0, 24.0])
def test_thinning_keeps_at_most_the_rate(stream_hz):
    t_s = np.arange(400) / stream_hz
    assert 1.0 / np.diff(t_s[thin(t_s, 10.0)]).min() < 11.0


def test_nothing_to_thin():
    assert thin(np.zeros(0), 10.0).tolist() == []
    assert thin(np.zeros(1), 10.0).tolist() == [0]
    assert thin(np.arange(5) * 0.001, np.inf).tolist() == [0, 1, 2, 3, 4]


def test_thinned_wheels_still_predict_to_every_measurement(simulate, streams):
    aligned = align(streams(simulate()))
    fine, coarse = build_timeline(aligned), build_timeline(aligned, wheel_rate_hz=2.0)
    assert coarse.t_s.size < fine.t_s.size
    assert coarse.right_rad.sum() == pytest.approx(fine.right_rad.sum())
    assert coarse.heading_index.tolist() == fine.heading_index.tolist()


def test_clear_steps_stand_at_the_events_and_add_up(simulate, streams):
    aligned = align(streams(simulate()))
    timeline = build_timeline(aligned)
    right, left = clear_steps(aligned, timeline, 1.0)
    assert right.shape == left.shape == timeline.t_s.shape
    assert right[0] == left[0] == 0.0
    assert (right + left).sum() == pytest.approx((timeline.right_rad + timeline.left_rad).sum(), abs=0.02)


def test_clear_steps_of_a_part_do_not_see_the_rest(simulate, streams):
    aligned = align(streams(simulate()))
    middle_s = sum(aligned.span_s) / 2
    timeline = build_timeline(aligned, between_s=(middle_s, aligned.span_s[1]))
    right, _ = clear_steps(aligned, timeline, 1.0)
    assert right.sum() == pytest.approx(timeline.right_rad.sum(), abs=0.3)


@pytest.mark.parametrize(("speed_mps", "kept"), [(0.0, 1), (0.005, 1), (0.05, 40)])
def test_a_place_that_repeats_while_the_robot_stays_there_counts_once(aligned_by_hand, speed_mps, kept):
    """A pivot: the wheels turn, the middle between them rests, and a receiver may hold what it had."""
    wheel_t_s, fix_t_s = np.arange(0.0, 10.0, 0.05), np.arange(3.0, 7.0, 0.1)
    along, turning = speed_mps * wheel_t_s / RADIUS_M, 4.0 * wheel_t_s
    aligned = aligned_by_hand(wheel_t_s, along + turning, along - turning, fix_t_s, fix_t_s)
    held = replace(aligned, fix_east_m=np.zeros(fix_t_s.size))
    assert aligned.standing_s == ()
    assert build_timeline(held).fix_index.size == kept
    assert build_timeline(aligned).fix_index.size == fix_t_s.size
