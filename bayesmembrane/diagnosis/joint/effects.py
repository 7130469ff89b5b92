"""What may be at work in several tests: an effect of the material in all of them, or one of the rig in one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from bayesmembrane.physics.effects.base import AT, Effect


@dataclass(frozen=True)
class EffectInTests(Effect):
    """An effect in one or several tests, there or absent in all of them at once.

    Its coordinates are those of its parts, test by test, unless they are constants of the material: what is left of a
    film by its history has, in another range, another size. A subclass of its own has the name and the coordinates
    (`in_tests`).

    parts : (number of the test, the effect there)
    """

    parts: tuple[tuple[int, Effect], ...] = ()
    stage: ClassVar[str] = ""

    @property
    def known(self) -> bool:
        return all(effect.known for _, effect in self.parts)

    @property
    def sizes(self) -> tuple[int, ...]:
        return tuple(dict.fromkeys(begin for begin, _ in self.places.values()))

    @property
    def places(self) -> dict[int, tuple[int, int]]:
        """{number of a test: (first, behind the last) of its coordinates}."""
        if self.constant:
            return {test: (0, len(effect.coordinates)) for test, effect in self.parts}
        found, begin = {}, 0
        for test, effect in self.parts:
            found[test] = (begin, begin + len(effect.coordinates))
            begin += len(effect.coordinates)
        return found

    @property
    def starts(self) -> list[dict[str, float]]:
        """Those of its first part, in all."""
        first = self.parts[0][1].starts
        several = len(self.parts) > 1 and not self.constant
        return [{(f"{t}.{k}" if several else k): v for t, _ in self.parts for k, v in start.items()} for start in first]

    @property
    def second_places(self) -> list[float]:
        """Those of its first part: what comes in events is of the rig, and in one test."""
        return self.parts[0][1].second_places

    def come_at(self, moment: float) -> list[dict[str, float]]:
        """Those of the effect in the one test that it is in."""
        return self.parts[0][1].come_at(moment) if len(self.parts) == 1 else []

    def within(self, test: int) -> Effect | None:
        return dict(self.parts).get(test)


def in_tests(name: str, parts: Sequence[tuple[int, Effect]], one_clock: bool = True) -> EffectInTests:
    """The ``parts`` (number of the test, effect) of one effect, under a name.

    A constant of the material has one value in tests that go by ``one_clock``: without times a second is a millimetre.
    """
    first = parts[0][1]
    coordinates, constant = first.coordinates, first.constant and one_clock
    if len(parts) > 1 and not constant:
        coordinates = tuple(replace(p, name=f"{test}.{p.name}") for test, effect in parts for p in effect.coordinates)
    kind = type(
        "EffectInTests",
        (EffectInTests,),
        {
            "name": name,
            "title": first.title,
            "reference": first.reference,
            "signature": first.signature,
            "coordinates": coordinates,
            "exact": first.exact,
            "may_change": first.may_change,
            "second": first.second if len(parts) == 1 else None,
            "begins": first.begins if len(parts) == 1 else "",
            "like_foreign": first.like_foreign,
            "odds": first.odds,
            "mistaken": first.mistaken,
            "remembers": first.remembers,
            "of_the_material": first.of_the_material,
            "constant": constant,
        },
    )
    made: EffectInTests = kind(parts=tuple(parts))
    return made


def effects_in_tests(
    effects: Sequence[Mapping[str, Effect]], labels: Sequence[str], one_clock: bool = True
) -> list[EffectInTests]:
    """The ``effects`` by name of every test: of the material once, of a rig once for each test.

    Those of a rig are called after their test, as in ``zero_offset@strip``. ``one_clock`` is false where some tests
    were timed and others not.
    """
    names = list(dict.fromkeys(name for own in effects for name in own))
    out = []
    for name in names:
        parts = [(i, own[name]) for i, own in enumerate(effects) if name in own]
        if parts[0][1].of_the_material:
            out.append(in_tests(name, parts, one_clock))
        else:
            out += [in_tests(f"{name}{AT}{labels[i]}", [(i, effect)]) for i, effect in parts]
    return out
