"""Text files as bytes of UTF-8, whatever wrote them."""

from __future__ import annotations

_SAMPLE = 4096
_MOSTLY = 0.4


def as_utf8(data: bytes) -> bytes:
    """The same text in UTF-8 and without a mark of the byte order; bytes that are no UTF-16 are left as they are.

    Shells and spreadsheets of Windows write UTF-16, with a mark at its beginning or, where they append, without.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").encode()
    begin = data[:_SAMPLE]
    if len(begin) > 1 and begin[0] and begin[1::2].count(0) > _MOSTLY * len(begin):
        return data.decode("utf-16-le", errors="replace").encode()
    return data.removeprefix(b"\xef\xbb\xbf")
