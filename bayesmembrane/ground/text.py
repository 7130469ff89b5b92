"""Names that people and file systems give, as text that every page, file and terminal can show."""

from __future__ import annotations

import os
import unicodedata

# They turn the direction of what follows, or hide in it.
_TURNING = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\ufeff")
_UNSHOWN = {"Cc", "Cs", "Zl", "Zp"}
REPLACED = "\ufffd"


def showable(text: str) -> str:
    """The text with control characters, signs that turn its direction, and bytes that are no text replaced by a sign.

    Tabs and ends of lines become spaces.
    """
    return "".join(map(_shown, text))


def file_name(name: str) -> str:
    """A name of a file as text that can be written as UTF-8, whatever its bytes are."""
    return showable(os.fsencode(name).decode("utf-8", "replace"))


def _shown(sign: str) -> str:
    if sign in "\t\n\r":
        return " "
    return REPLACED if sign in _TURNING or unicodedata.category(sign) in _UNSHOWN else sign
