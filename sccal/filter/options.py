"""What a user may choose about the filter. Defaults scale with the vehicle's nominal values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class FilterOptions:
    """Priors, random walks and gates of the self-calibrating filter."""

    with_offset: bool = True
    """False: the paper's SC EKF, h = θ; True: the variant with the heading offset as a state, h = θ + Ofs."""
    radius_prior: float = 0.10
    """Prior standard deviation of each wheel radius, as a share of the nominal one."""
    radius_difference_prior: float = 0.04
    """Prior standard deviation of R_r − R_l as a share of the nominal radius: two wheels of one make are more like each
    other than like the data sheet. Without it a straight drive could be a fast spin, as far as the filter knows."""
    track_prior: float = 0.30
    """The same for the track width: tracks and skidding wheels turn on a wider one than the tape measure shows."""
    offset_prior_rad: float = np.pi / np.sqrt(3.0)
    """Standard deviation of a uniform distribution over the circle: nothing is known."""
    radius_walk: float = 1e-6
    """Random walk of each radius per root second, as a share of the nominal one."""
    track_walk: float = 3e-6
    offset_walk_rad: float = np.radians(0.002)
    """Random walk of the heading offset per root second."""
    gate_sigmas: float = 5.0
    """Measurements further than this from the prediction are rejected (a fix: at the same probability in two axes)."""
    soft_gate: bool = False
    """Weigh measurements by their probability of being no outlier, instead of gating: a smooth likelihood."""
    recover_count: int = 5
    """So many rejected in a row …"""
    recover_s: float = 3.0
    """… over so long: the filter, not the measurements, is wrong; it opens up again."""
    radius_bounds: tuple[float, float] = (0.5, 2.0)
    """Physical bounds as multiples of the nominal radius: beyond, the declaration is wrong, not the wheel worn."""
    track_bounds: tuple[float, float] = (0.3, 4.0)
