"""A heading from the receiver: turned into enu by its own convention, and put on the logging clock as the fixes are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align import align
from sccal.align.clocks import fixes_on_host_clock
from sccal.errors import DataError
from sccal.logs.streams import Convention, HeadingStream, Run


def from_the_receiver(run: Run, mirrored: bool = False) -> Run:
    """The same reading as a compass, at the fixes' epochs; its provisional times are nonsense of half a second."""
    fixes = run.fixes
    t_s, _, _ = fixes_on_host_clock(fixes, (run.wheels.t_s[0], run.wheels.t_s[-1]))
    enu = np.interp(t_s, run.heading.t_s, np.unwrap(run.heading.yaw_rad))
    compass = np.mod(enu if mirrored else 0.5 * np.pi - enu, 2 * np.pi)
    heading = HeadingStream(
        t_s=t_s + 0.5, yaw_rad=compass, utc_s=fixes.utc_s, convention="ned", source="gnss.nmea (HDT)"
    )
    return replace(run, heading=heading)


@pytest.mark.parametrize("convention", ["enu", "ned"])
def test_whatever_the_vehicle_declares_a_compass_turns_clockwise_from_north(
    simulate, streams, convention: Convention
) -> None:
    run = streams(simulate())
    aligned = align(run)
    same = align(from_the_receiver(replace(run, vehicle=replace(run.vehicle, convention=convention))))
    inside = (same.heading_t_s >= aligned.heading_t_s[0]) & (same.heading_t_s <= aligned.heading_t_s[-1])
    expected = np.interp(same.heading_t_s, aligned.heading_t_s, aligned.yaw_rad)
    apart = np.angle(np.exp(1j * (same.yaw_rad - expected)))[inside]
    assert np.abs(apart).max() < 1e-6


def test_its_epochs_are_mapped_as_the_fixes_are(simulate, streams) -> None:
    aligned = align(from_the_receiver(streams(simulate())))
    shared = np.isin(np.round(aligned.heading_t_s, 6), np.round(aligned.fix_t_s, 6))
    assert shared.sum() >= aligned.fix_t_s.size - 1


def test_a_mirrored_heading_is_not_blamed_on_the_vehicles_convention(simulate, streams) -> None:
    with pytest.raises(DataError, match=r"gnss\.nmea \(HDT\) do not turn clockwise from north") as caught:
        align(from_the_receiver(streams(simulate()), mirrored=True))
    assert "convention" not in str(caught.value)
