"""report.pdf: whole, the same each time, and nothing beyond the paper."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sccal.report.run.pdf import run_pdf, width_of, wrapped
from sccal.report.write import write_calibration
from sccal.results.calibration import Calibration


def pages(pdf: bytes) -> int:
    return len(re.findall(rb"/Type /Page\b(?!s)", pdf))


def dates(pdf: bytes) -> int:
    return pdf.count(b"CreationDate") + pdf.count(b"ModDate")


def test_a_run_on_paper(a_run: Calibration) -> None:
    pdf = run_pdf(a_run)
    assert pdf.startswith(b"%PDF-")
    assert pdf.rstrip().endswith(b"%%EOF")
    assert 3 <= pages(pdf) <= 7
    assert dates(pdf) == 0
    assert len(pdf) < 1_000_000
    assert pdf == run_pdf(a_run)


def test_every_run_can_be_set(an_ugly_run: Calibration) -> None:
    odd = replace(an_ugly_run, run="x" * 300, causes=(), consistency=(), manoeuvres=())
    assert pages(run_pdf(odd)) >= 3


@pytest.mark.parametrize("box", [b"595.28 841.89"])
def test_the_paper_is_a4(a_run: Calibration, box: bytes) -> None:
    boxes = re.findall(rb"/MediaBox \[ ?0 0 ([\d. ]+?) ?\]", run_pdf(a_run))
    assert set(boxes) == {box}


@given(st.text(alphabet="abc iWm", max_size=200), st.floats(40.0, 300.0))
@settings(max_examples=50)
def test_wrapping_keeps_every_word_and_no_line_is_wider(text: str, width: float) -> None:
    lines = wrapped(text, 9.0, width)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert all(width_of(line, 9.0) <= width + 1.0 for line in lines)


def test_a_pdf_is_written_where_wanted_and_an_old_one_does_not_stay(tmp_path: Path, an_ugly_run: Calibration) -> None:
    write_calibration(an_ugly_run, tmp_path, with_pdf=True)
    assert (tmp_path / "report.pdf").read_bytes() == run_pdf(an_ugly_run)
    write_calibration(an_ugly_run, tmp_path)
    assert not (tmp_path / "report.pdf").exists()
