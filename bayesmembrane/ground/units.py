"""Units at the edges: what a header or a key says, and its factor to SI. Inside, everything is SI.

A name carries its unit as its last part: ``force_mN``, ``nominal_stress_kgf_per_cm2``, ``thickness_um``. Numbers of
dimension one need none: ``stretch``.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.errors import DataError

T = TypeVar("T", float, NDArray[np.float64])

_G = 9.80665  # standard gravity, m/s^2
_POUND = 0.45359237  # kg
_INCH = 0.0254  # m

TIME, LENGTH, FORCE, STRESS, SPEED, RATIO = "time", "length", "force", "stress", "speed", "ratio"

_FACTORS: dict[str, dict[str, float]] = {
    TIME: {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0},
    LENGTH: {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": _INCH, "mil": 1e-3 * _INCH},
    FORCE: {
        "N": 1.0,
        "mN": 1e-3,
        "uN": 1e-6,
        "kN": 1e3,
        "cN": 1e-2,
        "daN": 10.0,
        "kgf": _G,
        "gf": 1e-3 * _G,
        "lbf": _POUND * _G,
    },
    STRESS: {
        "Pa": 1.0,
        "kPa": 1e3,
        "MPa": 1e6,
        "GPa": 1e9,
        "bar": 1e5,
        "ksi": 1e3 * _POUND * _G / _INCH**2,
        "psi": _POUND * _G / _INCH**2,
        "N_per_mm2": 1e6,
        "N_per_m2": 1.0,
        "kgf_per_cm2": _G * 1e4,
        "kgf_per_mm2": _G * 1e6,
    },
    SPEED: {
        "m_per_s": 1.0,
        "mm_per_s": 1e-3,
        "um_per_s": 1e-6,
        "mm_per_min": 1e-3 / 60.0,
        "mm_per_h": 1e-3 / 3600.0,
        "in_per_min": _INCH / 60.0,
    },
    RATIO: {"": 1.0, "percent": 1e-2, "mm_per_mm": 1.0, "m_per_m": 1.0, "um_per_m": 1e-6},
}

_SPELLINGS = str.maketrans({"µ": "u", "μ": "u", "²": "2"})


class Unit(NamedTuple):
    """A unit: its name as in a header, its quantity, and x [SI] = factor * x [unit]."""

    name: str
    quantity: str
    factor: float


UNITS: dict[str, Unit] = {
    name: Unit(name, quantity, factor) for quantity, table in _FACTORS.items() for name, factor in table.items()
}


def spelled(unit: str) -> str:
    """The unit as the table spells it: ``µm`` is ``um``, ``N/mm²`` is ``N_per_mm2``, ``%`` is ``percent``."""
    text = unit.strip().translate(_SPELLINGS).replace("^", "").replace("/", "_per_")
    return {"%": "percent", "sec": "s", "-": "", "1": ""}.get(text, text)


def split_header(header: str) -> tuple[str, str]:
    """(name, unit) of a column or key: ``force_mN`` -> (``force``, ``mN``); unit ``""`` if it ends in none.

    The longest ending that is a unit counts, so ``stress_kgf_per_cm2`` is in ``kgf_per_cm2``.
    """
    text = header.strip()
    for i, character in enumerate(text):
        if character == "_" and i > 0 and (unit := spelled(text[i + 1 :])) in UNITS and unit:
            return text[:i], unit
    return text, ""


def known_units(quantity: str) -> tuple[str, ...]:
    """The names of the units of a quantity, as a header may carry them."""
    return tuple(_FACTORS[quantity])


def factor(unit: str, quantity: str, where: str | None = None) -> float:
    """x [SI] = factor * x [unit]; raises `DataError` naming the nearest unit of the quantity if there is none."""
    name = spelled(unit)
    table = _FACTORS[quantity]
    if name in table:
        return table[name]
    if name in UNITS:
        fault = f'"{unit}" is a unit of {UNITS[name].quantity}, not of {quantity}'
    else:
        fault = f'there is no unit "{unit}" of {quantity}'
    raise DataError(fault, where, _advice(name, table))


def to_si(value: T, scale: float) -> T:
    """``scale * value``, rounded as a decimal number would be: 50 um are 5e-05 m, not 4.9999999999999996e-05 m."""
    inverse = round(1 / scale) if scale < 1 else 0
    return value / inverse if inverse and math.isclose(inverse * scale, 1.0, rel_tol=1e-14) else value * scale


def _advice(name: str, known: Iterable[str]) -> str:
    names = [n for n in known if n]
    lower = {n.lower(): n for n in reversed(names)}
    nearest = difflib.get_close_matches(name.lower(), lower, n=1, cutoff=0.4)
    guess = f'did you mean "{lower[nearest[0]]}"? ' if nearest else ""
    return f"{guess}known: {', '.join(names)}"
