"""Codes of quality that scatter otherwise than GGA's meaning are told and not believed; honest ones are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sccal.align.aligned import Aligned, align
from sccal.logs.streams import Run
from tests.align.test_scale import run

SECOND_HALF = 0.6


def coded(good: int, other: int, wander_m: float = 0.7, sigma_m: float = np.nan) -> Run:
    """A drive whose last part wanders under another code."""
    of = run()
    fixes, rng = of.fixes, np.random.default_rng(3)
    size = fixes.lat_deg.size
    wanders = np.arange(size) > SECOND_HALF * size
    steps = rng.standard_normal((2, size)) * wander_m * np.sqrt(2.0 * 0.2 / 100.0) * wanders
    lat, lon = np.cumsum(steps, axis=1) / 111_000.0 + rng.standard_normal((2, size)) * 0.006 / 111_000.0
    sigma = np.full(size, sigma_m)
    return replace(
        of,
        fixes=replace(
            fixes,
            lat_deg=fixes.lat_deg + lat,
            lon_deg=fixes.lon_deg + lon,
            quality=np.where(wanders, other, good),
            sigma_east_m=sigma,
            sigma_north_m=sigma,
        ),
    )


def doubts(aligned: Aligned) -> list[str]:
    return [notice.doubt for notice in aligned.notices if notice.doubt]


@pytest.mark.parametrize(("good", "other"), [(1, 5), (6, 3), (2, 5), (1, 4)])
def test_a_code_that_says_worse_and_scatters_less_is_told_and_the_other_left_out(good: int, other: int) -> None:
    aligned = align(coded(good, other))
    (doubt,) = doubts(aligned)
    assert doubt.startswith(f"the quality codes are not GGA's: {good}, in GGA ")
    assert aligned.fix_t_s.size == pytest.approx(SECOND_HALF * 1000, abs=2)
    assert np.sqrt(aligned.fix_var_east_m2).max() < 0.02


@pytest.mark.parametrize(("good", "other"), [(4, 1), (4, 5), (5, 1), (4, 3), (4, 4)])
def test_codes_in_the_order_of_their_scatter_are_believed(good: int, other: int) -> None:
    aligned = align(coded(good, other))
    assert doubts(aligned) == []
    assert aligned.fix_t_s.size == 1000


def test_codes_that_scatter_alike_are_believed() -> None:
    assert doubts(align(coded(5, 4, wander_m=0.0))) == []


def test_dead_reckoning_is_left_out_as_before_where_nothing_speaks_for_another_maker() -> None:
    assert doubts(align(coded(4, 6))) == []


def test_stated_errors_come_before_codes() -> None:
    assert doubts(align(coded(1, 5, sigma_m=0.02))) == []
