"""Fits of hypotheses to several tests of one material at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.standard import Shape, Size, Standard
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.joint.effects import EffectInTests
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.ground.lately import Lately
from bayesmembrane.ground.parameters import Array, Parameter
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.form_error import ENERGY, LOCAL, error_size
from bayesmembrane.physics.hypothesis import Hypothesis

MADE = 200
"""Hypotheses of single tests that are kept: of those that are searched for side by side, one for every test."""

Columns = list[tuple[Parameter | None, Array]]


@dataclass(frozen=True, eq=False)
class JointNoise(OwnNoise):
    """The noises of several tests, which know nothing of each other.

    parts : of every test; the readings of all stand one behind the other
    """

    parts: tuple[OwnNoise, ...] = ()

    @property
    def rows(self) -> list[slice]:
        """Where the readings of each test stand."""
        return rows_of([p.gaps.size + 1 for p in self.parts])

    @property
    def each(self) -> Array:
        return np.concatenate([p.each for p in self.parts])

    @property
    def log_root(self) -> float:
        return sum(p.log_root for p in self.parts)

    def white(self, values: Array) -> Array:
        return np.concatenate([p.white(values[rows]) for p, rows in zip(self.parts, self.rows, strict=True)])

    def cautious(self) -> JointNoise:
        return joint_noise([p.cautious() for p in self.parts])


def joint_noise(parts: Sequence[OwnNoise]) -> JointNoise:
    """The noises of several tests together."""
    sizes = np.array([p.gaps.size + 1 for p in parts])
    sd = float(np.sqrt(np.sum(sizes * [p.sd**2 for p in parts]) / np.sum(sizes)))
    return JointNoise(sd, 0.0, 0.0, np.ones(int(sizes.sum()) - 1), None, sum(p.dof for p in parts), parts=tuple(parts))


def rows_of(sizes: Sequence[int]) -> list[slice]:
    """Where pieces of these sizes stand, one behind the other."""
    ends = np.cumsum([0, *sizes]).tolist()
    return [slice(a, b) for a, b in pairwise(ends)]


@dataclass(frozen=True, eq=False)
class JointSearch(Weighing):
    """Fits hypotheses, whose effects are `EffectInTests`s, to several tests, and weighs them.

    The coordinates are those of the energy of the thinnest film, which all tests share, then those of the effects.
    Errors of the energy's form have one size in all tests, and so have those of the law of an effect.

    parts : the search of every test
    thicker : (P,) thickness of the film of every test over that of the thinnest
    """

    parts: tuple[Search, ...]
    thicker: tuple[float, ...]
    noise: OwnNoise
    _made: Lately[tuple[int, int], tuple[Hypothesis, Hypothesis]] = field(
        default_factory=lambda: Lately(MADE), init=False, repr=False
    )

    @cached_property
    def force(self) -> Array:
        return np.concatenate([p.force for p in self.parts])

    @property
    def seed(self) -> int:
        return self.parts[0].seed

    @cached_property
    def rows(self) -> list[slice]:
        """Where the readings of each test stand."""
        return rows_of([p.force.size for p in self.parts])

    def of(self, hypothesis: Hypothesis, test: int) -> Hypothesis:
        """What is claimed of one test."""
        return self._made.of((id(hypothesis), test), lambda: (hypothesis, self._within(hypothesis, test)))[1]

    def _within(self, hypothesis: Hypothesis, test: int) -> Hypothesis:
        own = tuple(e for u in _effects(hypothesis) if (e := u.within(test)) is not None)
        return Hypothesis(hypothesis.material, own, hypothesis.noise, hypothesis.convexity)

    def places(self, hypothesis: Hypothesis, test: int) -> NDArray[np.intp]:
        """Where the coordinates of one test stand."""
        n = hypothesis.material_size
        found, begin = [np.arange(n)], n
        for u in _effects(hypothesis):
            if test in u.places:
                found.append(begin + np.arange(*u.places[test]))
            begin += len(u.coordinates)
        return np.concatenate(found)

    def coordinates(self, hypothesis: Hypothesis, test: int, x: Array) -> Array:
        """x (..., k) of one test, in its own film."""
        own = np.array(x[..., self.places(hypothesis, test)])
        own[..., 0] += np.log(self.thicker[test])
        return own

    def batch(self, hypothesis: Hypothesis, x: Array) -> tuple[Array, Array]:
        return self.batches([(hypothesis, x)])[0]

    def batches(self, asked: Sequence[tuple[Hypothesis, Array]]) -> list[tuple[Array, Array]]:
        out = [(np.empty((len(x), self.force.size)), np.zeros((len(x), self.force.size, x.shape[1]))) for _, x in asked]
        for i, (part, rows) in enumerate(zip(self.parts, self.rows, strict=True)):
            own = part.batches([(self.of(h, i), self.coordinates(h, i, x)) for h, x in asked])
            for (h, _), (found, slopes), (r, j) in zip(asked, out, own, strict=True):
                found[:, rows] = r
                wide = np.zeros((*r.shape, slopes.shape[2]))
                wide[:, :, self.places(h, i)] = j
                slopes[:, rows] = wide
        return out

    def misfits(self, hypothesis: Hypothesis, x: Array) -> Array:
        each = [p.misfits(self.of(hypothesis, i), self.coordinates(hypothesis, i, x)) for i, p in enumerate(self.parts)]
        return np.concatenate(each, axis=1)

    def curves(self, hypothesis: Hypothesis, x: Array) -> Array:
        each = [p.curves(self.of(hypothesis, i), self.coordinates(hypothesis, i, x)) for i, p in enumerate(self.parts)]
        return np.concatenate(each, axis=1)

    def traces(self, hypothesis: Hypothesis, x: Array, force: Array) -> Array:
        return self.all_traces([(hypothesis, x, force)])[0]

    def all_traces(self, every: Sequence[tuple[Hypothesis, Array, Array]]) -> list[Array]:
        out = [np.zeros((len(h.effects), force.size)) for h, _, force in every]
        for i, (part, rows) in enumerate(zip(self.parts, self.rows, strict=True)):
            own = [(self.of(h, i), self.coordinates(h, i, x), force[rows]) for h, x, force in every]
            for (h, _, _), trace, found in zip(every, out, part.all_traces(own), strict=True):
                trace[self._acting(h.effects, i), rows] = found
        return out

    def forms(self, force: Array, effects: Sequence[Effect], traces: Array) -> Columns:
        each = []
        for i, (part, rows) in enumerate(zip(self.parts, self.rows, strict=True)):
            at = self._acting(effects, i)
            inner = [cast(Effect, cast(EffectInTests, effects[k]).within(i)) for k in at]
            each.append((at, inner, part.forms(force[rows], inner, traces[at][:, rows])))
        energy = [c[0] for _, _, c in each]
        laws: list[list[tuple[int, tuple[Parameter | None, Array]]]] = [[] for _ in effects]
        rest: list[tuple[int, tuple[Parameter | None, Array]]] = []
        for i, (at, inner, columns) in enumerate(each):
            open_laws = [k for k, e in zip(at, inner, strict=True) if error_size(e) is not None]
            for k, column in zip(open_laws, columns[1:], strict=False):
                laws[k].append((i, column))
            rest += [(i, c) for c in columns[1 + len(open_laws) :]]
        local = [(i, c) for i, c in rest if c[0] is LOCAL]
        return [
            (ENERGY, self._diagonal(list(enumerate(energy)))),
            *((own[0][1][0], self._diagonal(own)) for own in laws if own),
            *((c[0], self._diagonal([(i, c)])) for i, c in rest if c[0] is not LOCAL),
            *([(LOCAL, self._diagonal(local))] if local else []),
        ]

    def event_steps(self, hypothesis: Hypothesis) -> dict[int, float]:
        out: dict[int, float] = {}
        for i, part in enumerate(self.parts):
            places = self.places(hypothesis, i)
            out |= {int(places[k]): step for k, step in part.event_steps(self.of(hypothesis, i)).items()}
        return out

    def axes(self, hypothesis: Hypothesis) -> Standard:
        out: dict[int, Size | Shape] = {}
        for i in reversed(range(len(self.parts))):  # the energy's are those of the first test
            own = self.parts[i].axes(self.of(hypothesis, i)).axes
            out |= dict(zip(self.places(hypothesis, i).tolist(), own, strict=True))
        return Standard(tuple(out[k] for k in range(hypothesis.curve_size)))

    def expected_sizes(self, effect: Effect) -> Array:
        several = cast(EffectInTests, effect)
        return np.concatenate([self.parts[i].expected_sizes(e) for i, e in several.parts[: len(several.sizes)]])

    def material_starts(self, hypothesis: Hypothesis) -> list[Array]:
        """Those of every test in turn, as many as there are of one test."""
        nothing = np.concatenate([np.empty(0), *(e.null for e in hypothesis.effects)])
        plain = Hypothesis(hypothesis.material, (), hypothesis.noise, hypothesis.convexity)
        each = []
        for part, d in zip(self.parts, self.thicker, strict=True):
            own = [np.array(x) for x in part.material_starts(plain)]
            for x in own:
                x[0] -= np.log(d)
            each.append(own)
        mixed = [own[k] for k in range(max(map(len, each))) for own in each if k < len(own)]
        return [np.concatenate([x, nothing]) for x in mixed[: max(map(len, each))]]

    def with_noise(self, test: int, noise: OwnNoise) -> tuple[JointSearch, Search]:
        """The same with another noise of one test, and what is then its part."""
        own = self.parts[test].with_noise(noise)
        parts = tuple(own if i == test else p for i, p in enumerate(self.parts))
        return replace(self, parts=parts, noise=joint_noise([p.noise for p in parts])), own

    def restricted(self, candidate: Candidate, test: int) -> Candidate | None:
        """What a hypothesis claims of one test, where it is, weighed there alone."""
        x = self.coordinates(candidate.hypothesis, test, candidate.x)
        return self.parts[test].at(self.of(candidate.hypothesis, test), x)

    def _acting(self, effects: Sequence[Effect], test: int) -> list[int]:
        """Numbers of the effects that are at work in one test."""
        return [k for k, u in enumerate(effects) if cast(EffectInTests, u).within(test) is not None]

    def _diagonal(self, pieces: Sequence[tuple[int, tuple[Parameter | None, Array]]]) -> Array:
        """(N, m) columns of several tests side by side, each zero at the readings of the others."""
        out = np.zeros((self.force.size, sum(c.shape[1] for _, (_, c) in pieces)))
        begin = 0
        for i, (_, c) in pieces:
            out[self.rows[i], begin : begin + c.shape[1]] = c
            begin += c.shape[1]
        return out


def _effects(hypothesis: Hypothesis) -> list[EffectInTests]:
    return [cast(EffectInTests, e) for e in hypothesis.effects]
