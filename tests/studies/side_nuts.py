"""NumPyro's NUTS on a polynomial emulator of the curve, in JAX; what it draws is weighed by the film itself.

The emulator is that of this package, learned from a short walk of emcee's; no ln Z is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpyro.infer import MCMC, NUTS

from bayesmembrane.calibration.posterior import Posterior
from bayesmembrane.calibration.sampling.convergence import autocorrelation_times
from bayesmembrane.calibration.sampling.proposals.emulator import emulate
from bayesmembrane.calibration.sampling.proposals.polynomials import monomials
from tests.studies.side_samplers import Asked, Found, kish, normalised, walked

PILOT_STEPS = 200
CHAINS, WARMUP, DRAWS = 4, 500, 1000

jax.config.update("jax_enable_x64", True)


def on_an_emulator(posterior: Posterior, seed: int) -> Found:
    """Draws of the emulated posterior with their importance weights."""
    asked, rng = Asked(posterior), np.random.default_rng(seed)
    pilot = _pilot(asked, seed)
    emulator = emulate(posterior, pilot, rng)
    if emulator is None:
        raise ValueError("the walk has too few possible points to learn an emulator from")
    potential = _in_jax(posterior, emulator)
    kernel = NUTS(potential_fn=potential, dense_mass=True)
    how = {"num_warmup": WARMUP, "num_samples": DRAWS, "num_chains": CHAINS, "chain_method": "vectorized"}
    mcmc = MCMC(kernel, **how, progress_bar=False)
    start = (pilot[rng.choice(len(pilot), CHAINS)] - emulator.centre) @ emulator.inverse.T
    mcmc.run(jax.random.PRNGKey(seed), init_params=start)
    z = np.asarray(mcmc.get_samples(group_by_chain=True))
    tau = float(np.max(autocorrelation_times(np.swapaxes(z, 0, 1)[None])))
    z = z.reshape(-1, posterior.size)
    x = emulator.centre + z @ emulator.root.T
    weight = normalised(asked.log_posterior(x) + np.asarray(jax.vmap(potential)(z)))
    return Found(x, weight, kish(weight) / max(tau, 1.0))


def _pilot(asked: Asked, seed: int) -> Any:
    sampler, start = walked(asked, seed)
    sampler.run_mcmc(start, PILOT_STEPS)
    return np.asarray(sampler.get_chain(discard=PILOT_STEPS // 2, flat=True))


def _in_jax(posterior: Posterior, emulator: Any) -> Callable[[Any], Any]:
    """-ln p(z) of whitened z (k,) in JAX: normal priors, white noise on top of a stated covariance."""
    priors = [p.prior for p in posterior.hypothesis.parameters]
    mean, sd = jnp.array([p.mean for p in priors]), jnp.array([p.sd for p in priors])
    noise: Any = posterior.noise
    axes = np.eye(posterior.readings) if noise.axes is None else noise.axes
    along, data = jnp.array(emulator.coefficients @ axes), jnp.array(posterior.measurement.force @ axes)
    variance, scale = jnp.array(noise.variance), noise.scale
    terms, centre, root = emulator.terms, jnp.array(emulator.centre), jnp.array(emulator.root)

    def potential(z: Any) -> Any:
        x = centre + root @ z
        misfit = data - jnp.prod(jnp.concatenate([z, jnp.ones(1)])[terms], axis=1) @ along
        total = variance + (jnp.exp(x[-1]) * scale) ** 2
        prior = ((x - mean) / sd) ** 2 + 2 * jnp.log(sd) + jnp.log(2 * jnp.pi)
        return 0.5 * jnp.sum(misfit**2 / total + jnp.log(2 * jnp.pi * total)) + 0.5 * jnp.sum(prior)

    # The same numbers as without JAX, or nothing is compared.
    z = np.random.default_rng(0).standard_normal((5, posterior.size))
    own = emulator.posterior.given(monomials(z, terms) @ emulator.coefficients, emulator.centre + z @ emulator.root.T)
    np.testing.assert_allclose([-potential(row) for row in z], own, rtol=1e-8)
    return potential
