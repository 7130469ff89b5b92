"""Further tests in words."""

import pytest

from bayesmembrane.next_test.further import FurtherTest, Kind
from bayesmembrane.words.next_test import spoken_test


@pytest.mark.parametrize("kind", [k for k in Kind if k is not Kind.OTHER_RIG])
def test_every_kind_has_its_words(kind: Kind) -> None:
    assert spoken_test(FurtherTest(kind))


def test_ranges_say_from_where_to_where_and_what_may_break() -> None:
    tested = FurtherTest(Kind.FURTHER, 0.03, 0.0375)
    assert spoken_test(tested) == "the same film from 30 to 37.5 mm"
    beyond = FurtherTest(Kind.FURTHER, 0.03, 0.045, beyond=True)
    assert spoken_test(beyond) == "the same film from 30 to 45 mm, further than it was tested (it may break)"


def test_another_rig_says_its_own_proposal() -> None:
    said = spoken_test(FurtherTest(Kind.OTHER_RIG, rig="planar", stretch=2.345))
    assert said == "a wide short strip pulled lengthwise (planar), stretched up to 2.35"
