"""The rows that every table of parameters shows, in display units: the text, the page and the JSON agree by this."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from sccal.results.calibration import Estimate, Parameters, Status
from sccal.results.numbers import MISSING, change_percent, one_line, short, value_and_sigma, with_sigma

STATUS_WORDS: Mapping[Status, str] = {
    "estimated": "estimated",
    "unobserved": "not observed",
    "at_bound": "at bound",
    "held": "held",
}

UNSEEN = "-"

_UNITS = ("deg_per_hour", "deg_per_mps", "per_radps", "per_mps2", "per_mps", "per_hour", "deg", "ppm", "at_s", "m", "s")


@dataclass(frozen=True)
class Row:
    """One parameter, its angles in degrees."""

    key: str
    """As in calibration.json: ``radius_right_m``."""
    name: str
    unit: str
    estimate: Estimate

    @property
    def seen(self) -> bool:
        """False where the value is only the prior, which must not be shown as if it were a result."""
        return self.estimate.status != "unobserved"

    @property
    def value(self) -> str:
        """Without unit, rounded by sigma."""
        return value_and_sigma(self.estimate.value, self.estimate.sigma)[0] if self.seen else UNSEEN

    @property
    def sigma(self) -> str:
        return value_and_sigma(self.estimate.value, self.estimate.sigma)[1] if self.seen else ""

    @property
    def value_with_sigma(self) -> str:
        return with_sigma(self.estimate.value, self.estimate.sigma) if self.seen else UNSEEN

    @property
    def nominal(self) -> str:
        return "" if self.estimate.nominal is None else short(self.estimate.nominal)

    @property
    def change(self) -> str:
        if self.estimate.nominal is None or self.unit == "deg" or not self.seen:
            return ""
        text = change_percent(self.estimate.value, self.estimate.sigma, self.estimate.nominal)
        return "" if text == MISSING else text

    @property
    def status(self) -> str:
        return STATUS_WORDS[self.estimate.status]

    @property
    def reason(self) -> str:
        return one_line(self.estimate.reason)


def parameter_rows(parameters: Parameters) -> tuple[Row, Row, Row, Row]:
    """The four constants of the paper's state, the heading offset in degrees."""
    names = ("right radius", "left radius", "track", "heading offset")
    units = ("m", "m", "m", "deg")
    right, left, track, offset = (
        Row(key, name, unit, estimate)
        for (key, estimate), name, unit in zip(parameters.by_key.items(), names, units, strict=True)
    )
    return right, left, track, offset


def effect_rows(effects: Mapping[str, Mapping[str, Estimate]]) -> tuple[Row, ...]:
    """Effects beyond the model; their parameters' names already carry the unit of a file."""
    return tuple(
        Row(f"{effect}.{name}", f"{effect} {_without_unit(name)}".replace("_", " ").strip(), _unit_of(name), estimate)
        for effect, parameters in effects.items()
        for name, estimate in parameters.items()
    )


def _without_unit(name: str) -> str:
    unit = _unit_of(name)
    return "" if name == unit else name.removesuffix(f"_{unit}")


def _unit_of(name: str) -> str:
    for unit in _UNITS:
        if name == unit or name.endswith(f"_{unit}"):
            return "s" if unit == "at_s" else unit
    return ""
