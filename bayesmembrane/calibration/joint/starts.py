"""Where ensembles start on several tests: spread around every valley that all tests leave open, wider than it is."""

from __future__ import annotations

import numpy as np

from bayesmembrane.calibration.joint.objective import JointObjective, with_fewer_readings
from bayesmembrane.calibration.joint.posterior import JointPosterior
from bayesmembrane.calibration.posterior import Outcomes
from bayesmembrane.calibration.starts import Tried, evolved, tempered
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array

EACH, ROUNDS, AROUND = 256, 5, 96
MOST = 4  # optima of the largest likelihood
LIKELY = 40.0  # of |r|^2 above the least: valleys beyond it hold nothing of the posterior
WIDER, DEGREES = 1.5, 4.0  # than the curvature says, and degrees of freedom of the t-distribution around a valley


def joint_starts(
    posterior: JointPosterior, rng: np.random.Generator, ensembles: int, walkers: int, counts: Outcomes
) -> Array:
    """Starting points (E, W, K), all possible and all different, drawn without replacement from p(x | y)^b.

    b <= 1 is the largest power at which what `try_jointly` found is worth more than the walkers; it raises what that
    raises.
    """
    return try_jointly(posterior, rng, ensembles * walkers, counts).starts(rng, ensembles, walkers)


def try_jointly(posterior: JointPosterior, rng: np.random.Generator, count: int, counts: Outcomes) -> Tried:
    """``count`` possible points or more: draws around the valleys that joint least squares, with the prior beside it,
    finds from many starts, and what differential evolution makes of the better ones.

    Raises `SettingsError` if next to no admissible parameters reach the data.
    """
    tried = Tried.of(posterior, _around(posterior, rng), counts)
    for _ in range(ROUNDS):
        good = tried.possible
        more = posterior.prior.draw(rng, EACH) if len(good.x) < 4 else _better(good, rng)
        tried = tried.joined(Tried.of(posterior, more, counts))
    if len(tried.possible.x) < count:
        raise SettingsError(
            f"next to no {posterior.joint.label()} films that meet the convexity prior "
            f'"{posterior.joint.convexity}" fit every test',
            remedy="use shorter ranges, another material or another convexity prior",
        )
    return tried


def _around(posterior: JointPosterior, rng: np.random.Generator) -> Array:
    """Draws (M, K) from wide t-distributions around optima of likelihood times prior, with noises that suit each."""
    objective = JointObjective(with_fewer_readings(posterior.joint), posterior.solve)
    found, _, noises = objective.settled(objective.starts(rng), pull=True)
    likely, size = objective.descended(found, np.maximum(noises, _noises(objective, found[0])), pull=True)
    likely = likely[size**2 < np.min(size**2) + LIKELY]
    # Each test may be followed closely at the cost of the others, and several energies may follow all of them.
    modes = [*found[: len(posterior.joint.parts) + 1], *likely[:MOST]]
    return np.concatenate([_drawn(posterior, objective, x, rng) for x in modes])


def _noises(objective: JointObjective, x: Array) -> Array:
    """(P,) N, or in units of the stated noise: what residuals at one x (K',) show, and what is stated at least."""
    misfits = np.array([np.sqrt(np.mean(r * r)) for r in objective.each(x)])
    return np.maximum(objective.inferred(x), np.where(objective.first == 1.0, misfits, 0.0))


def _drawn(posterior: JointPosterior, objective: JointObjective, mode: Array, rng: np.random.Generator) -> Array:
    """Draws (AROUND, K) around one optimum (K',), as wide as its curvature says, and wider."""
    noises, (low, high) = _noises(objective, mode), objective.bounds
    slopes = objective.batch(mode[None, :], noises)[1][0]
    root = np.linalg.cholesky(np.linalg.inv(slopes.T @ slopes + np.diag(objective.spread**-2.0)))
    z = rng.standard_normal((AROUND, mode.size)) * np.sqrt(DEGREES / rng.chisquare(DEGREES, (AROUND, 1)))
    x = posterior.prior.draw(rng, AROUND)
    x[:, posterior.joint.curve] = np.clip(mode + WIDER * z @ root.T, low, high)
    for i, residual in enumerate(objective.each(mode)):
        _suited(posterior, i, x, float(np.sqrt(np.mean(residual**2))), rng)
    return x


def _suited(posterior: JointPosterior, number: int, x: Array, misfit: float, rng: np.random.Generator) -> None:
    """Put noises of one test near what its ``misfit`` shows into most of x (B, K), if a part of it is inferred."""
    part = posterior.joint.parts[number]
    at = posterior.joint.places[number][part.hypothesis.curve_size :]
    if not at.size:
        return
    m, noise = part.measurement, part.hypothesis.noise
    newton = misfit if m.force_sd is None else misfit * float(np.sqrt(np.mean(m.force_sd**2)))
    fits = np.log(newton / noise.natural(np.zeros((1, at.size)), 1.0)[0, 0] / np.max(np.abs(m.force)))
    some = rng.random(len(x)) < 0.7
    x[some, at[0]] = fits + 0.5 * rng.standard_normal(int(np.sum(some)))


def _better(good: Tried, rng: np.random.Generator) -> Array:
    """(EACH, K) what differential evolution makes of the better candidates."""
    return evolved(good.x[tempered(good.log_posterior, EACH / 2, EACH, rng)], rng)
