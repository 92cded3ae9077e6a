"""Options in groups: the command line sees each field where its group stands, the command sees the group."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Annotated

import pytest
import typer

from sccal.calibration.options import CalibrationOptions
from sccal.cli.calibrate import Beyond, Estimating, options_of
from sccal.cli.options import grouped
from sccal.cli.reading import Reading
from sccal.errors import UsageError


@dataclass(frozen=True)
class Size:
    height: Annotated[float, typer.Option(help="m")] = 1.0
    width: Annotated[float, typer.Option(help="m")] = 2.0


def area(name: str, *, size: Size, loud: bool = False) -> None:
    print(name, size, loud)


def test_each_field_is_an_option_where_its_group_stands(capsys):
    command = grouped(area)
    parameters = inspect.signature(command).parameters
    assert list(parameters) == ["name", "height", "width", "loud"]
    assert parameters["width"].default == 2.0
    assert "typer" in repr(parameters["width"].annotation)
    command(name="door", height=2.1, width=0.9, loud=True)
    assert capsys.readouterr().out == f"door {Size(2.1, 0.9)} True\n"


def test_a_word_that_is_no_choice_is_refused():
    with pytest.raises(UsageError, match=r"--time late: must be header, log or publish"):
        Reading(time="late")


def test_what_nobody_chooses_is_what_the_calibration_takes_by_itself():
    assert options_of(Estimating(), Beyond()) == CalibrationOptions()
