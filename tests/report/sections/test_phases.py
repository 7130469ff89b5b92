"""The phases of a test on a page: told once for each test, guesses marked."""

from dataclasses import replace

import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.data.phases import Phases, phases_of
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.physics.rigs.uniaxial import Uniaxial
from bayesmembrane.report.blocks import Figure, Table, Text
from bayesmembrane.report.sections.phases import PhasesSection

D = 1e-3 * np.concatenate([np.arange(0.0, 21.0), np.arange(19.0, 4.0, -1), np.arange(6.0, 26.0)])


def cyclic() -> Phases:
    m = Measurement(D, 30 * D, Annulus(0.01, 0.035), Specimen("film", 5e-5), time=np.arange(float(D.size)))
    found = phases_of(m)
    assert found is not None
    return found


def test_a_test_is_shown_once_with_its_guesses() -> None:
    first = cyclic()
    text, figure, table = PhasesSection().blocks([first, replace(first, said=())])
    assert isinstance(text, Text)
    assert isinstance(figure, Figure)
    assert isinstance(table, Table)
    told = str(text)
    assert "3 phases in 2 cycles" in told
    assert "Guessed from the curve: direction and cycle; a reversal counts beyond 0.125 mm" in told
    assert [row[:2] for row in table.rows] == [(1, "loading"), (1, "unloading"), (2, "loading")]
    assert "1 mm" not in table.caption
    assert [c.key for c in table.columns] == ["cycle", "phase", "from", "to", "seconds", "speed"]
    assert figure.picture.data


def test_a_reversal_of_a_strip_is_a_stretch_without_a_unit() -> None:
    m = Measurement(D, 30 * D, Uniaxial(length=0.05, width=0.01), Specimen("strip", 1e-3))
    (text, *_) = PhasesSection().blocks([phases_of(m)])
    assert "a reversal counts beyond 0.0025. Columns" in str(text)


def test_what_columns_said_is_no_guess() -> None:
    (text, *_) = PhasesSection().blocks([replace(cyclic(), said=("direction", "cycle"))])
    assert "The columns of the curve say direction and cycle." in str(text)
    assert "Guessed" not in str(text)


def test_nothing_is_shown_of_other_results() -> None:
    assert PhasesSection().blocks([1, "a"]) == ()
