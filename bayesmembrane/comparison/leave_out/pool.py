"""Draws of several densities weighed as one mixture, so that they serve the posterior of all points but one."""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.convergence import effective_draws
from bayesmembrane.calibration.sampling.proposals.mixture import Mixture, around, fit_mixture
from bayesmembrane.ground.numbers import bisected
from bayesmembrane.ground.parameters import Array

LEARN_FROM, BRIDGED, SETTLED = 2000, 1000, 1e-6
SPREAD, HEAVY = 1.3, 5.0  # how much wider than the draws a density is, and its most degrees of freedom
ENOUGH, FOLLOWED = 100.0, 10  # effective draws of the other points' posterior, and densities made to find them
EACH, PER_DIMENSION = 400, 300  # draws of such a density
UNSEEN = 10.0  # over the effective draws is the least error
TOGETHER = 4096  # draws that are weighed at once
HALVINGS = 30  # of the interval of powers
LED_BY = 10  # effective draws for each dimension that such a density is fitted to
ABSURD = 300.0
"""How much more than of any draw of the posterior the other points may make of one, in ln p: an outlier of 24 standard
deviations explains that. Beyond it a form error a million times the noise has left no digits."""
HOPELESS = -1e10  # ln p: beyond it the difference that says what the other points make of a draw has no digits left


class Pool:
    """Draws x (M, k) of the posterior and of mixtures g_c, as draws of q = sum_c n_c p_c / M, p_0 the posterior.

    With that the weight of x for any density p_i is p_i / q, bounded where one of the densities covers p_i (E. Veach,
    L. J. Guibas, SIGGRAPH 1995, 419: the balance heuristic). The normalisation of the posterior follows from the draws.
    """

    def __init__(
        self, posterior: Posterior, draws: Array, log_posterior: Array, terms: Array, rng: np.random.Generator
    ) -> None:
        self.posterior, self.rng = posterior, rng
        self.x, self.log_p, self.terms = draws, log_posterior, terms
        self.counts, self.others = [len(draws)], list[Mixture]()
        self.log_others, self.log_z = np.empty((0, len(draws))), 0.0
        self.most = np.max(log_posterior[:, None] - terms, axis=0)
        some = rng.permutation(len(draws))
        self._add(fit_mixture(draws[some[:LEARN_FROM]], rng), len(draws))

    def without(self, i: int, most: int = FOLLOWED, led_from: float = 0.0) -> tuple[float, float, float]:
        """(ln p(y_i | y_-i), its Monte Carlo error, effective number of draws) with p(x | y_-i) ~ p(x | y) / term_i.

        Where the draws hold next to none of p(x | y_-i), more are drawn from ``most`` densities that are led there:
        each is fitted to what the draws so far say of it, at a power at which enough of them count (O. Cappé et al.,
        Stat. Comput. 18 (2008) 447). Fewer than ``led_from`` effective draws lead nowhere.
        """
        for _ in range(most):
            if not led_from <= self._of(i)[2] < ENOUGH:
                break
            try:
                towards = around(self._drawn_towards(i), self.rng)
            except np.linalg.LinAlgError:  # they fill no volume: the error says how little is known
                break
            self._add(towards, EACH + PER_DIMENSION * self.posterior.size)
        return self._of(i)

    def effective(self, i: int) -> float:
        """Number of draws that count for the posterior of the others than point ``i``."""
        return self._of(i)[2]

    def _of(self, i: int) -> tuple[float, float, float]:
        a, b = self.log_p - self.log_q, self.log_p - self.terms[:, i] - self.log_q
        wa, wb = np.exp(a - np.max(a)), np.exp(b - np.max(b))
        ratio = wa / np.mean(wa) - wb / np.mean(wb)
        # Few weights do not show the tail that they miss: repeats with other seeds scatter by ten over their number.
        error = max(float(np.std(ratio) / np.sqrt(len(ratio))), UNSEEN / effective_draws(wb))
        return float(logsumexp(a) - logsumexp(b)), error, effective_draws(wb)

    def _drawn_towards(self, i: int) -> Array:
        """Some of the draws, each once, by their weights for p(x | y_-i) to a power that leaves enough of them."""
        b = self.log_p - self.terms[:, i] - self.log_q
        b -= np.max(b)
        enough = LED_BY * self.posterior.size
        _, power = bisected(lambda p: effective_draws(np.exp(p * b)) >= enough, 0.0, 1.0, HALVINGS)
        w = np.exp(power * b)
        return self.x[np.unique(self.rng.choice(len(w), int(4 * effective_draws(w)), p=w / np.sum(w)))]

    def _add(self, g: Mixture, count: int) -> None:
        """Draw from g, made broader and with heavy tails, and weigh everything anew."""
        g = g.broader(SPREAD, min(g.degrees, HEAVY))
        x = g.draw(self.rng, count)
        e = self.posterior.evaluate(x)
        good = e.log_posterior > HOPELESS  # heavy tails reach films of any force
        terms = np.zeros((len(x), self.terms.shape[1]))
        if np.any(good):
            terms[good] = self.posterior.pointwise(x[good], e.force[good])
            known = np.all(e.log_posterior[:, None] - terms < self.most + ABSURD, axis=1)
            good, terms = good & known, np.where(known[:, None], terms, 0.0)
        new = [o.log_density(x) for o in self.others]
        self.x, self.terms = np.concatenate([self.x, x]), np.concatenate([self.terms, terms])
        self.log_p = np.concatenate([self.log_p, np.where(good, e.log_posterior, -np.inf)])
        before = np.concatenate([self.log_others, np.array(new).reshape(len(new), count)], axis=1)
        self.log_others = np.concatenate([before, g.log_density(self.x)[None]])
        self.others.append(g)
        self.counts.append(count)
        self._weigh()

    def _weigh(self) -> None:
        share = np.log(np.array(self.counts) / len(self.x))
        parts = [slice(i, i + TOGETHER) for i in range(0, len(self.x), TOGETHER)]
        log_g = np.concatenate([logsumexp(share[1:, None] + self.log_others[:, part], axis=0) for part in parts])
        if len(self.others) == 1:  # each round goes a part of the way alone, and ln Z may be far
            self.log_z = float(np.median((self.log_p - log_g)[: self.counts[0]]))
        for _ in range(BRIDGED):
            # Meng & Wong's iteration: the mean of p / q is the normalisation of p.
            self.log_q = np.logaddexp(share[0] + self.log_p - self.log_z, log_g)
            before, self.log_z = self.log_z, float(logsumexp(self.log_p - self.log_q) - np.log(len(self.log_p)))
            if abs(self.log_z - before) < SETTLED:
                break
