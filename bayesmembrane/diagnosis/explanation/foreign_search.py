"""Something foreign beside a model: each kind is a family of traces; the evidence of the kind is the mean over its
members, each with its size integrated out beside all that the model can follow.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import log_ndtr

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, extended, weighed
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.diagnosis.explanation.foreign import CLIPPED, UNNAMED, Foreign
from bayesmembrane.diagnosis.explanation.foreign_traces import Family, bending, families
from bayesmembrane.diagnosis.explanation.limit import limit_of
from bayesmembrane.diagnosis.reference.inferred import own_noise
from bayesmembrane.diagnosis.reference.smooth import smooth_reference
from bayesmembrane.diagnosis.thresholds import FOREIGN
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import LARGEST, LAW


def beside(search: Search, bases: Sequence[Candidate], others: Sequence[Candidate]) -> list[Foreign]:
    """What is foreign beside the ``bases``, what is `bending` or a limit beside the ``others`` too; the most probable
    first.

    A film that is fitted through one of these takes another energy for it, so that the energy that is most probable
    without one says little: of a step of the load cell's zero 7 in ln of the Bayes factor were told beside that, and 36
    beside three others. What comes and goes, waves and plays leave traces that no energy has.
    """
    found = [f for base in bases for f in foreign(search, base)]
    if len(search.measurement) >= FOREIGN.least_points:
        smooth = smooth_reference(search.measurement)
        for base in others:
            finders: list[Finder] = [partial(_of_family, base, f) for f in bending(search.measurement, base)]
            finders.append(partial(_clipped, base))
            found += [f for f in (_with_its_own_noise(search, smooth, find) for find in finders) if f is not None]
    return sorted(found, key=lambda f: -(f.gain + f.base.log_evidence))


def foreign(search: Search, base: Candidate) -> list[Foreign]:
    """Every kind that can be looked for beside ``base``."""
    m = search.measurement
    if len(m) < FOREIGN.least_points:
        return []
    smooth = smooth_reference(m)
    finders: list[Finder] = [partial(_of_family, base, f) for f in families(m, base)]
    finders.append(partial(_clipped, base))
    found = [_with_its_own_noise(search, smooth, find) for find in finders]
    return [f for f in (*found, _unnamed(search, base)) if f is not None]


Finder = Callable[[Search, Foreign | None], Foreign | None]
"""Looks for one thing under the noise of a search; given what was found of it under another noise."""


def _with_its_own_noise(search: Search, smooth: Array, find: Finder) -> Foreign | None:
    """What is found under the noise as it is, or under the one that is left beside what was found, if that is likelier.

    What is foreign looks like noise, and like noise with a memory: it hides in the one that is inferred without it.
    Both models are weighed under both noises, each of which is as likely as it makes the readings.
    """
    found = find(search, None)
    if found is None or found.trace is None or found.gain - found.chance < FOREIGN.promise:
        return found
    base = found.base
    noise = own_noise(search.measurement, np.column_stack([smooth, base.slopes, found.trace]))
    other = replace(search, noise=noise)
    again = find(other, found)
    if again is None:
        return found
    apart = _plain_evidence(other, base) - _plain_evidence(search, base)
    gain = again.gain + min(apart, 0.0)
    return replace(again, gain=gain) if gain > found.gain else found


def _plain_evidence(search: Search, base: Candidate) -> float:
    """ln Z of the model alone, comparable between noises."""
    return weighed(search.linear(base), base.theta).log_evidence - search.noise.log_root


def _of_family(base: Candidate, family: Family, search: Search, _before: Foreign | None) -> Foreign:
    """The most probable member of a family beside ``base``, and the evidence of them all."""
    model = search.linear(base)
    # Beside noise and form error as they are expected: what is foreign has driven the fitted ones up.
    plain = np.minimum(base.theta, model.priors[:, 0])
    pieces = family.pieces(len(search.measurement))
    parts = [_gains(search, model, plain, part, family) for part in pieces]
    gains, sure = (np.concatenate(each, axis=1) for each in zip(*parts, strict=True))
    size, best = (int(i) for i in np.unravel_index(np.argmax(gains + sure), gains.shape))
    members = FOREIGN.sizes[size] * family.traces(np.array([best]))
    spread = float(np.logaddexp.reduce(gains + sure, axis=None) - np.log(gains.size) - gains[size, best])
    wider = extended(model, [Block(search.noise.white(members))])
    z = weighed(wider, base.theta)
    own = wider.mean(z.theta)[-family.width :]
    trace = members @ own
    gain = float(z.log_evidence - weighed(model, base.theta).log_evidence + spread)
    found = Foreign(family.kind, base, gain, spread, trace=trace, share=_share(search, base, trace))
    return family.told(found, best, FOREIGN.sizes[size] * float(own[0]))


def _gains(search: Search, model: Linear, theta: Array, traces: Array, family: Family) -> tuple[Array, Array]:
    """Of each group of columns s that is expected to be z = `FOREIGN.sizes` times as large, (Z, m) each: the gain

    ln K = z r^T P s c / 2 - ln |1 + z^2 s^T P s| / 2,    c = (1 + z^2 s^T P s)^-1 z s^T P r,

    and what is to be added where only c > 0 is one of the family: ln 2 Phi(c (1 + z^2 s^T P s)^(1/2)), else 0.
    """
    n, width = len(traces), family.width
    white = search.noise.white(traces)
    freed = model.freed(theta, white)
    z = np.array(FOREIGN.sizes)[:, None, None]
    a = z * (freed.T @ model.data).reshape(-1, width)
    f, w = (v.reshape(n, -1, width) for v in (freed, white))
    gram = z[..., None] ** 2 * np.einsum("nmi,nmj->mij", w, f) + np.eye(width)
    solved = np.linalg.solve(gram, a[..., None])[..., 0]
    gains = 0.5 * np.sum(a * solved, axis=-1) - 0.5 * np.linalg.slogdet(gram)[1]
    above = solved[..., 0] * np.sqrt(gram[..., 0, 0])
    return gains, np.log(2) + log_ndtr(above) if family.upward else np.zeros(gains.shape)


def _share(search: Search, base: Candidate, trace: Array) -> float:
    """Part of the squares, beside the model's own slopes, that a trace takes away."""
    white = search.noise.white(np.column_stack([base.slopes, trace, base.residual]))
    q, _ = np.linalg.qr(white[:, :-2])
    t, r = (white[:, i] - q @ (q.T @ white[:, i]) for i in (-2, -1))
    return float((t @ r) ** 2 / max(float(t @ t) * float(r @ r), 1e-300))


# ---- kinds of their own ----------------------------------------------------------------------------------------------


def _unnamed(search: Search, base: Candidate) -> Foreign | None:
    """A smooth relative error of the whole curve along the test: memory of a kind that is not in the library.

    No larger than the error of a law may be: what is as large as the force itself would be any curve.
    """
    fitted = search.measurement.force - base.residual
    columns = search.noise.white(fitted[:, None] * search.factors.progress)
    model = search.linear(base)
    wider = extended(model, [Block(columns, FOREIGN.ln_unnamed, float(np.log(LARGEST[LAW.name])))])
    z = weighed(wider)
    mean = wider.mean(z.theta)
    trace = fitted * (search.factors.progress @ mean[-columns.shape[1] :])
    gain = z.log_evidence - weighed(model, base.theta).log_evidence
    share = _share(search, base, trace)
    return Foreign(UNNAMED, base, gain, size=float(np.exp(z.theta[-1])), relative=True, share=share, trace=trace)


def _clipped(base: Candidate, search: Search, before: Foreign | None) -> Foreign | None:
    """A load cell at its limit."""
    found = limit_of(search, base, None if before is None else before.limit)
    if found is None:
        return None
    share = _share(search, base, found.trace)
    return Foreign(
        CLIPPED,
        base,
        found.gain,
        size=found.force,
        place=found.first,
        share=share,
        trace=found.trace,
        soft=found.width,
        limit=found,
    )
