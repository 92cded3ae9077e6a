"""What a diagnosis found, with everything that a report needs: reports compute nothing.

Angles are in radians here, but for effects' parameters, which are in the files' units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from sccal.arrays import Floats
from sccal.logs.streams import Notice, Vehicle
from sccal.results.calibration import Estimate, OutageWindow, Parameters
from sccal.results.model import JudgedModel, Measured, RunNoise, measured, unmeasured


@dataclass(frozen=True)
class Picture:
    """A residual against what it follows, before and after; all arrays are short enough to draw every point."""

    x_label: str
    """With unit: "turn rate, deg/s"."""
    y_label: str
    """With unit: "heading residual, deg"."""
    x: Floats
    """(k,) bin centres, or single points where there is no repetition."""
    before: Floats
    """(k,) mean residual without the effect."""
    before_sigma: Floats
    """(k,) standard error of that mean."""
    after: Floats
    """(k,) mean residual with the effect in the model."""
    after_sigma: Floats
    model: Floats
    """(k,) what the effect adds there, as fitted."""


@dataclass(frozen=True)
class Ranked:
    """One candidate as it stood when a finding was made."""

    name: str
    title: str
    named: bool
    """False for a pattern without a name."""
    evidence_nats: float
    t: float
    size: float
    """Largest parameter in units of the smallest size that matters."""

    WRITTEN: ClassVar[str] = "effect=name title named evidence_nats t size"


@dataclass(frozen=True)
class Finding:
    """One effect that was added to the model, in the order in which it was."""

    name: str
    title: str
    reference: str
    parameters: Mapping[str, Estimate]
    units: Mapping[str, str]
    """Of each parameter, "1" for ratios."""
    evidence_nats: float
    """What it brings beside the others, the price of its own freedom paid (a logarithm of odds)."""
    held_out_gain_nats: float
    t: float
    indistinguishable_from: tuple[str, ...]
    """Other effects that explain the same on this drive."""
    advice: str
    """What to drive to tell them apart; empty where nothing else explains it."""
    ranking: tuple[Ranked, ...]
    """The best candidates at that moment, best first; the chosen one among them."""
    drift_before_m: float | None
    """End of the outage windows, rms, held out, before and after this step."""
    drift_after_m: float | None
    picture: Picture | None
    per_run: Mapping[str, tuple[Estimate, ...]] = field(default_factory=dict)
    """Of each parameter that every run has its own of, in the order of the runs; ``parameters`` has their mean."""
    aligned: bool = False
    """Whether all of it was found, and put right, when the streams were brought onto one clock, before any fit."""

    WRITTEN: ClassVar[str] = (
        "effect=name! title reference parameters=measured "
        "evidence=(evidence_nats held_out_gain_nats t) indistinguishable_from aligned per_run advice "
        "drift_before_m drift_after_m ranking picture"
    )

    @property
    def measured(self) -> Mapping[str, Measured]:
        """The parameters, each with its unit."""
        return measured(self.parameters, self.units)

    @staticmethod
    def further(_: Mapping[str, Any], part: Any) -> dict[str, Any]:
        """What a document tells in other words."""
        parameters, units = unmeasured(part("parameters", Mapping[str, Measured]))
        return {"parameters": parameters, "units": units}


@dataclass(frozen=True)
class NotExcited:
    """An effect that this drive could not have shown."""

    name: str
    title: str
    advice: str

    WRITTEN: ClassVar[str] = "effect=name title advice"


@dataclass(frozen=True)
class Detectable:
    """The smallest size of an effect that this drive would have shown."""

    name: str
    title: str
    smallest: Mapping[str, float]
    """By parameter, in the files' units."""
    units: Mapping[str, str]

    WRITTEN: ClassVar[str] = "effect=name title smallest units"


@dataclass(frozen=True)
class Inseparable:
    """Effects that this drive cannot tell apart, whichever of them is there."""

    names: tuple[str, ...]
    advice: str

    WRITTEN: ClassVar[str] = "effects=names advice"


@dataclass(frozen=True)
class Judgement:
    """One model on data that did not fit it."""

    windows: tuple[OutageWindow, ...]
    window_s: float
    outage_rms_m: float | None
    outage_end_rms_m: float | None
    outage_end_interval_m: tuple[float, float] | None
    """Where the end drift lies with 90 % (bootstrap over windows)."""
    gnss_innovation_rms_m: float
    heading_innovation_rms_rad: float
    nll_per_measurement: float

    WRITTEN: ClassVar[str] = (
        "outage_rms_m outage_end_rms_m outage_end_interval_m window_s windows=count gnss_innovation_rms_m "
        "heading_innovation_rms_rad nll_per_measurement"
    )

    @property
    def count(self) -> int:
        """How many windows there are."""
        return len(self.windows)


@dataclass(frozen=True)
class Unexplained:
    """What is left and has no name."""

    significant: bool
    port: str | None = None
    """heading, along, turn, side, antenna_forward, antenna_left, east or north; None where nothing is significant."""
    depends_on: str | None = None
    variance_fraction: float = 0
    """Share of the error variance at that port that the pattern holds."""
    evidence_nats: float = 0
    t: float = 0
    size: str | None = None
    """In words: "up to 2.1 deg"."""
    picture: Picture | None = None


@dataclass(frozen=True)
class Placebo:
    """The same test on nonsense columns: this log's own false alarms."""

    tried: int
    passed: int
    highest_nats: float
    """Most evidence that a nonsense column brought."""
    needed_nats: float
    """What a finding needs, at least."""


@dataclass(frozen=True)
class Diagnosis:
    """The whole story of some runs of one vehicle."""

    runs: tuple[str, ...]
    vehicle: Vehicle
    trust: str
    """How the measurements were trusted, in a sentence."""
    findings: tuple[Finding, ...]
    taken_back: Mapping[str, str]
    """Candidates that passed the test and were taken back, and why."""
    not_excited: tuple[NotExcited, ...]
    detectable: tuple[Detectable, ...]
    inseparable: tuple[Inseparable, ...]
    before: Judgement
    after: Judgement
    held_out_how: str
    unexplained: Unexplained
    placebo: Placebo
    parameters_before: Parameters
    parameters_after: Parameters
    noises: tuple[RunNoise, ...]
    notices: tuple[Notice, ...]
    model: JudgedModel
    """The model of ``after``, for other commands to start from."""

    SCHEMA: ClassVar[str] = "sccal.diagnosis/1"
    WRITTEN: ClassVar[str] = (
        "vehicle runs! trust findings! taken_back not_excited detectable inseparable before! after! "
        "held_out=(how=held_out_how) unexplained placebo parameters_before parameters_after noise=noises notices"
    )
