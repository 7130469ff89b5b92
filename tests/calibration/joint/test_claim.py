from dataclasses import replace
from typing import Any, cast

import pytest

from bayesmembrane.calibration.joint.claim import joint, labelled
from bayesmembrane.data.measurement import Measurement, Provenance
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.physics.hypothesis import hypothesis
from tests.calibration.joint.tests_of import STRIP, made


def test_labels_are_words_of_the_specimen_or_of_its_file_if_that_is_short() -> None:
    def named(name: str, file: str = "") -> tuple[str, Measurement]:
        m = made(STRIP, "neo_hookean", (15.0,), specimen=name)
        return "", replace(m, provenance=Provenance(curve=file))

    long = "VHB 4910, strip pulled at 0.03 1/s"
    tests = [named("Film 1"), named("Film 1"), named(long, "data/vhb_0d03.csv"), named(long)]
    assert labelled(tests) == ["film-1", "film-1-2", "vhb-0d03", "vhb-4910-strip-pulled-at-0-03"]
    assert labelled([("own", tests[0][1])]) == ["own"]


def test_the_same_readings_do_not_count_twice() -> None:
    one, other = (made(STRIP, "neo_hookean", (15.0,), seed=s) for s in (1, 2))
    claim = hypothesis("neo_hookean")
    assert joint([one, other], claim).labels == ("strip", "strip-2")
    with pytest.raises(SettingsError, match='"strip" and "strip-2" hold the same readings'):
        joint([one, replace(one, provenance=Provenance(curve="copy.csv"))], claim)


def test_what_is_no_measurement_is_told() -> None:
    with pytest.raises(SettingsError, match="1 is no measurement"):
        joint(cast(Any, [1, 2]), hypothesis("neo_hookean"))
