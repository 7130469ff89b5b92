"""Answers are values: what is stored comes back as it was, and says the same."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bayesmembrane.calibration.run import RunSettings, sample
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.diagnosis.diagnose import diagnose
from bayesmembrane.diagnosis.explanation.case import Question
from bayesmembrane.diagnosis.left.discrepancy import discrepancy
from bayesmembrane.diagnosis.loop import Loop, Round, Stage
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.ground.stored import answer, read, store
from bayesmembrane.ground.tree import Encoder
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus
from bayesmembrane.words import diagnosis as diagnosis_words
from bayesmembrane.words import loop as loop_words
from tests.generator.datasets import THICKNESS, generate
from tests.generator.protocols import Protocol

SHORT = Protocol("short", (0.015, 0.030), (1e-3,) * 2, 80)


@pytest.fixture(scope="module")
def measurement() -> Measurement:
    d = generate("friction", "neo_hookean", SHORT, "white", strength=1.5, seed=11)
    return Measurement(1e-3 * d.deflection_mm, d.force_N, Annulus(0.010, 0.035), Specimen("film", THICKNESS), d.time_s)


@pytest.fixture(scope="module")
def found(measurement: Measurement) -> Diagnosis:
    return diagnose(measurement, Question(hypothesis("neo_hookean"), True, True))


def values(result: Any, folder: Path) -> tuple[Any, dict[str, np.ndarray]]:
    """All that a result holds, as plain values."""
    encoder = Encoder(folder)
    return encoder(result), encoder.arrays


def same(a: Any, b: Any, folder: Path) -> bool:
    (one, these), (two, those) = values(a, folder), values(b, folder)
    return one == two and these.keys() == those.keys() and all(np.array_equal(these[k], those[k]) for k in these)


def test_stored_equals_given_for_a_diagnosis(found: Diagnosis, tmp_path: Path) -> None:
    told = diagnosis_words.document(found)
    store(tmp_path, "diagnosis", found, told)
    again = read(tmp_path, "diagnosis")
    assert same(again, found, tmp_path)
    assert diagnosis_words.document(again) == told == answer(tmp_path, "diagnosis")
    assert again.hypothesis == found.hypothesis


def test_stored_equals_given_for_a_loop(measurement: Measurement, found: Diagnosis, tmp_path: Path) -> None:
    short = Settings(ess=1.0, chunk=40, most_steps=40, walkers=16)
    stages = [
        Stage(
            sample(measurement, h, RunSettings(settings=short, out=tmp_path / "chains")), 500.0, 0.03, 450.0, 4.0, 0.91
        )
        for h in (hypothesis("neo_hookean"), hypothesis("neo_hookean", ["force_offset"]))
    ]
    left = discrepancy(measurement, found.null.residual, found.noise)
    closed = Loop((Round(found, *stages), Round(found, stages[1], stages[1], (stages[0],))), left)
    told = loop_words.document(closed)
    store(tmp_path / "loop", "loop", closed, told)
    again = read(tmp_path / "loop", "loop")
    assert same(again, closed, tmp_path)
    assert loop_words.document(again) == told
    assert [r.changed for r in again.rounds] == [True, False]
    np.testing.assert_array_equal(again.rounds[0].after.run.draws(), stages[1].run.draws())
