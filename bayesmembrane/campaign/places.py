"""Where something stands in a TOML file: the line of a key, told by the parser itself."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from typing import Any


def line_of(text: str, path: Sequence[str | int]) -> int | None:
    """The line (from 1) of the statement that brings the value at ``path``, or the last part of the path there is.

    A file cut after a whole statement is valid TOML, and cut within one it is not: so the first cut at which the value
    is there ends its statement, which begins after the cut before. None where not even the first part is there.
    """
    lines, wanted = text.splitlines(), list(path)
    while wanted:
        before = 0
        for number in range(1, len(lines) + 1):
            held = _parsed("\n".join(lines[:number]))
            if held is None:
                continue
            if _holds(held, wanted):
                return before + 1
            before = number
        wanted.pop()
    return None


def _parsed(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except ValueError:
        return None


def _holds(held: Any, path: Sequence[str | int]) -> bool:
    for part in path:
        try:
            held = held[part]
        except (KeyError, IndexError, TypeError):
            return False
    return True
