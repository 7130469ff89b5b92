"""What is said of valleys: every sentence of the answer stands in it once, and says what the numbers say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import material
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.valleys.between import Approach
from bayesmembrane.valleys.follow import valleys
from bayesmembrane.valleys.profile import Ending
from bayesmembrane.valleys.result import Valleys
from bayesmembrane.words.valleys import ENDINGS, document, sentence_between, sentences, valley_sentences


@pytest.fixture(scope="module")
def found() -> Valleys:
    at = np.linspace(0.004, 0.03, 8)
    force = api.solve(api.request(material("neo_hookean"), [7.0], at, 0.01, 0.035)).force[0]
    m = Measurement(at, force * (1 + 2e-3 * (-1.0) ** np.arange(8)), Annulus(0.01, 0.035), Specimen("film", 5e-5))
    return valleys(m, hypothesis("neo_hookean", convexity="none"), [0.02, 0.03])


def test_every_sentence_stands_in_the_answer(found: Valleys) -> None:
    answer, said = document(found), sentences(found)
    assert answer["sentences"] == list(said)
    assert answer["ranges"][0]["sentences"] == list(valley_sentences(found.ranges[0]))
    assert answer["closest_approach"]["sentence"] == said[-1]
    assert answer["ranges"][0]["profiles"]["c1"]["reason"] == ["", ""]
    assert answer["ranges"][0]["limit"] == ""


def test_every_ending_has_its_words() -> None:
    assert set(ENDINGS) == set(Ending)


def test_two_valleys_cross_meet_or_stay_apart(found: Valleys) -> None:
    a, b, between = found.compared[0]
    at = np.array([2.0])

    def said(distance: float) -> str:
        return sentence_between(a, b, replace(between, approach=Approach(distance, at, at, None), crossing=None))

    assert "come as close as 0.5 posterior standard deviations" in said(0.5)
    assert "stay apart: at their closest approach they are 5 posterior" in said(5.0)
    assert "cannot be compared" in said(np.nan)
    assert "cross at (c1 7)" in sentence_between(a, b, replace(between, crossing=(7.0,)))


def test_an_open_end_that_is_another_material_names_it(found: Valleys) -> None:
    v = found.ranges[0]
    low, high = v.profiles[0].ends
    opened = replace(v.profiles[0], ends=(low, replace(high, ending=Ending.TENDS)))
    (said,) = [s for s in valley_sentences(replace(v, profiles=(opened,), limit="gent")) if "open" in s]
    assert "that of a Gent film" in said
    assert f"c1 is above {low.value:.3g}" in said
