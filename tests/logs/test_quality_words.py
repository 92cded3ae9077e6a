"""Qualities in words and in makers' numbers, as far as they are known by themselves."""

from __future__ import annotations

from pathlib import Path

import pytest

from sccal.logs.gnss_csv import read_gnss_csv
from sccal.logs.quality_words import qualities_of_words

ROWS = 6


@pytest.mark.parametrize(
    ("column", "codes", "qualities"),
    [
        ("fix_quality", ("RTK_FIXED", "SINGLE"), (4, 1)),
        ("fix_quality", ("NARROW_INT", "NARROW_FLOAT"), (4, 5)),
        ("fix_quality", ("fix", "float"), (4, 5)),
        ("fix_quality", ("50", "16"), (4, 1)),
        ("Q", ("1", "5"), (4, 1)),
        ("fix_quality", ("4", "5"), (4, 5)),
    ],
)
def test_qualities_of_others_are_read_and_told(
    tmp_path: Path, column: str, codes: tuple[str, str], qualities: tuple[int, int]
) -> None:
    rows = "".join(f"{i},52.0,5.00000{i},{codes[i % 2]}\n" for i in range(ROWS))
    (tmp_path / "gnss.csv").write_text(f"t,lat_deg,lon_deg,{column}\n{rows}")
    fixes, notices = read_gnss_csv(tmp_path / "gnss.csv")
    assert fixes.quality.tolist() == [*qualities] * (ROWS // 2)
    assert bool(notices) == (codes != ("4", "5"))


def test_words_that_are_not_known_are_not_guessed() -> None:
    assert qualities_of_words(["green", "fixed"]) is None
    assert qualities_of_words(["fix"]) == {"fix": -1}
