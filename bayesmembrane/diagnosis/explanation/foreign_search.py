"""Something foreign beside a model: each kind is a family of traces; the evidence of the kind is the mean over its
members, each with its size integrated out beside all that the model can follow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.special import log_ndtr

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, extended, weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.candidates.weighing import Weighing
from bayesmembrane.diagnosis.explanation.foreign import CLIPPED, UNNAMED, Foreign
from bayesmembrane.diagnosis.explanation.foreign_traces import Family, bending, families
from bayesmembrane.diagnosis.explanation.limit import limit_of
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.diagnosis.thresholds import FOREIGN
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import LARGEST, LAW


@dataclass(frozen=True, eq=False)
class OneTest:
    """Where something foreign is looked for: in one test of those that a model is weighed by, or in the only one.

    All of them weigh it, for what is foreign in one bends the film of the others, too.

    weighing : of all
    search : of this test alone
    rows : where its readings stand among those of all
    under : the same ``weighing`` and ``search`` with another noise of this test
    alone : what a candidate claims of this test alone; None if no film gets there
    """

    weighing: Weighing
    search: Search
    rows: slice
    under: Callable[[OwnNoise], tuple[Weighing, Search]]
    alone: Callable[[Candidate], Candidate | None]

    @cached_property
    def smooth(self) -> Array:
        return smooth_reference(self.search.measurement)

    def fitted(self, base: Candidate) -> Array:
        """(N,) N, the forces of this test by ``base``."""
        return np.asarray(self.search.measurement.force - base.residual[self.rows])

    def slopes(self, base: Candidate) -> Array:
        """(N, k) those of this test by the coordinates that it depends on."""
        own = base.slopes[self.rows]
        return np.asarray(own[:, np.any(own != 0, axis=0)])

    def among(self, columns: Array) -> Array:
        """(M, ...) of the readings of all tests, from (N, ...) of this one: zeros for the others."""
        out = np.zeros((self.weighing.force.size, *columns.shape[1:]))
        out[self.rows] = columns
        return out

    def with_noise(self, noise: OwnNoise) -> OneTest:
        """The same where the readings of this test have another ``noise``."""
        weighing, search = self.under(noise)
        return replace(self, weighing=weighing, search=search)


def the_only(search: Search) -> OneTest:
    """The test of a model that is weighed by one."""

    def under(noise: OwnNoise) -> tuple[Weighing, Search]:
        other = search.with_noise(noise)
        return other, other

    return OneTest(search, search, slice(None), under, lambda base: base)


def beside(test: OneTest, bases: Sequence[Candidate], others: Sequence[Candidate]) -> list[Foreign]:
    """What is foreign beside the ``bases``, what is `bending` or a limit beside the ``others`` too; the most probable
    first.

    A film that is fitted through one of these takes another energy for it, so that the energy that is most probable
    without one says little: of a step of the load cell's zero 7 in ln of the Bayes factor were told beside that, and 36
    beside three others. What comes and goes, waves and plays leave traces that no energy has.
    """
    m = test.search.measurement
    if len(m) < FOREIGN.least_points:
        return []
    found = [f for base in bases for f in foreign(test, base)]
    for base in others:
        found += _found(test, base, bending(m, test.fitted(base)))
    return sorted(found, key=lambda f: -(f.gain + f.base.log_evidence))


def foreign(test: OneTest, base: Candidate) -> list[Foreign]:
    """Every kind that can be looked for beside ``base``."""
    found = _found(test, base, families(test.search.measurement, test.fitted(base)))
    return [*found, _unnamed(test, base)]


def _found(test: OneTest, base: Candidate, of: Sequence[Family]) -> list[Foreign]:
    finders: list[Finder] = [partial(_of_family, base, f) for f in of]
    finders.append(partial(_clipped, base))
    return [f for f in (_with_its_own_noise(test, find) for find in finders) if f is not None]


Finder = Callable[[OneTest, Foreign | None], Foreign | None]
"""Looks for one thing under the noise of a test; given what was found of it under another noise."""


def _with_its_own_noise(test: OneTest, find: Finder) -> Foreign | None:
    """What is found under the noise as it is, or under the one that is left beside what was found, if that is likelier.

    What is foreign looks like noise, and like noise with a memory: it hides in the one that is inferred without it.
    Both models are weighed under both noises, each of which is as likely as it makes the readings.
    """
    found = find(test, None)
    if found is None or found.trace is None or found.gain - found.chance < FOREIGN.promise:
        return found
    base = found.base
    basis = np.column_stack([test.smooth, test.slopes(base), found.trace[test.rows]])
    other = test.with_noise(own_noise(test.search.measurement, basis))
    again = find(other, found)
    if again is None:
        return found
    apart = _plain_evidence(other.weighing, base) - _plain_evidence(test.weighing, base)
    gain = again.gain + min(apart, 0.0)
    return replace(again, gain=gain) if gain > found.gain else found


def _plain_evidence(weighing: Weighing, base: Candidate) -> float:
    """ln Z of the model alone, comparable between noises."""
    return weighed(weighing.linear(base), base.theta).log_evidence - weighing.noise.log_root


def _of_family(base: Candidate, family: Family, test: OneTest, _before: Foreign | None) -> Foreign:
    """The most probable member of a family beside ``base``, and the evidence of them all."""
    model, white = test.weighing.linear(base), test.weighing.noise.white
    # Beside noise and form error as they are expected: what is foreign has driven the fitted ones up.
    plain = np.minimum(base.theta, model.priors[:, 0])
    pieces = family.pieces(test.weighing.force.size)
    parts = [_gains(model, plain, white(test.among(part)), family) for part in pieces]
    gains, sure = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
    size, best = (int(i) for i in np.unravel_index(np.argmax(gains + sure), gains.shape))
    members = test.among(FOREIGN.sizes[size] * family.traces(np.array([best])))
    spread = float(np.logaddexp.reduce(gains + sure, axis=None) - np.log(gains.size) - gains[size, best])
    wider = extended(model, [Block(white(members))])
    z = weighed(wider, base.theta)
    own = wider.mean(z.theta)[-family.width :]
    trace = members @ own
    gain = float(z.log_evidence - weighed(model, base.theta).log_evidence + spread)
    found = Foreign(family.kind, base, gain, spread, trace=trace, share=_share(test, base, trace))
    return family.told(found, best, FOREIGN.sizes[size] * float(own[0]))


def _gains(model: Linear, theta: Array, white: Array, family: Family) -> tuple[Array, Array]:
    """Of each group of ``white`` columns s, expected to be z = `FOREIGN.sizes` times as large, (Z, m) each: the gain

    ln K = z r^T P s c / 2 - ln |1 + z^2 s^T P s| / 2,    c = (1 + z^2 s^T P s)^-1 z s^T P r,

    and what is to be added where only c > 0 is one of the family: ln 2 Phi(c (1 + z^2 s^T P s)^(1/2)), else 0.
    """
    n, width = len(white), family.width
    freed = model.freed(theta, white)
    z = np.array(FOREIGN.sizes)[:, None, None]
    a = z * (freed.T @ model.data).reshape(-1, width)
    f, w = (v.reshape(n, -1, width) for v in (freed, white))
    gram = z[..., None] ** 2 * np.einsum("nmi,nmj->mij", w, f) + np.eye(width)
    solved = np.linalg.solve(gram, a[..., None])[..., 0]
    gains = 0.5 * np.sum(a * solved, axis=-1) - 0.5 * np.linalg.slogdet(gram)[1]
    above = solved[..., 0] * np.sqrt(gram[..., 0, 0])
    return gains, np.log(2) + log_ndtr(above) if family.upward else np.zeros(gains.shape)


def _share(test: OneTest, base: Candidate, trace: Array) -> float:
    """Part of the squares of all tests, beside the model's own slopes, that a trace takes away."""
    white = test.weighing.noise.white(np.column_stack([base.slopes, trace, base.residual]))
    own = white[:, :-2]
    q, _ = np.linalg.qr(own[:, np.any(own != 0, axis=0)])
    t, r = (white[:, i] - q @ (q.T @ white[:, i]) for i in (-2, -1))
    return float((t @ r) ** 2 / max(float(t @ t) * float(r @ r), 1e-300))


# ---- kinds of their own ----------------------------------------------------------------------------------------------


def _unnamed(test: OneTest, base: Candidate) -> Foreign:
    """A smooth relative error of the whole curve along the test: memory of a kind that is not in the library.

    No larger than the error of a law may be: what is as large as the force itself would be any curve.
    """
    fitted, progress = test.fitted(base), test.search.factors.progress
    columns = test.weighing.noise.white(test.among(fitted[:, None] * progress))
    model = test.weighing.linear(base)
    wider = extended(model, [Block(columns, FOREIGN.ln_unnamed, float(np.log(LARGEST[LAW.name])))])
    z = weighed(wider)
    mean = wider.mean(z.theta)
    trace = test.among(fitted * (progress @ mean[-columns.shape[1] :]))
    gain = z.log_evidence - weighed(model, base.theta).log_evidence
    share = _share(test, base, trace)
    return Foreign(UNNAMED, base, gain, size=float(np.exp(z.theta[-1])), relative=True, share=share, trace=trace)


def _clipped(base: Candidate, test: OneTest, before: Foreign | None) -> Foreign | None:
    """A load cell at its limit; weighed in its test alone, where readings there are set aside."""
    alone = test.alone(base)
    found = None if alone is None else limit_of(test.search, alone, None if before is None else before.limit)
    if found is None:
        return None
    trace = test.among(found.trace)
    share = _share(test, base, trace)
    return Foreign(
        CLIPPED,
        base,
        found.gain,
        size=found.force,
        place=found.first,
        share=share,
        trace=trace,
        soft=found.width,
        limit=found,
    )
