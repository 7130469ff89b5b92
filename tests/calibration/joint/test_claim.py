from dataclasses import replace

from bayesmembrane.calibration.joint.claim import labelled
from bayesmembrane.data.measurement import Measurement, Provenance
from tests.calibration.joint.tests_of import STRIP, made


def test_labels_are_words_of_the_specimen_or_of_its_file_if_that_is_short() -> None:
    def named(name: str, file: str = "") -> tuple[str, Measurement]:
        m = made(STRIP, "neo_hookean", (15.0,), specimen=name)
        return "", replace(m, provenance=Provenance(curve=file))

    long = "VHB 4910, strip pulled at 0.03 1/s"
    tests = [named("Film 1"), named("Film 1"), named(long, "data/vhb_0d03.csv"), named(long)]
    assert labelled(tests) == ["film-1", "film-1-2", "vhb-0d03", "vhb-4910-strip-pulled-at-0-03"]
    assert labelled([("own", tests[0][1])]) == ["own"]
