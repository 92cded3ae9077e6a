"""A proposal in words: why each line of it, what the user has to put in, and what to do next."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from sccal.errors import one_line
from sccal.propose.propose import Proposal


def proposal_text(proposal: Proposal, written: Path, logs: Path, width: int) -> str:
    """What `sccal init` prints."""
    runs = f", the largest of {proposal.runs} runs" if proposal.runs > 1 else ""
    parts = [f"looked at {proposal.looked_at}{runs}", ""]
    parts += ["Why:", *_items(proposal.reasons, width)]
    if proposal.doubts:
        parts += ["", "What the log does not tell, for you to look at:", *_items(proposal.doubts, width)]
    parts += ["", f"{written}:", *(f"    {line}".rstrip() for line in proposal.text.splitlines()), ""]
    if proposal.refusal:
        parts += [*textwrap.wrap(f"sccal calibrate would still refuse it: {one_line(proposal.refusal)}", width)]
    else:
        parts.append(f"next: sccal calibrate {logs}")
    return "\n".join(parts) + "\n"


def _items(sentences: Sequence[str], width: int) -> list[str]:
    return [
        line
        for sentence in sentences
        for line in textwrap.wrap(
            one_line(sentence), width, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False
        )
    ]
