"""What every page must be: valid, whole in itself, small, and readable without a script, a mouse or eyes."""

from __future__ import annotations

import re
from collections import Counter
from itertools import pairwise

import html5lib

LARGEST_BYTES = 3_000_000
_DRAWN = re.compile(r'( d)="[^"]*"')


def assert_page(html: str, scripts: int = 0) -> None:
    """Fails on the first thing that a page must not have; ``scripts`` of its own are allowed."""
    assert len(html.encode()) < LARGEST_BYTES
    light = _DRAWN.sub(r'\1=""', html)
    document = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(light)
    elements = [element for element in document.iter() if isinstance(element.tag, str)]
    ids = Counter(element.get("id") for element in elements if element.get("id"))
    assert [one for one, count in ids.items() if count > 1] == []
    assert set(re.findall(r'href="#([^"]*)"', light)) <= set(ids)
    assert_self_contained(light, scripts)
    style = "".join(element.text or "" for element in elements if element.tag == "style")
    assert set(re.findall(r"var\((--[\w-]+)", html)) <= set(re.findall(r"(--[\w-]+):", style))
    for element in elements:
        if element.get("role") == "img":
            assert element.get("aria-label")
    levels = [int(e.tag[1]) for e in elements if re.fullmatch(r"h[1-6]", e.tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(below <= above + 1 for above, below in pairwise(levels))


def assert_self_contained(html: str, scripts: int = 0) -> None:
    """Nothing is fetched, and nothing runs but ``scripts`` of the page's own."""
    for reference in re.findall(r'(?:src|href)="([^"]*)"', html):
        assert not re.match(r"[a-z]+:|//", reference), f"{reference} is not in the page"
    assert html.count("<script") == html.count("</script>") == scripts
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)
