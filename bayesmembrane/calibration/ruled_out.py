"""Whether the data ask for films that the convexity prior rules out: then the prior decides, and not they."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch

import numpy as np

from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.posterior import Evaluates, Posterior, weighed
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.convexity import FREE

ROUNDS, POINTS, LEAST, READINGS = 4, 128, 16, 50_000
"""Searches, films in each of them, no less than so many, and readings that all films of one may have together."""
WIDER = 1.5


def ruled_out_gain(posterior: Posterior | JointPosterior, x: Array, seed: int) -> float | None:
    """By how much ln p(x | y) is larger, at least, at a film that convexity rules out than at the best draw.

    x (B, k) are draws. Films are tried around the best one, as far apart as the draws are, then around the best of
    them, without the convexity prior. 0 if none is better; None where that prior asks nothing.
    """
    free = _without_convexity(posterior)
    if free is None:
        return None
    rng, count = np.random.default_rng([seed, 3]), max(LEAST, min(POINTS, READINGS // posterior.readings))
    some = x[rng.integers(len(x), size=4 * count)]
    root = WIDER * np.linalg.cholesky(np.cov(some.T) + 1e-12 * np.eye(x.shape[1]))
    lp = weighed(free, some).log_posterior
    best, within = some[int(np.argmax(lp))], float(np.max(lp))
    highest = within
    for _ in range(ROUNDS):
        tried = best + rng.standard_normal((count, x.shape[1])) @ root.T
        lp = weighed(free, tried).log_posterior
        if np.nanmax(lp) > highest:
            best, highest = tried[int(np.nanargmax(lp))], float(np.nanmax(lp))
    allowed = bool(np.isfinite(weighed(posterior, best[None]).log_prior[0]))
    return 0.0 if allowed else highest - within


@singledispatch
def _without_convexity(posterior: object) -> Evaluates | None:
    """The same posterior with a convexity prior that asks nothing; None if its own does."""
    raise TypeError(f"{type(posterior).__name__} is no posterior")


@_without_convexity.register
def _(posterior: Posterior) -> Evaluates | None:
    h = posterior.hypothesis
    return replace(posterior, hypothesis=replace(h, convexity=FREE)) if h.convexity.restricts else None


@_without_convexity.register
def _(posterior: JointPosterior) -> Evaluates | None:
    joint = posterior.joint
    if not joint.convexity.restricts:
        return None
    parts = [replace(p, hypothesis=replace(p.hypothesis, convexity=FREE)) for p in joint.parts]
    return replace(posterior, joint=replace(joint, parts=tuple(parts)))
