"""The frame of all pages: one self-contained file each, readable on a phone, on paper, and in the dark."""

from __future__ import annotations

from jinja2 import Environment, PackageLoader, StrictUndefined

_PAGES = Environment(
    loader=PackageLoader("sccal.report", "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    keep_trailing_newline=True,
)


def page(template: str, **content: object) -> str:
    """Names from a file system may hold what UTF-8 cannot; it becomes a question mark."""
    return _PAGES.get_template(template).render(content).encode("utf-8", "replace").decode("utf-8")
