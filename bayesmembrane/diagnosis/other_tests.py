"""What the sum over hypotheses predicts of other tests of the same material, and how well it does.

Every hypothesis predicts with its own probability. Near its most probable coordinates it is linear in them, in the
error of its forms, which goes on in the other test along the same states and the same progress, and in noise:

    F' = F'(x) + J' (x' - x) + form error + noise,    (1 + scatter z) F' of another specimen, z ~ N(0, 1).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.left.continued import Continued, continued
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.diagnosis.thresholds import OTHER_TESTS
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.symmetric import normal_draws
from bayesmembrane.ground.threads import one_thread
from bayesmembrane.physics.form_error import FormFactors, error_at_another_speed, joint_factors
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.rigs.base import rig_of


@dataclass(frozen=True, eq=False)
class OtherTest:
    """A test that no fit saw, and what is predicted of it.

    before : (N,) N of the model as given, without the form error that its fit to the first test was left with
    after : (N,) N, median over all hypotheses
    low, high : (N,) N, ends of the band that holds a reading with the probability `OTHER_TESTS.band`
    scatter : relative standard deviation by which forces of two specimens differ, as it was stated
    """

    measurement: Measurement
    before: Array
    after: Array
    low: Array
    high: Array
    scatter: float

    @property
    def rmse_before(self) -> float:
        """Root mean square, N."""
        return float(np.sqrt(np.mean((self.measurement.force - self.before) ** 2)))

    @property
    def rmse_after(self) -> float:
        """Root mean square, N."""
        return float(np.sqrt(np.mean((self.measurement.force - self.after) ** 2)))

    @property
    def covered(self) -> float:
        """Part of the readings inside the band."""
        y = self.measurement.force
        return float(np.mean((y >= self.low) & (y <= self.high)))


@one_thread
def predicted(found: Diagnosis, other: Measurement, scatter: float = 0.0, seed: int = 0) -> OtherTest:
    """What all that ``found`` holds probable predicts of ``other``, a test of the same material.

    Raises `SettingsError` if the tests are of different kinds, ``scatter`` is negative, or no film gets so far.
    """
    check(found.measurement, other, scatter)
    search, rng = Search(found.measurement, found.noise), np.random.default_rng([seed, 11])
    parts = [_draws(search, c, other, count, rng) for c, count in _members(found)]
    every = [p for p in parts if p is not None]
    null = _at(search, found.null, other)
    if not every or null is None:
        raise SettingsError(
            f"no probable film follows the test {_name(other)}", "--predict", "predict a test of a shorter range"
        )
    draws = np.concatenate(every)
    draws *= 1 + scatter * rng.standard_normal((len(draws), 1))
    draws += found.noise.sd * rng.standard_normal(draws.shape)
    edge = 0.5 * (1 - OTHER_TESTS.band)
    low, middle, high = np.quantile(draws, [edge, 0.5, 1 - edge], axis=0)
    return OtherTest(other, null.force, middle, low, high, scatter)


def check(measurement: Measurement, other: Measurement, scatter: float) -> None:
    """Raises `SettingsError` if ``other`` is on another kind of rig, or another frame, or ``scatter`` negative."""
    if type(other.rig) is not type(measurement.rig):
        raise SettingsError(
            f"the test {_name(other)} is on another kind of rig than the one that was diagnosed",
            "--predict",
            "predict tests of the same kind",
        )
    if other.blank_run is not None and not np.array_equal(other.blank_run, measurement.blank_run):  # type: ignore[arg-type]
        raise SettingsError(
            f"the test {_name(other)} has another blank run than the one that was diagnosed",
            "--predict",
            "give both the blank run of their frame, if it is one frame, or leave it out of the test that is predicted",
        )
    if scatter < 0:
        raise SettingsError(f"a scatter of {scatter:g} is none", "--scatter", "write 0.05 for five per cent")


def _name(other: Measurement) -> str:
    return other.provenance.curve or other.specimen.name


def _members(found: Diagnosis) -> Iterator[tuple[Candidate, int]]:
    """The most probable hypotheses, each with its part of the draws."""
    first = found.ranking[: OTHER_TESTS.members]
    whole = sum(j.probability for j in first)
    for j in first:
        count = round(OTHER_TESTS.draws * j.probability / whole) if whole > 0 else 0
        if count:
            yield j.candidate, count


def _draws(search: Search, c: Candidate, other: Measurement, count: int, rng: np.random.Generator) -> Array | None:
    """(count, N) N, without noise; None if the film does not get as far.

    No error of a form makes a film push: none takes a reading below zero, nor below what the hypothesis says of it with
    the coordinates of the draw.
    """
    there = _at(search, c, other)
    if there is None:
        return None
    z, k = normal_draws(there.covariance, count, rng), c.x.size
    read = there.force + there.moved + z @ there.columns.T
    if rig_of(other).slack_below_rest(other):
        said = there.force + z[:, :k] @ there.columns[:, :k].T
        read = np.maximum(read, np.minimum(said, 0.0))
    return np.asarray(read)


def _at(search: Search, c: Candidate, other: Measurement) -> Continued | None:
    n = len(search.measurement)
    both = joint_factors(search.measurement, other.path)
    part = replace(search, known_factors=FormFactors(both.state[:n], both.progress[:n], search.factors.spots))
    fit = part.at(c.hypothesis, c.x)
    if fit is None:
        return None
    rows = n + other.on_path
    factors = FormFactors(both.state[rows], both.progress[rows])
    faster = error_at_another_speed(search.measurement.path, other.path)[other.on_path]
    there = continued(part, fit, Forward(c.hypothesis, other, other.deflection, part.quick), factors, faster)
    return there if there.complete else None
