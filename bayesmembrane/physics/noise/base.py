"""What a noise model declares. One file per model; the registry finds it by its name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array, Natural, Normal, Parameter

if TYPE_CHECKING:
    from bayesmembrane.physics.effects.base import Effect

ROUND_OFF = 1e-13  # of the trace of a covariance: what doubles leave of its smallest eigenvalues
MEDIAN_SHARE, SPREAD = 3e-3, 2.0

LN_SD = Parameter(
    "ln_sd",
    "-",
    "log of the noise that is inferred, relative to the largest force",
    Normal(float(np.log(MEDIAN_SHARE)), SPREAD),
    (-25.0, 3.0),
)
"""tau / max|y| is log-normal: half of the prior lies below 0.3 % of the largest force, 95 % within 0.006 % to 15 %.

That spans a good load cell and a model that misses the curve altogether. Where the measurement gives its own noise,
tau comes on top of it, and a posterior that stays at the lower end says that nothing is needed on top.
"""

SD = Natural("sd", "N", "standard deviation of the noise that is inferred")


def force_scale(measurement: Measurement) -> float:
    """max |y| in N, to which the inferred noise is relative."""
    return float(np.max(np.abs(measurement.force)))


@dataclass(frozen=True, eq=False)
class Elsewhere:
    """Other points of the same film on the same rig.

    path : how the disc gets there
    force : (B, G) N, the curves of B draws
    traces : (B, E, G) N, what each effect changes of them; None where nothing asks for it
    places : (G,) where the points lie on the path; None if they are all of it
    """

    path: Motion
    force: Array
    traces: Array | None = None
    places: NDArray[np.int64] | None = None


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Sigma = Q diag(w + tau^2) Q^T with tau = scale exp(x), x the one coordinate of the noise.

    axes : (N, N) Q, None for the identity
    variance : (N,) w, N^2, or (1,) of all readings
    scale : N
    """

    axes: Array | None
    variance: Array
    scale: float


class NoiseLikelihood(ABC):
    """A noise model bound to one measurement of N points; ``x`` (B, k) are its coordinates, ``residual`` (B, N) y - F.

    What does not depend on the coordinates (eigenvalues of a covariance, gaps) is computed once, when it is made. What
    the readings scatter by knows nothing of F; a model that does says so in `at`.
    """

    @property
    def traced(self) -> bool:
        """Whether `at` asks for traces."""
        return False

    def at(self, force: Array, traces: Array | None = None) -> NoiseLikelihood:
        """The same for draws whose curves are ``force`` (B, N) N, with ``traces`` (B, E, N) N of their effects."""
        return self

    def along(self, axes: Array) -> NoiseLikelihood | None:
        """The same for residuals that lie in the span of orthonormal ``axes`` (R, N), told by their coordinates (B, R).

        None where the noise does not weigh all readings alike and independently.
        """
        return None

    @property
    def spectrum(self) -> NoiseSpectrum | None:
        """Of noise whose one coordinate adds the same variance along every axis; None of any other."""
        return None

    @abstractmethod
    def log_likelihood(self, residual: Array, x: Array) -> Array:
        """ln N(residual; 0, Sigma(x)), shape (B,)."""

    @abstractmethod
    def covariance(self, x: Array) -> Array:
        """Sigma(x) of one coordinate vector (k,), shape (N, N), N^2."""

    def pointwise(self, residual: Array, x: Array) -> Array:
        """ln p(y_i | all other y, x), shape (B, N).

        With K = Sigma^-1 it is ln N((K r)_i / K_ii; 0, 1 / K_ii), which is ln p(y_i | x) where points are independent
        (P.-C. Bürkner, J. Gabry, A. Vehtari, Comput. Stat. 36 (2021) 1243).
        """
        out = np.empty_like(residual)
        for b in range(len(residual)):
            k = np.linalg.inv(self.covariance(x[b]))
            out[b] = conditional(k @ residual[b], np.diag(k))
        return out

    def draw(self, x: Array, rng: np.random.Generator) -> Array:
        """One draw of the noise for each coordinate vector in x (B, k), shape (B, N), N."""
        roots = (root_of(self.covariance(row)[None])[0] for row in x)
        return np.stack([root @ rng.standard_normal(len(root)) for root in roots])

    def sd(self, x: Array) -> Array:
        """(B, N) N: the root of the diagonal of Sigma(x)."""
        return np.stack([np.sqrt(np.diag(self.covariance(row))) for row in x])

    # ---- another test of the same film on the same rig ---------------------------------------------------------------

    def fresh(self, x: Array, rng: np.random.Generator) -> Array:
        """(B, N) N: a draw of what differs in another test of the same film on the same rig, by the noise alone."""
        return self.draw(x, rng)

    def recurring(self, residual: Array, x: Array, rng: np.random.Generator, there: Elsewhere | None = None) -> Array:
        """(B, N) N: a draw, given ``residual``, of what would be the same in that other test; noise is not.

        With ``there`` (B, G): the same at those points.
        """
        return np.zeros_like(residual if there is None else there.force)

    def stated(self, residual: Array, x: Array) -> Array | None:
        """(B,) r^T S^-1 r with S the noise that the measurement states beside what would be the same in another test.

        None if it states none, or nothing would be the same: S is then its own noise alone.
        """
        return None


@dataclass(frozen=True)
class Noise(ABC):
    """What the measured force adds to the film's: y = F + e, e ~ N(0, Sigma_given + Sigma_inferred).

    Sigma_given is the measurement's own noise, if it states any, and a floor: nothing inferred can go below it.
    Sigma_inferred has one parameter at least, tau (``sd``, in N).

    name, title : how users call it, how reports print it
    ``coordinates`` : what is inferred; ``natural_parameters`` : the same as users read it, with ``natural`` from one
        to the other
    """

    name: ClassVar[str]
    title: ClassVar[str]

    def beside(self, effects: Sequence[Effect]) -> Noise:
        """The same for a hypothesis with these ``effects``: what is inferred may depend on what they are."""
        return self

    @property
    @abstractmethod
    def coordinates(self) -> tuple[Parameter, ...]:
        """The coordinates that are inferred, with their priors; forces are relative to the largest one measured."""

    @property
    @abstractmethod
    def natural_parameters(self) -> tuple[Natural, ...]:
        """What users read, each with its unit: first `SD`, the standard deviation that is inferred, if any is."""

    @abstractmethod
    def natural(self, x: Array, scale: float) -> Array:
        """The ``natural_parameters`` (B, n) of coordinates x (B, k), with the largest force ``scale`` in N."""

    @property
    def inferred(self) -> bool:
        """Whether a part of the noise is inferred, on top of what the measurement states."""
        return True

    @classmethod
    def stated_only(cls) -> Noise:
        """The model with nothing inferred; raises `SettingsError` if it cannot do without, as most cannot."""
        raise SettingsError(
            f'the noise model "{cls.name}" always infers a part of the noise', remedy='use "white" to do without'
        )

    @abstractmethod
    def bind(self, measurement: Measurement) -> NoiseLikelihood:
        """The likelihood for one measurement.

        Raises `SettingsError` if the inferred part is off and the measurement gives no noise of its own.
        """


def root_of(sigma: Array) -> Array:
    """Cholesky factors of (B, N, N); where a memory of many times the test leaves round-off, that much is added."""
    try:
        return np.asarray(np.linalg.cholesky(sigma))
    except np.linalg.LinAlgError:
        trace = np.trace(sigma, axis1=1, axis2=2)
        return np.asarray(np.linalg.cholesky(sigma + ROUND_OFF * trace[:, None, None] * np.eye(sigma.shape[1])))


def conditional(pull: Array, precision: Array) -> Array:
    """ln N(pull / precision; 0, 1 / precision), elementwise."""
    return np.asarray(0.5 * (np.log(precision / (2 * np.pi)) - pull * pull / precision))
