"""Fits of hypotheses to one measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bayesmembrane.calibration.objective import Objective, separated
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.diagnosis.candidates.remembering import RememberingObjective, together
from bayesmembrane.diagnosis.candidates.standard import Standard, expected_size, standard
from bayesmembrane.diagnosis.candidates.weighing import Weighing, starts_with
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.thresholds import SEARCH
from bayesmembrane.ground.lately import Lately
from bayesmembrane.ground.parameters import Array, Parameter
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.form_error import FormFactors, form_columns, form_factors
from bayesmembrane.physics.forward import Forward, Solve
from bayesmembrane.physics.hypothesis import Hypothesis
from bayesmembrane.physics.in_step import traces_in_step
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Request
from bayesmembrane.physics.mechanics.solution import Curves

MADE = 60
"""Hypotheses whose objectives are kept: no more are searched for side by side, or they are made anew."""


@dataclass(frozen=True, eq=False)
class Search(Weighing):
    """Fits hypotheses to one measurement under one noise, and weighs them.

    noise : of the readings; every hypothesis may scale it a little
    known_factors : of the form error's processes, where this is a part of a measurement; else None
    """

    measurement: Measurement
    noise: OwnNoise
    seed: int = 0
    solve: Solve = api.solve
    known_factors: FormFactors | None = None
    _made: Lately[int, tuple[Hypothesis, RememberingObjective]] = field(
        default_factory=lambda: Lately(MADE), init=False, repr=False
    )
    _standards: Lately[int, tuple[Hypothesis, Standard]] = field(
        default_factory=lambda: Lately(MADE), init=False, repr=False
    )

    @property
    def force(self) -> Array:
        return self.measurement.force

    @cached_property
    def factors(self) -> FormFactors:
        """The processes of the form error."""
        return self.known_factors or form_factors(self.measurement)

    def with_noise(self, noise: OwnNoise) -> Search:
        """The same under another noise."""
        return replace(self, noise=noise, known_factors=self.factors)

    def quick(self, asked: Request) -> Curves:
        """The solver without its last resort: films that only shooting resolves cost a hundred times as much."""
        return api.unaided(asked, self.solve)

    def batch(self, hypothesis: Hypothesis, x: Array) -> tuple[Array, Array]:
        return self._remembering(hypothesis).batch(x)

    def batches(self, asked: Sequence[tuple[Hypothesis, Array]]) -> list[tuple[Array, Array]]:
        return together([(self._remembering(hypothesis), x) for hypothesis, x in asked])

    def misfits(self, hypothesis: Hypothesis, x: Array) -> Array:
        return np.asarray(self._objective(hypothesis).forward(x, reached=False).force - self.force)

    def curves(self, hypothesis: Hypothesis, x: Array) -> Array:
        whole = self.measurement
        return Forward(hypothesis, whole, whole.deflection, self.solve)(x, reached=False).force

    def traces(self, hypothesis: Hypothesis, x: Array, force: Array) -> Array:
        return self.all_traces([(hypothesis, x, force)])[0]

    def all_traces(self, every: Sequence[tuple[Hypothesis, Array, Array]]) -> list[Array]:
        return traces_in_step([(self._objective(h).forward, x, force) for h, x, force in every])

    def forms(self, force: Array, effects: Sequence[Effect], traces: Array) -> list[tuple[Parameter | None, Array]]:
        return form_columns(self.factors, force, effects, traces)

    def event_steps(self, hypothesis: Hypothesis) -> dict[int, float]:
        m, n = self.measurement, hypothesis.material_size
        step = {"way": _usual(np.diff(m.deflection)) / m.full_range, "clock": _usual(np.diff(m.path.clock[m.on_path]))}
        own = [p for e in hypothesis.effects for p in e.coordinates]
        return {n + i: step[p.event] for i, p in enumerate(own) if p.event}

    def axes(self, hypothesis: Hypothesis) -> Standard:
        # By identity, as `_remembering` does.
        return self._standards.of(id(hypothesis), lambda: (hypothesis, standard(hypothesis, self.measurement)))[1]

    def expected_sizes(self, effect: Effect) -> Array:
        return np.array([expected_size(effect, self.measurement)])

    def material_starts(self, hypothesis: Hypothesis) -> list[Array]:
        """Starts (k,) from draws of the material's prior brought to their best modulus, without any effect; then, from
        the first of these, with one after the other of those of the hypothesis.

        The plain model bends the material until it imitates what is missing: searches must not only start there.
        """
        plain = replace(hypothesis, effects=tuple(e.as_held() for e in hypothesis.effects if e.known))
        objective = Objective(plain, self._few, "euclidean", self.quick)
        pool, _ = objective.pool(np.random.default_rng(self.seed), SEARCH.draws)
        found = separated(pool, objective.spread, SEARCH.material_starts)
        nulls = [e.null for e in hypothesis.effects]
        out = [np.concatenate([x, *nulls]) for x in found]
        for i, effect in enumerate(hypothesis.effects):
            if effect.known:
                continue
            for own in starts_with([np.empty(0)], effect, self.expected_sizes(effect)):
                out.append(np.concatenate([found[0], *nulls[:i], own, *nulls[i + 1 :]]))
        return out

    @cached_property
    def _few(self) -> Measurement:
        """Readings spread over the measured deflections."""
        order = np.argsort(self.measurement.deflection, kind="stable")
        rows = np.linspace(0, order.size - 1, min(order.size, SEARCH.readings)).round().astype(int)
        return self.measurement.select(np.sort(order[rows]))

    def _objective(self, hypothesis: Hypothesis) -> Objective:
        return self._remembering(hypothesis).objective

    def _remembering(self, hypothesis: Hypothesis) -> RememberingObjective:
        """Of one of the hypotheses that were asked for last: a search asks for one many times."""
        # By identity, for that costs nothing; the hypothesis is held beside, so that no other one gets its number.
        return self._made.of(
            id(hypothesis),
            lambda: (
                hypothesis,
                RememberingObjective(Objective(hypothesis, self.measurement, "euclidean", self.quick)),
            ),
        )[1]


def _usual(steps: Array) -> float:
    """The median size of the ``steps`` between readings that lead anywhere; 0 where none does."""
    there = np.abs(steps[steps != 0])
    return float(np.median(there)) if there.size else 0.0
