"""How everything in a picture looks: colours, line styles, markers, and the names of parameters on axes."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from typing import Literal

from bayesmembrane.ground.registry import components
from bayesmembrane.words.language import short

LineStyle = Literal["-"] | tuple[float, tuple[float, ...]]

INK = "#1a1a1a"
MUTED = "#5f6b76"
FAINT = "#d7dce1"
SHADE = "#eef1f4"
ALARM = "#B00020"

RANGE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9")
"""Of ranges, legs and ensembles, in this order."""


@dataclass(frozen=True)
class Look:
    """Colour, dashes and gaps in points (none: a solid line), marker: each says which curve it is."""

    colour: str
    dashes: tuple[float, ...]
    marker: str


# Okabe and Ito's palette, which colour-blind readers can tell apart, and darker tones that go with it.
PALETTE = (
    Look("#0072B2", (), "o"),
    Look("#E69F00", (7, 2), "s"),
    Look("#009E73", (7, 2, 1.5, 2), "^"),
    Look("#D55E00", (), "D"),
    Look("#CC79A7", (3, 1.5), "v"),
    Look("#56B4E9", (5, 1.5, 1.5, 1.5, 1.5, 1.5), "P"),
    Look("#7A6A00", (5, 1.5, 1.5, 1.5, 1.5, 1.5), "X"),
    Look("#6A3D9A", (9, 3), "<"),
    Look("#8C564B", (2, 1), ">"),
    Look("#4D4D4D", (9, 2, 2, 2), "p"),
)
STRANGERS = PALETTE[5:]  # what the materials of this package leave


def look(name: str) -> Look:
    """The look of a material, by name: that of the colour it declares, else one that depends on its name alone.

    So does that of a hypothesis with effects (``yeoh+zero_offset``), which must not look like its bare material.
    """
    declared = str(getattr(components("materials").get(name), "colour", ""))
    own = next((kind for kind in PALETTE if kind.colour == declared), None)
    if own is not None:
        return own
    chosen = STRANGERS[int(hashlib.sha256(name.encode()).hexdigest()[:8], 16) % len(STRANGERS)]
    return Look(declared, chosen.dashes, chosen.marker) if declared else chosen


def colour(name: str) -> str:
    """One fixed colour per material or hypothesis."""
    return look(name).colour


def linestyle(name: str) -> LineStyle:
    """One fixed line style for each name: "-", or (offset, lengths of dashes and gaps in points)."""
    dashes = look(name).dashes
    return (0.0, dashes) if dashes else "-"


def marker(name: str) -> str:
    """One fixed marker for each name."""
    return look(name).marker


def symbol(name: str) -> str:
    """The name of a parameter as mathematical text for figures: ``yeoh.c1`` -> ``$c_1$``."""
    own = short(name)
    found = re.fullmatch(r"([a-z])(\d+)", own)
    if found:
        return f"${found[1]}_{{{found[2]}}}$"
    ratio = re.fullmatch(r"([a-z])(\d+)_([a-z])(\d+)", own)
    if ratio:
        return f"${ratio[1]}_{{{ratio[2]}}}/{ratio[3]}_{{{ratio[4]}}}$"
    logarithm = re.fullmatch(r"ln_([a-z])(\w+)", own)
    if logarithm:
        base, index = logarithm.groups()
        special = {"ln_gd": r"$\ln\,Gd$", "ln_jm": r"$\ln\,J_m$"}
        return special.get(own, rf"$\ln\,{base}_{{{index}}}$")
    return own.replace("_", " ")


def with_unit(name: str, unit: str) -> str:
    """Symbol and unit for an axis; a pure number carries ``(-)``."""
    return f"{symbol(name)} ({unit or '-'})"
