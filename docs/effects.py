"""Write the page of effects from the catalogue: ``python docs/effects.py > docs/effects.md``."""

from __future__ import annotations

import inspect
import sys

from sccal.effects.catalogue import CATALOGUE
from sccal.effects.effect import Effect, Parameter

HEAD = """# Effects: what a real robot may have that the model lacks

Written from the catalogue (`python docs/effects.py`). `sccal diagnose` tries all of them, and every further column
of the log; `sccal calibrate LOGS --effects lever_arm,soft_iron` estimates those that you name. An effect's parameter
is what the real machine does: `gnss_latency` > 0 means that the fix shows an earlier place. Where the equations have
no other name, p is the parameter, φ a wheel's turned angle, ψ the heading, Δθ and ω turn and turn rate, v the speed.
"""


def page() -> str:
    """The whole page."""
    return HEAD + "".join(section(effect) for effect in CATALOGUE.values())


def section(effect: Effect) -> str:
    """One effect: title, equation, parameters, looks, drive, source."""
    lines = ["", f"## {effect.name}", "", f"{effect.title[0].upper()}{effect.title[1:]}.", ""]
    equations = equation_lines(effect)
    if equations:
        lines += [*(f"    {line}" for line in equations), ""]
    lines += ["| parameter | unit | prior ± | from … to | one for each |", "|---|---|---|---|---|"]
    for one in effect.parameters:
        prior = _searched(one) if one.shape else f"{one.prior_sigma:g}"
        lines.append(f"| `{one.name}` | {one.unit} | {prior} | {one.lower:g} … {one.upper:g} | {one.scope} |")
    lines += ["", f"* Looks like: {effect.looks_like}.", f"* Drive that shows it: {effect.excited_by}."]
    lines += [f"* Source: {effect.reference}."]
    return "\n".join(lines) + "\n"


def _searched(shape: Parameter) -> str:
    return "searched for" + ("" if shape.left_out is None else f"; {shape.left_out:g} where not told")


def equation_lines(effect: Effect) -> list[str]:
    """The first paragraph of its file's first words that holds an equation, and what it leads up to."""
    documentation = inspect.getdoc(sys.modules[type(effect).__module__]) or ""
    lines: list[str] = []
    for paragraph in documentation.split("\n\n")[1:]:
        if "=" in paragraph:
            lines += [line.strip() for line in paragraph.splitlines()]
            if not paragraph.endswith(":"):
                break
    return lines


if __name__ == "__main__":
    sys.stdout.write(page())
