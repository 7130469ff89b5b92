"""A density near the posterior, from which live points climb a shorter way than from the prior."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from scipy.special import stdtrit

from bayesmembrane.calibration.sampling.proposals.filling import filled
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, around
from bayesmembrane.calibration.sampling.weights import worth
from bayesmembrane.comparison.evidence.search import Modes, joined
from bayesmembrane.comparison.evidence.target import Problem
from bayesmembrane.ground.parameters import Array

MOST = 4000  # points that a mixture is fitted to
WIDER, DEGREES = 1.25, 4.0  # how much broader than the posterior the density is, and with which tails
BESIDES = 0.2  # of the weight of what comes before, for each further group of points
LOOKED_AT, GOOD = 256, 0.6  # draws by which the density is judged, and effective ones for each with which it is left


class Closer(Problem):
    """The integral of L p0 with a mixture q in the place of the prior, and L p0 / q in that of the likelihood.

    q holds a mixture of t-distributions for each group (n, k) of ``points``: of the posterior, as well as that is
    known, of places that must not be overlooked, and of the ``modes`` that a search has found, with half of the weight,
    if there are any. Where its draws are not worth enough it is `filled`, for where L p0 / q is large live points climb
    long. Any q gives the same Z: what it looks like has a part only in how long a run takes, and one that leaves out a
    mode makes it unlikely to be found.
    """

    def __init__(self, problem: Problem, points: Sequence[Array], modes: Modes, rng: np.random.Generator) -> None:
        self.target, self.problem = problem.target, problem
        fitted = [around(x[rng.permutation(len(x))[:MOST]], rng) for x in (*points, *modes.clouds)]
        given = np.array([BESIDES**i for i in range(len(points))])
        share = np.concatenate([given / np.sum(given), modes.weights])
        g = joined(fitted, share)
        self.q = g.broader(WIDER, DEGREES)
        x = self.q.draw(rng, LOOKED_AT)
        if worth(problem.log_posterior(x) - self.q.log_density(x)).efficiency < GOOD:
            with suppress(np.linalg.LinAlgError):  # it is large where nothing has a volume
                self.q = filled(self.q, problem.log_posterior, rng).mixture

    def from_cube(self, u: Array) -> tuple[Array, Array]:
        x = from_cube(self.q, u)
        return x, self.problem.log_posterior(x) - self.q.log_density(x)


def from_cube(q: Mixture, u: Array) -> Array:
    """The x (B, k) of u (B, k), distributed as q if u is uniform in the unit cube.

    The first side of the cube is divided among the components. Within one, z_i given those before it is t-distributed
    with nu + i degrees of freedom and the scale sqrt((nu + sum_j<i z_j^2) / (nu + i)), i = 0 .. k - 1.
    """
    edges = np.concatenate([[0.0], np.cumsum(np.exp(q.log_weights))])
    edges /= edges[-1]
    which = np.clip(np.searchsorted(edges, u[:, 0], side="right") - 1, 0, len(q.means) - 1)
    first = (u[:, 0] - edges[which]) / (edges[which + 1] - edges[which])
    u = np.clip(np.column_stack([first, u[:, 1:]]), 1e-15, 1 - 1e-15)
    z, square = np.empty_like(u), np.full(len(u), q.degrees)
    for i in range(u.shape[1]):
        z[:, i] = stdtrit(q.degrees + i, u[:, i]) * np.sqrt(square / (q.degrees + i))
        square += z[:, i] ** 2
    return np.asarray(q.means[which] + np.einsum("bij,bj->bi", q.roots[which], z))
