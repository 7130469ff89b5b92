"""Fits of hypotheses by least squares from several starts, freed of noise and of form error, and their evidence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np

from bayesmembrane.calibration.descent import Patience, descend
from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, log_inside, weighed
from bayesmembrane.diagnosis.candidates.standard import Standard
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.thresholds import FORM, SEARCH, TINY
from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.form_error import LARGEST
from bayesmembrane.physics.hypothesis import Hypothesis


@dataclass(frozen=True, eq=False)
class Freeing:
    """W v with W (S + U U^T) W^T = 1: values freed of noise S and of a form error with the columns U.

    With U = Q s V^T freed of noise, W = 1 - Q (1 - 1 / sqrt(1 + s^2)) Q^T after that.
    """

    noise: OwnNoise
    axes: Array
    shrink: Array

    def __call__(self, values: Array) -> Array:
        white = self.noise.white(values)
        along = self.axes.T @ white.reshape(len(white), -1)
        return white - (self.axes @ (self.shrink[:, None] * along)).reshape(white.shape)


class Weighing(ABC):
    """Fits hypotheses to readings under one noise, and weighs them; what the readings are of, subclasses say.

    noise : of the readings; every hypothesis may scale it a little
    force : (N,) N, the readings
    """

    noise: OwnNoise

    @property
    @abstractmethod
    def force(self) -> Array: ...

    @abstractmethod
    def batch(self, hypothesis: Hypothesis, x: Array) -> tuple[Array, Array]:
        """r (B, N) N, fitted less measured, and dr/dx (B, N, k) at x (B, k); nan where there is no curve."""

    @abstractmethod
    def misfits(self, hypothesis: Hypothesis, x: Array) -> Array:
        """r (B, N) N as `batch`, without slopes."""

    @abstractmethod
    def curves(self, hypothesis: Hypothesis, x: Array) -> Array:
        """Forces (B, N) N at x (B, k), by the whole solver; nan where there is none."""

    @abstractmethod
    def traces(self, hypothesis: Hypothesis, x: Array, force: Array) -> Array:
        """(E, N) N: what each effect changes of the force (N,) at x (k,); zeros for one that is exact."""

    @abstractmethod
    def forms(self, force: Array, effects: Sequence[Effect], traces: Array) -> list[tuple[Parameter | None, Array]]:
        """What a form error could look like, `form_columns`."""

    @abstractmethod
    def axes(self, hypothesis: Hypothesis) -> Standard:
        """The coordinates that are stepped in."""

    @abstractmethod
    def expected_sizes(self, effect: Effect) -> Array:
        """(s,) of an effect, as many as it has, expected before the data, in the units of these parameters."""

    @abstractmethod
    def material_starts(self, hypothesis: Hypothesis) -> list[Array]:
        """Starts (k,) from draws of the material's prior brought to their best modulus, without any effect."""

    def fit(self, hypothesis: Hypothesis, starts: Sequence[Array], parent: Candidate | None = None) -> Candidate | None:
        """The best of the searches from ``starts`` (k,); None if no film of this hypothesis reaches the data.

        The form error is that of ``parent``, or the usual one of an energy; `polished` takes that of the fit itself.
        """
        axes = self.axes(hypothesis)
        u, size = self._descended(hypothesis, axes, self._freeing(parent), axes.to_u(np.array(starts)))
        if not np.any(np.isfinite(size)):
            return None
        return self._candidate(hypothesis, axes, u[int(np.argmin(size))])

    def at(self, hypothesis: Hypothesis, x: Array) -> Candidate | None:
        """The hypothesis weighed at the coordinates x (k,), without a search; None if no film gets there."""
        if not np.all(np.isfinite(self.batch(hypothesis, x[None, :])[0])):
            return None
        axes = self.axes(hypothesis)
        return self._candidate(hypothesis, axes, axes.to_u(x))

    def polished(self, found: Candidate) -> Candidate:
        """The same hypothesis, searched on from where it is with the form error that it shows.

        The end counts even if its evidence is less: that of the start rests on a linear model far from where it holds.
        """
        axes = self.axes(found.hypothesis)
        u, size = self._descended(
            found.hypothesis, axes, self._freeing(found, False), axes.to_u(found.x)[None, :], SEARCH.last_iterations
        )
        return self._candidate(found.hypothesis, axes, u[0]) if np.isfinite(size[0]) else found

    def weighed_anew(self, candidate: Candidate) -> Candidate:
        """The same fit under the present noise: its evidence moves with it, and the linear model says how."""
        axes = self.axes(candidate.hypothesis)
        return self._weighed(candidate, axes, axes.to_u(candidate.x))

    def linear(self, candidate: Candidate) -> Linear:
        """The linear model of a candidate in the coordinates of `standard`, each over the sd of its local prior."""
        axes = self.axes(candidate.hypothesis)
        u = axes.to_u(candidate.x)
        spread = axes.local(u)
        own = self.noise.white(candidate.slopes * (axes.slope(u) * spread))
        data = self.noise.white(candidate.residual) + own @ (u / spread)
        return Linear(data, (Block(own), *self._forms(candidate)), self.scale_sd)

    def adapted(self, candidate: Candidate) -> Array:
        """(N,) N: the residual once the coordinates have taken what they can of it, to first order, without form error.

        By least squares: what a user would call the best fit of this model.
        """
        white = self.noise.white(np.column_stack([candidate.slopes, candidate.residual]))
        taken = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=SEARCH.rank)[0]
        return np.asarray(candidate.residual - candidate.slopes @ taken)

    def excess(self, candidate: Candidate) -> float:
        """Squares of its best fit beyond those of noise, in variances of the noise; 0 or more."""
        return beyond_noise(self.noise.white(self.adapted(candidate)), candidate)

    def steepness(self, candidate: Candidate) -> Array:
        """(k,) dx over the coefficients of `linear`."""
        axes = self.axes(candidate.hypothesis)
        u = axes.to_u(candidate.x)
        return np.asarray(axes.slope(u) * axes.local(u))

    def coefficients_at(self, candidate: Candidate) -> Array:
        """(k,) the coefficients of `linear` at the fit itself."""
        axes = self.axes(candidate.hypothesis)
        u = axes.to_u(candidate.x)
        return np.asarray(u / axes.local(u))

    @property
    def scale_sd(self) -> float:
        """sd of ln of the noise over its reference."""
        return FORM.stated_scale_sd if self.noise.stated else FORM.scale_sd

    def covariance(self, candidate: Candidate) -> Array:
        """(k, k) of the coordinates about a fit of this search, its form error included."""
        _, covariance = self.linear(candidate).coefficients(candidate.theta)
        steep, k = self.steepness(candidate), candidate.x.size
        return np.asarray(steep[:, None] * covariance[:k, :k] * steep)

    # ---- form error ----------------------------------------------------------------------------------------------

    def _columns(self, candidate: Candidate) -> list[tuple[Parameter | None, Array]]:
        """What its form error could look like, in N, each with the parameter of its relative size, if that is open."""
        return self.forms(self.force - candidate.residual, candidate.hypothesis.effects, candidate.traces)

    def _forms(self, candidate: Candidate) -> list[Block]:
        """The same freed of noise, with the priors of their relative sizes."""
        return [_form(size, self.noise.white(columns)) for size, columns in self._columns(candidate)]

    def _freeing(self, parent: Candidate | None, capped: bool = True) -> Freeing:
        if parent is None:
            force, nothing = np.abs(self.force), np.empty((0, self.force.size))
            forms = [_form(size, self.noise.white(c)) for size, c in self.forms(force, (), nothing)]
        else:
            forms = self._forms(parent)
        found: Iterator[float] = repeat(np.inf) if parent is None else iter(parent.theta[1:].tolist())
        etas = [1.0 if b.ln_eta is None else _eta(b.ln_eta[0], next(found), capped) for b in forms]
        columns = np.column_stack([eta * b.columns for eta, b in zip(etas, forms, strict=True)])
        # From the products: LAPACK's decomposition of the columns themselves fails where some are next to nothing.
        square, v = np.linalg.eigh(columns.T @ columns)
        keep = square > SEARCH.least_form**2
        q = columns @ (v[:, keep] / np.sqrt(square[keep]))
        return Freeing(self.noise, q, 1 - 1 / np.sqrt(1 + square[keep]))

    # ---- one fit -------------------------------------------------------------------------------------------------

    def _descended(
        self, hypothesis: Hypothesis, axes: Standard, freeing: Freeing, starts: Array, most: int = SEARCH.iterations
    ) -> tuple[Array, Array]:
        """Where searches from u (B, k) end, and the roots of their sums of squares (B,), the prior's included."""

        def residuals(u: Array) -> tuple[Array, Array]:
            r, j = _freed(freeing, *self.batch(hypothesis, axes.to_x(u)))
            pull, steep = axes.pull(u)
            diagonal = steep[:, :, None] * np.eye(u.shape[1])
            return (
                np.concatenate([r, pull], axis=1),
                np.concatenate([j * axes.slope(u)[:, None, :], diagonal], axis=1),
            )

        patience = Patience(SEARCH.given_up, SEARCH.slow_below)
        return descend(residuals, starts, axes.bounds, most, patience=patience)

    def _candidate(self, hypothesis: Hypothesis, axes: Standard, u: Array) -> Candidate:
        x = axes.to_x(u)
        r, j = self.batch(hypothesis, x[None, :])
        slopes = np.where(np.isfinite(j[0]), j[0], 0.0)
        trace = self.traces(hypothesis, x, r[0] + self.force)
        nothing = np.zeros(r.shape[1])
        found = Candidate(
            hypothesis, x, -r[0], slopes, -np.inf, _at_bound(hypothesis, axes, u), trace, np.empty(0), nothing
        )
        return self._weighed(found, axes, u)

    def _weighed(self, found: Candidate, axes: Standard, u: Array) -> Candidate:
        model = self.linear(found)
        z = weighed(model, found.theta)
        mean, _ = model.coefficients(z.theta)
        form = np.column_stack([c for _, c in self._columns(found)]) @ mean[u.size :]
        return replace(
            found, log_evidence=z.log_evidence + self.log_corrected(found, model, z.theta), theta=z.theta, form=form
        )

    def log_corrected(self, found: Candidate, model: Linear, theta: Array) -> float:
        """ln Z under the true priors within their bounds less ln Z of the linear ``model`` with its normal ones."""
        axes = self.axes(found.hypothesis)
        u = axes.to_u(found.x)
        spread, k = axes.local(u), u.size
        mean, covariance = model.coefficients(theta)
        low, high = axes.ends
        inside = log_inside(mean[:k], covariance[:k, :k], low / spread, high / spread)
        return inside + axes.log_replaced(u, mean[:k] * spread, np.diag(covariance)[:k] * spread**2)


def beyond_noise(white: Array, candidate: Candidate) -> float:
    """Squares of residuals (N,), freed of noise, beyond those that noise leaves beside a fit; 0 or more."""
    return max(float(white @ white) - (white.size - candidate.x.size), 0.0)


def _freed(freeing: Freeing, r: Array, j: Array) -> tuple[Array, Array]:
    """Residuals (B, N) and slopes (B, N, k) freed; a start without a curve is nan, and only that one."""
    wide = np.moveaxis(np.concatenate([r[:, :, None], j], axis=2), 1, 0)
    out = np.full(wide.shape, np.nan)
    good = np.all(np.isfinite(wide), axis=(0, 2))
    out[:, good] = freeing(wide[:, good])
    out = np.moveaxis(out, 0, 1)
    return out[:, :, 0], out[:, :, 1:]


def starts_with(bases: Sequence[Array], effect: Effect, expected: Array) -> list[Array]:
    """Starts for ``bases`` (k,) with one more effect, in parts of its ``expected`` (s,) sizes: from the first a small
    and a middling one, from the others a small one, and both signs where both are allowed.
    """
    signs = (1.0,) if effect.size.one_sided else (1.0, -1.0)
    small, middling = SEARCH.small_share, SEARCH.middling_share
    out = []
    for i, base in enumerate(bases):
        for sign in signs:
            for share in (small, middling) if i == 0 else (small,):
                for shape in [{}, *effect.starts] if i == 0 else [{}]:
                    theta = np.array([shape.get(p.name, p.typical) for p in effect.coordinates])
                    for j, scale in zip(effect.sizes, expected.tolist(), strict=True):
                        theta[j] = (effect.coordinates[j].null or 0.0) + sign * share * scale
                    out.append(np.concatenate([base, effect.within_bounds(theta)]))
    return out


def _eta(usual: float, found: float, capped: bool) -> float:
    """Of two ln eta; capped, for a poor parent's is large, and would take what the coordinates are to explain."""
    return float(np.exp(min(usual, found) if capped else found))


def _form(size: Parameter | None, columns: Array) -> Block:
    if size is None:
        return Block(columns)
    return Block(columns, _moments(size), float(np.log(LARGEST[size.name])))


def _moments(p: Parameter) -> tuple[float, float]:
    assert isinstance(p.prior, Normal)
    return p.prior.mean, p.prior.sd


def _at_bound(hypothesis: Hypothesis, axes: Standard, u: Array) -> tuple[str, ...]:
    """Coordinates at a bound that stops them: not at the absence of an effect, nor where its law ends of itself."""
    out = []
    for i, (p, axis) in enumerate(zip(hypothesis.parameters[: hypothesis.curve_size], axes.axes, strict=True)):
        low, high = axes.bounds[0][i], axes.bounds[1][i]
        support = [float(axis.to_u(np.asarray(e))) for e in p.prior.support if np.isfinite(e)]
        ends = {*support, *([0.0] if axis.one_sided else [])}
        for bound in (low, high):
            if abs(u[i] - bound) <= SEARCH.at_bound * max(high - low, TINY) and bound not in ends:
                out.append(p.name)
    return tuple(out)
