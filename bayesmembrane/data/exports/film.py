"""Thickness, width and lengths of the specimen: said by the user, stated by the export, or not known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from bayesmembrane.data.exports.blocks import Fact
from bayesmembrane.data.exports.hints import Hints


@dataclass(frozen=True)
class Film:
    """What is known of a specimen, in m (speed in m/s); None where it is not."""

    name: str = ""
    thickness: float | None = None
    width: float | None = None
    length: float | None = None
    speed: float | None = None


UNKNOWN = Film()
"""Nothing is known of the specimen."""


class Telling(Protocol):
    """Who keeps what is said on the way."""

    def guess(self, what: str, value: str, why: str, option: str = "") -> None: ...

    def contradict(self, sentence: str) -> None: ...


THICKEST, WIDEST = 0.05, 1.0
"""m; what is beyond has lost its unit or its decimal mark."""

OPTIONS = {"thickness": "--thickness-um", "width": "--width-mm", "gauge_length": "--gauge-length-mm"}


def film_of(facts: Sequence[Fact], hints: Hints, name: str, telling: Telling, grips: bool) -> Film:
    """The film: hints before facts; facts that contradict each other count as none.

    ``grips``: without a gauge length the length between the grips is one.
    """
    stated = {k: _one(k, facts, telling) for k in ("thickness", "width", "gauge_length", "area", "speed")}
    said = {"thickness": hints.thickness, "width": hints.width, "gauge_length": hints.gauge_length}
    if grips and stated["gauge_length"] is None:
        stated["gauge_length"] = _one("grip_length", facts, telling)
    for key, option in OPTIONS.items():
        fact = stated[key]
        if said[key] is None and fact is not None:
            telling.guess(key.replace("_", " "), f"{1e3 * fact.value:g} mm", f'the file says "{fact.words}"', option)
    value = {k: said.get(k) or (f.value if f is not None else None) for k, f in stated.items()}
    _from_area(value, stated["area"], telling)
    telling.contradict(_unlike_a_film(value["thickness"], value["width"]))
    return Film(hints.name or name, value["thickness"], value["width"], value["gauge_length"], value["speed"])


def _unlike_a_film(thickness: float | None, width: float | None) -> str:
    """What is said of sizes that no film has; "" of others."""
    if thickness and width and thickness > width:
        return f"the specimen would be {1e3 * thickness:.6g} mm thick and only {1e3 * width:.6g} mm wide"
    for what, size, most in (("thick", thickness, THICKEST), ("wide", width, WIDEST)):
        if size and size > most:
            return f"a film that is {1e3 * size:.6g} mm {what} is larger than any machine's specimen"
    return ""


def _one(name: str, facts: Sequence[Fact], telling: Telling) -> Fact | None:
    found = [f for f in facts if f.name == name]
    if not found:
        return None
    other = next((f for f in found if abs(f.value / found[0].value - 1) > 1e-3), None)
    if other is None or name == "speed":
        return found[0]
    option = f", say {OPTIONS[name]}" if name in OPTIONS else ""
    telling.contradict(f'"{found[0].words}" ({found[0].place}) and "{other.words}" differ, neither is used{option}')
    return None


def _from_area(value: dict[str, float | None], fact: Fact | None, telling: Telling) -> None:
    """The side of a rectangle that is not stated, from its area; a contradiction if all three are stated."""
    thickness, width, area = value["thickness"], value["width"], value["area"]
    if fact is None or not area:
        return
    if thickness and width:
        if abs(thickness * width / area - 1) > 0.01:
            telling.contradict(
                f'width times thickness is {1e6 * thickness * width:.5g} mm2, and "{fact.words}" ({fact.place}) '
                "is another area"
            )
    elif thickness or width:
        missing = "width" if thickness else "thickness"
        value[missing] = area / float(thickness or width or 1.0)
        telling.guess(
            missing,
            f"{1e3 * float(value[missing] or 0):.6g} mm",
            f'"{fact.words}" over the other side',
            OPTIONS[missing],
        )
