"""May these numbers be used? One answer with its reasons, as every report and every gate repeats it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast, get_args

Level = Literal["good", "partial", "doubtful"]


@dataclass(frozen=True)
class Verdict:
    """good: use it. partial: use what is there. doubtful: find out why before using it."""

    level: Level
    because: tuple[str, ...]
    meaning: str = ""
    """What the level means for this kind of result, where the level alone does not say it."""

    def __str__(self) -> str:
        return f"{self.headline}: {'; '.join(self.because)}"

    @property
    def headline(self) -> str:
        """The level, and what it means here."""
        return f"{self.level} – {self.meaning}" if self.meaning else self.level

    @classmethod
    def from_text(cls, text: str) -> Verdict:
        """From its text in a file. Raises ValueError where the text begins with none of the levels."""
        headline, _, because = text.partition(": ")
        level, _, meaning = headline.partition(" – ")
        if level not in get_args(Level):
            raise ValueError(f"must begin with one of {', '.join(get_args(Level))}, not {text!r:.40}")
        return cls(cast(Level, level), tuple(because.split("; ")) if because else (), meaning)
