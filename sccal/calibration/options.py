"""What a user may choose about a calibration."""

from __future__ import annotations

from dataclasses import dataclass, field

from sccal.align import Aligned
from sccal.calibration.judged_model import free_effects
from sccal.evidence.extension import FreeEffects
from sccal.filter.options import FilterOptions
from sccal.results.model import JudgedModel
from sccal.results.noise import Noise


@dataclass(frozen=True)
class CalibrationOptions:
    """Options of one calibration; the filter's own are inside."""

    filter: FilterOptions = field(default_factory=FilterOptions)
    outage_window_s: float = 30.0
    output_rate_hz: float = 10.0
    heading_rate_hz: float = 10.0
    """Readings beyond this rate are left out: an AHRS's error changes more slowly."""
    noise: Noise | None = None
    """None: estimated from the log."""
    withhold_s: tuple[tuple[float, float], ...] = ()
    """Windows whose fixes judge and do not teach; in the log's own time, or from its start."""
    effects: tuple[str, ...] = ()
    """Names of effects beyond the paper's model that the filter estimates too."""
    model: JudgedModel | None = None
    """A model that was judged by a diagnosis: its effects, in its shapes, and the noise of the runs that it knows."""

    @property
    def has_effects(self) -> bool:
        """Whether anything is estimated beyond the paper's model."""
        return bool(self.effects) or (self.model is not None and bool(self.model.effects))

    def extension(self, aligned: Aligned) -> FreeEffects | None:
        """The effects to estimate in one run; None for none.

        Raises:
            UsageError: for an effect that does not exist, or that needs a search.
            DataError: where the log lacks the column that an effect is named by.
        """
        named = FreeEffects.named(self.effects, aligned)
        judged = () if self.model is None else free_effects(self.model, aligned)
        known = {free.effect.name for free in judged}
        rest = () if named is None else tuple(free for free in named.effects if free.effect.name not in known)
        return FreeEffects((*judged, *rest)) if judged or rest else None

    def noise_of(self, run: str) -> Noise | None:
        """The noise to take for one run; None where it has to be estimated."""
        if self.noise is not None or self.model is None:
            return self.noise
        return self.model.noises.get(run)
