"""What is foreign is told with its size in units that people read, and with what to do about it."""

from typing import Any, cast

import pytest

from bayesmembrane.diagnosis.explanation.foreign import (
    CLIPPED,
    KINDS,
    LOST,
    PASSING,
    PLAY,
    RANGE,
    STOP,
    SUDDEN,
    UNNAMED,
    WAVE,
    Foreign,
)
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.words.foreign import ADVICE, CAUSES, foreign_clause, foreign_sentence

BASE = cast(Any, None)
TOLD = {
    SUDDEN: (Foreign(SUDDEN, BASE, 9.0, size=-0.04, relative=True, moment=12.0), "drop of the force by 4 % at 12 s"),
    PASSING: (Foreign(PASSING, BASE, 9.0, size=0.02, place=30), "rise of the force by 20 mN that begins at reading 31"),
    LOST: (Foreign(LOST, BASE, 9.0, size=3e-4, moment=7.5), "a way that is 0.3 mm less than read since 7.5 s"),
    WAVE: (Foreign(WAVE, BASE, 9.0, size=0.005, period=0.002, against="deflection"), "5 mN every 2 mm"),
    PLAY: (Foreign(PLAY, BASE, 9.0, size=2e-4), "play of 0.2 mm in the drive"),
    STOP: (Foreign(STOP, BASE, 9.0, size=0.05, level=0.03), "is met at 30 mm and takes 50 mN at the end"),
    RANGE: (Foreign(RANGE, BASE, 9.0, size=-0.03, relative=True, level=0.5), "3 % smaller above 500 mN"),
    CLIPPED: (Foreign(CLIPPED, BASE, 9.0, size=0.9, place=99), "limit of 900 mN from reading 100 on"),
    UNNAMED: (Foreign(UNNAMED, BASE, 9.0, size=0.015, relative=True), "about 1.5 % of the force"),
}


def test_every_kind_is_told() -> None:
    assert set(TOLD) == set(KINDS)
    assert set(ADVICE) == set(KINDS) - {UNNAMED}
    assert set(CAUSES) == set(KINDS) - {UNNAMED, CLIPPED}


@pytest.mark.parametrize("kind", KINDS)
def test_the_clause_tells_size_and_place(kind: str) -> None:
    found, words = TOLD[kind]
    assert words in foreign_clause(found, Annulus(0.01, 0.035), 1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_the_sentence_is_one_and_tells_how_much_it_takes_away(kind: str) -> None:
    sentence = foreign_sentence(TOLD[kind][0], Annulus(0.01, 0.035), 1e-4)
    assert sentence[0].isupper()
    assert sentence.endswith(".")
    assert ("takes 0 % of the squares away" in sentence) is (kind != CLIPPED)


def test_on_a_strip_places_are_stretches() -> None:
    strip = Uniaxial()
    stop = Foreign(STOP, BASE, 9.0, size=0.05, level=0.7 * strip.length)
    assert "is met at a stretch of 1.7 and takes" in foreign_clause(stop, strip, 1e-3)
    assert "disc" not in " ".join((*ADVICE.values(), *CAUSES.values()))
