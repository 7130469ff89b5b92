"""Blocks as HTML: the only file that knows the templates."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import jinja2

from bayesmembrane.report.blocks import Block

_TYPED = (
    (re.compile(r" \+- "), " \u00b1 "),
    (re.compile(r"^\+-$"), "\u00b1"),
    (re.compile(r"(?<![\w.)])-(?=\d)"), "\u2212"),
    (re.compile(r"\bum\b"), "\u00b5m"),
)
"""What plain text writes with the keys there are, and how it is set."""


def set_in_type(text: str) -> str:
    """``3 +- 1 mN`` with a plus-minus sign, and a minus as long as a plus."""
    for plain, typed in _TYPED:
        text = plain.sub(typed, text)
    return text


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("bayesmembrane.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["typed"] = set_in_type
    return environment


def fragment(blocks: Sequence[Block]) -> str:
    """Blocks as a piece of HTML that can stand in any page."""
    return _environment().get_template("blocks.html.j2").render(blocks=[(type(b).__name__, b) for b in blocks])


def whole_page(**content: Any) -> str:
    """The page; ``content`` is what its template names."""
    environment = _environment()
    return environment.get_template("report.html.j2").render(fragment=fragment, **content)


def campaign_page(**content: Any) -> str:
    """The page of a campaign; ``content`` is what its template names."""
    return _environment().get_template("campaign.html.j2").render(**content)
