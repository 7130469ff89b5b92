"""Numbers, lists and names of parameters in words. Knows of no result."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

# ---- numbers ---------------------------------------------------------------------------------------------------------


def newtons(value: float) -> str:
    """A force with three digits: mN below 0.1 N."""
    if not math.isfinite(value):
        return "no force"
    if abs(value) < 0.0995:
        return f"{digits(1e3 * value)} mN"
    return f"{digits(value)} N" if abs(value) < 1e4 else f"{value:.2g} N"


def millimetres(value: float) -> str:
    """A length in mm with four digits."""
    return f"{1e3 * value:.4g} mm"


def percent(share: float) -> str:
    """A share in per cent; never 0 or 100 unless it is."""
    if 0 < share < 0.001:
        return "less than 0.1 %"
    if 0.995 < share < 1:
        return f"more than {'99.9' if share > 0.999 else '99.5'} %"
    return f"{100 * share:.{2 if share < 0.995 else 3}g} %"


def interval(low: float, middle: float, high: float, unit: str) -> str:
    """``17.7 N/m (90 %: 17.2 to 18.1)``, with as many digits as the width deserves."""
    width = high - low
    if not math.isfinite(width):
        return "unknown"
    if width <= 0:
        return f"{middle:.6g} {unit}".strip()
    half = max(min(high - middle, middle - low), width / 50)  # a long tail must not hide how sharp the other side is
    decimals = min(9, max(0, -math.floor(math.log10(half / 2))))
    own = f"{middle:.{decimals}f}{' ' + unit if unit else ''}"
    return f"{own} (90 %: {low:.{decimals}f} to {high:.{decimals}f})"


def digits(value: float) -> str:
    """Three significant digits without an exponent."""
    if value == 0:
        return "0"
    decimals = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(decimals, 6)}f}"


def three_digits(value: float) -> str:
    """``0.0000938``, ``22.5``: as ``.3g``, without an exponent where that is short."""
    text = f"{value:.3g}"
    return f"{float(text):.9f}".rstrip("0") if "e-" in text and abs(value) >= 1e-7 else without_exponent(text)


def without_exponent(text: str) -> str:
    """A formatted number without an exponent where that is short, and with a true minus sign."""
    if "e" in text and abs(float(text)) < 1e7 and abs(float(text)) >= 1e-4:
        text = f"{float(text):,.0f}" if abs(float(text)) >= 1 else f"{float(text):.6f}".rstrip("0")
    return "\u2212" + text[1:] if text.startswith("-") else text


# ---- lists -----------------------------------------------------------------------------------------------------------


def listed(words: Iterable[str]) -> str:
    """``a, b and c``."""
    found = list(words)
    return found[0] if len(found) == 1 else ", ".join(found[:-1]) + f" and {found[-1]}" if found else ""


def sentence(clause: str) -> str:
    """A clause with a capital and a full stop."""
    return f"{clause[:1].upper()}{clause[1:].rstrip('.')}."


# ---- names of parameters ---------------------------------------------------------------------------------------------


def short(name: str) -> str:
    """``yeoh.c1`` -> ``c1``; the noise and the effects keep what tells them from the material."""
    block, _, own = name.partition(".")
    if block == "noise":
        spoken = {"sd": "extra noise", "eta": "form error of the energy", "eta_law": "form error of the laws"}
        spoken["eta_local"] = "error at starts, turns and stops"
        spoken |= {f"ln_{key}": f"ln {text}" for key, text in spoken.items()}
        return spoken.get(own, f"noise {own}")
    return own or block


def spoken_parameter(name: str) -> str:
    """The name of a parameter in running text: ``gent.ln_jm`` -> ``ln Jm``, ``yeoh.c2_c1`` -> ``c2/c1``."""
    own = short(name)
    ratio = re.fullmatch(r"([a-z]\d+)_([a-z]\d+)", own)
    if ratio:
        return f"{ratio[1]}/{ratio[2]}"
    for raw, shown in (("ln_gd", "ln Gd"), ("ln_jm", "ln Jm"), ("ln_", "ln ")):
        own = own.replace(raw, shown)
    return own.replace("_", " ")
