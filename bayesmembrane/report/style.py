"""How everything in a report looks and is called: colours, line styles, names of parameters."""

from __future__ import annotations

import hashlib
import re
from typing import Literal

LineStyle = Literal["-"] | tuple[float, tuple[float, ...]]

# Okabe and Ito's palette, which colour-blind readers can tell apart; the line style says the same again.
_COLOURS = {
    "neo_hookean": "#0072B2",
    "mooney_rivlin": "#E69F00",
    "gent": "#009E73",
    "yeoh": "#D55E00",
    "ogden": "#CC79A7",
}
_OTHERS = ("#56B4E9", "#7A6A00", "#6A3D9A", "#8C564B", "#4D4D4D")
_DASHES: dict[str, tuple[float, ...]] = {
    "neo_hookean": (),
    "mooney_rivlin": (7, 2),
    "gent": (7, 2, 1.5, 2),
    "yeoh": (),
    "ogden": (3, 1.5),
}
_MARKERS = {"neo_hookean": "o", "mooney_rivlin": "s", "gent": "^", "yeoh": "D", "ogden": "v"}

INK = "#1a1a1a"
MUTED = "#5f6b76"
FAINT = "#d7dce1"
SHADE = "#eef1f4"
ALARM = "#B00020"

_TITLES = {
    "neo_hookean": "neo-Hookean",
    "mooney_rivlin": "Mooney-Rivlin",
    "gent": "Gent",
    "yeoh": "Yeoh",
    "ogden": "Ogden",
}


def title(material: str) -> str:
    """How a material is printed; third-party names with spaces for underscores."""
    return _TITLES.get(material, material.replace("_", " "))


def colour(material: str) -> str:
    """One fixed colour per material; of a third party's, one that depends on its name alone."""
    return _COLOURS.get(material) or _OTHERS[_number(material) % len(_OTHERS)]


def linestyle(material: str) -> LineStyle:
    """One fixed line style per material: "-", or (offset, lengths of dashes and gaps in points)."""
    lengths = _DASHES.get(material, (5, 1.5, 1.5, 1.5, 1.5, 1.5))
    return (0.0, lengths) if lengths else "-"


def marker(material: str) -> str:
    """One fixed marker per material."""
    return _MARKERS.get(material, "P")


def _number(name: str) -> int:
    return int(hashlib.sha256(name.encode()).hexdigest()[:8], 16)


def short(name: str) -> str:
    """``yeoh.c1`` -> ``c1``; the noise and the effects keep what tells them from the material."""
    block, _, own = name.partition(".")
    if block == "noise":
        return {"sd": "extra noise", "ln_sd": "ln extra noise"}.get(own, f"noise {own}")
    return own or block


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


def spoken(name: str) -> str:
    """The name of a parameter in running text: ``gent.ln_jm`` -> ``ln Jm``, ``yeoh.c2_c1`` -> ``c2/c1``."""
    own = short(name)
    ratio = re.fullmatch(r"([a-z]\d+)_([a-z]\d+)", own)
    if ratio:
        return f"{ratio[1]}/{ratio[2]}"
    for raw, shown in (("ln_gd", "ln Gd"), ("ln_jm", "ln Jm"), ("ln_", "ln ")):
        own = own.replace(raw, shown)
    return own.replace("_", " ")
