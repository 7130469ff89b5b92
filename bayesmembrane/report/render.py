"""Blocks as HTML: the only file that knows the templates."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import jinja2

from bayesmembrane.report.blocks import Block


@cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("bayesmembrane.report", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


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
