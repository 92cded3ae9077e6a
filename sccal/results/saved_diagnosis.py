"""diagnosis.json read again (schema ``sccal.diagnosis/1``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from sccal.errors import DataError
from sccal.results.document import read_document
from sccal.results.saved import PARAMETERS, Json, SavedEstimate, read_estimate

DIAGNOSIS_SCHEMA = "sccal.diagnosis/1"
DIAGNOSIS_FILE = "diagnosis.json"


@dataclass(frozen=True)
class SavedFinding:
    """One effect that the data hold and the model does not."""

    effect: str
    parameters: Mapping[str, SavedEstimate]
    evidence_nats: float | None
    """None where the file is of a version that did not tell it."""
    held_out_gain_nats: float | None
    t: float | None
    indistinguishable_from: tuple[str, ...]


@dataclass(frozen=True)
class SavedDiagnosis:
    """One diagnosis as its file tells it."""

    path: Path
    document: Json

    @property
    def vehicle(self) -> str:
        """Empty where the file does not tell."""
        return str(self.document.get("vehicle", ""))

    @property
    def runs(self) -> tuple[str, ...]:
        return tuple(str(run) for run in self.document["runs"])

    @property
    def findings(self) -> Mapping[str, SavedFinding]:
        """By effect, in the order in which they were added."""
        return {
            str(one["effect"]): SavedFinding(
                str(one["effect"]),
                {name: read_estimate({"status": "estimated", **block}) for name, block in one["parameters"].items()},
                one["evidence"].get("evidence_nats"),
                one["evidence"].get("held_out_gain_nats"),
                one["evidence"].get("t"),
                tuple(str(name) for name in one.get("indistinguishable_from", ())),
            )
            for one in self.document["findings"]
        }

    @property
    def parameters_after(self) -> Mapping[str, SavedEstimate]:
        """The model's parameters with the findings in it; those of PARAMETERS that the file tells."""
        blocks = self.document.get("parameters_after") or {}
        return {key: read_estimate(blocks[key]) for key in PARAMETERS if key in blocks}

    def judged(self, when: str) -> Mapping[str, float | None]:
        """The figures on held-out data, ``when`` = ``before`` or ``after`` the findings; single numbers only."""
        return {
            name: None if value is None else float(value)
            for name, value in self.document[when].items()
            if value is None or isinstance(value, int | float)
        }


def read_diagnosis(path: Path) -> SavedDiagnosis:
    """A diagnosis from its JSON file.

    Raises:
        DataError: the file is no diagnosis of the schema.
    """
    document, schema = read_document(path)
    if schema != DIAGNOSIS_SCHEMA:
        raise DataError(f"{path}: its schema is {schema!r}, not {DIAGNOSIS_SCHEMA}")
    saved = SavedDiagnosis(path, document)
    try:
        _ = saved.runs, saved.findings, saved.parameters_after, saved.judged("before"), saved.judged("after")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise DataError(f"{path}: not all of a diagnosis is there ({error!r}); diagnose again") from error
    return saved
