"""White noise, and relative errors of the energy, of the laws of effects and where nothing is steady: see
`physics/form_error.py`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array, Natural, Parameter
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.physics.form_error import (
    ENERGY,
    LAW,
    LOCAL,
    FormFactors,
    form_factors,
    joint_factors,
    local_size,
    mixed,
)
from bayesmembrane.physics.noise.base import LN_SD, SD, Elsewhere, Noise, NoiseLikelihood, conditional, force_scale

if TYPE_CHECKING:
    from bayesmembrane.physics.effects.base import Effect

TINY = 1e-12
"""Least part of a point's variance that all others leave open, beyond which a double cannot tell."""


@dataclass(frozen=True)
class Form(Noise):
    """Sigma = Sigma_given + tau^2 I + (eta_a^2 + m^2) D_F K_u D_F + sum_e eta_e^2 D_te K_v D_te + (eta_l F_max)^2 P.

    One eta_e for all e; P has ones where the test starts, turns, stops or goes slack.

    laws : whether there are effects whose law may be off; without, eta_e is not inferred
    """

    laws: bool = False

    name: ClassVar[str] = "form"
    title: ClassVar[str] = "white noise and smooth form errors"

    def beside(self, effects: Sequence[Effect]) -> Form:
        return replace(self, laws=any(not e.exact for e in effects))

    @property
    def coordinates(self) -> tuple[Parameter, ...]:
        return (LN_SD, ENERGY, LOCAL, LAW) if self.laws else (LN_SD, ENERGY, LOCAL)

    @property
    def natural_parameters(self) -> tuple[Natural, ...]:
        named = (("eta", ENERGY), ("eta_local", LOCAL), *((("eta_law", LAW),) if self.laws else ()))
        return (SD, *(Natural(name, "-", p.meaning.removeprefix("log of the ")) for name, p in named))

    def natural(self, x: Array, scale: float) -> Array:
        return np.asarray(np.exp(x) * np.array([scale, *(1.0,) * (x.shape[1] - 1)]))

    def bind(self, measurement: Measurement) -> FormLikelihood:
        return FormLikelihood(measurement, self.laws)


class FormSizes(NamedTuple):
    """Of B draws, (B,) each: tau^2 in N^2, eta_a, eta_e, and eta_l F_max in N."""

    power: Array
    energy: Array
    law: Array
    local: Array


class FormLikelihood(NoiseLikelihood):
    """O(N r^2) a draw, with r columns of all factors: Sigma = Lambda + U U^T, and M = 1 + U^T Lambda^-1 U is r x r.

    r^T Sigma^-1 r = (r - U a)^T Lambda^-1 (r - U a) + a^T a with a = M^-1 U^T Lambda^-1 r, the most probable errors,
    and |Sigma| = |Lambda| |M| (M. A. Woodbury, Princeton SRG Memo 42, 1950). A covariance that the measurement states
    is turned to its axes first, O(N^2 r). What is not steady is noise of its own at its readings, a part of Lambda, or
    further columns of U beside such axes.

    Until it is told of curves (`at`), those measured stand for them, and effects have no trace.
    """

    def __init__(self, measurement: Measurement, laws: bool) -> None:
        self.measurement, self.laws = measurement, laws
        self.scale = force_scale(measurement)
        self.factors = form_factors(measurement)
        self.axes: Array | None = None
        self.own, self.spots = np.zeros(len(measurement)), np.zeros(len(measurement))
        self.spots[self.factors.spots] = 1.0
        if measurement.covariance is not None:
            self.own, self.axes = eigh(measurement.covariance)
        elif measurement.force_sd is not None:
            self.own = measurement.force_sd**2
        self.force = measurement.force[None, :]
        self.traces = np.zeros((1, 0, len(measurement)))
        self.kept = np.zeros(0, dtype=np.int64)

    @property
    def traced(self) -> bool:
        return self.laws

    def at(self, force: Array, traces: Array | None = None) -> FormLikelihood:
        """The same for these curves; `covariance` is then that of the first."""
        told = copy(self)
        told.force = force
        if traces is not None:
            told.kept = np.flatnonzero(np.any(traces != 0, axis=(0, 2)))
            told.traces = traces[:, told.kept]
        return told

    def log_likelihood(self, residual: Array, x: Array) -> Array:
        square, log_det = self._squares(residual, self._sizes(x), self._staying(x))
        return np.asarray(-0.5 * (square + log_det + residual.shape[1] * np.log(2 * np.pi)))

    def stated(self, residual: Array, x: Array) -> Array | None:
        if not np.any(self.own):
            return None
        sizes = self._sizes(x)._replace(power=np.zeros(len(x)))
        return self._squares(residual, sizes, np.zeros(residual.shape))[0]

    def _squares(self, residual: Array, sizes: FormSizes, stays: Array) -> tuple[Array, Array]:
        """(r^T Sigma^-1 r, ln |Sigma|), (B,) each, with what stays of the noise (B, N)."""
        force, traces = self._curves(len(residual))
        axes = np.empty((0, 0)) if self.axes is None else self.axes
        r = self._turned(residual)
        own, film = self._own(sizes), self._on_film(sizes.energy)
        parts = (
            r,
            force,
            traces,
            sizes.power,
            own,
            stays,
            film,
            sizes.law,
            sizes.local,
            *self._roots,
            axes,
            self._turns,
        )
        square, log_det = _squares(*map(for_kernel, parts))
        return square, log_det

    def _staying(self, x: Array) -> Array:
        """(B, N) what part of the noise at one reading is left at the next: of white noise nothing."""
        return np.zeros((len(x), self.own.size))

    def covariance(self, x: Array) -> Array:
        sizes = self._sizes(x[None, :])
        total = float(self._on_film(sizes.energy)[0])
        u = self._columns(self.factors, self.force[0], self.traces[0], total, float(sizes.law[0]))
        own = np.diag(self.own) if self.axes is None else (self.axes * self.own) @ self.axes.T
        return np.asarray(own + np.diag(sizes.power + sizes.local**2 * self.spots) + u @ u.T)

    def sd(self, x: Array) -> Array:
        sizes = self._sizes(x)
        force, traces = self._curves(len(x))
        own = self.own if self.axes is None else (self.axes**2) @ self.own
        smooth = (self._on_film(sizes.energy)[:, None] * force) ** 2
        smooth = smooth + sizes.law[:, None] ** 2 * np.sum(traces**2, axis=1)
        return np.asarray(np.sqrt(own + sizes.power[:, None] + sizes.local[:, None] ** 2 * self.spots + smooth))

    def pointwise(self, residual: Array, x: Array) -> Array:
        out = np.empty_like(residual)
        sizes = self._sizes(x)
        own = self._own(sizes)
        for b, u in enumerate(self._each(x)):
            r, variance = residual[b], np.maximum(own[b] + sizes.power[b], 1e-300)
            root = _root(np.ascontiguousarray(u / np.sqrt(variance)[:, None]))
            w = solve_triangular(root, (u / variance[:, None]).T, lower=True, check_finite=False)
            a = _solved(root, u.T @ (self._turned(r) / variance))
            pull, share = (self._turned(r) - u @ a) / variance, np.sum(w * w, axis=0) * variance
            precision = np.maximum(1 - share, TINY) / variance
            if self.axes is not None:
                pull = self.axes @ pull
                least = TINY * ((self.axes**2) @ (1 / variance))
                precision = np.maximum((self.axes**2) @ (1 / variance) - np.sum((w @ self.axes.T) ** 2, axis=0), least)
            out[b] = conditional(pull, precision)
        return out

    def draw(self, x: Array, rng: np.random.Generator) -> Array:
        force, traces = self._curves(len(x))
        sizes = self._sizes(x)
        total = self._on_film(sizes.energy)
        out = self.fresh(x, rng)
        for b in range(len(x)):
            u = self._columns(self.factors, force[b], traces[b], total[b], sizes.law[b])
            out[b] += u @ rng.standard_normal(u.shape[1])
        return out

    def fresh(self, x: Array, rng: np.random.Generator) -> Array:
        """With what is not steady: no drive repeats that."""
        z = rng.standard_normal((len(x), self.own.size)) * np.sqrt(self.own + self._sizes(x).power[:, None])
        return (z if self.axes is None else z @ self.axes.T) + self._unsteady(x, rng)

    def _unsteady(self, x: Array, rng: np.random.Generator) -> Array:
        """(B, N) N: a draw of the error where the test starts, turns, stops or goes slack."""
        z: Array = rng.standard_normal((len(x), self.own.size)) * self.spots
        return z * self._sizes(x).local[:, None]

    def recurring(self, residual: Array, x: Array, rng: np.random.Generator, there: Elsewhere | None = None) -> Array:
        """(B, N) or (B, G) N: U a with a ~ N(M^-1 U^T Lambda^-1 r, M^-1), the errors of this energy and these laws.

        Where no effect is at work, what effects and the film mix is none of the film's: of the two, which are alike in
        all that was seen, the energy's error has its own part.
        """
        n = len(self.measurement)
        joint = self.factors if there is None else joint_factors(self.measurement, there.path, there.places)
        here = FormFactors(joint.state[:n], joint.progress[:n])
        force, traces = self._curves(len(x)) if there is None else self._shown(there)
        beyond = slice(0, n) if there is None else slice(n, None)
        away = FormFactors(joint.state[beyond], joint.progress[beyond])
        _, eta, law, _ = self._sizes(x)
        total = self._on_film(eta)
        alone, size, own = there is not None and there.traces is None, joint.state.shape[1], self._own(self._sizes(x))
        out = np.empty(force.shape)
        for b, u in enumerate(self._each(x, here)):
            both = np.column_stack([u, self._turned(residual[b])])
            white = self._whitened(both, x[b], own[b])
            root = _root(np.ascontiguousarray(white[:, :-1]))
            a = _solved(root, white[:, :-1].T @ white[:, -1])
            a += solve_triangular(root, rng.standard_normal(len(a)), lower=True, trans="T", check_finite=False)
            if alone:
                part = eta[b] / total[b]
                a[:size] = part * a[:size] + np.sqrt(1 - part**2) * rng.standard_normal(size)
            beyond_here = self._columns(away, force[b], traces[b], eta[b] if alone else total[b], law[b])
            out[b] = beyond_here @ a[: beyond_here.shape[1]]
        return out

    # ---- pieces ------------------------------------------------------------------------------------------------------

    @property
    def _roots(self) -> tuple[Array, Array]:
        return self.factors.state, self.factors.progress

    @property
    def _turns(self) -> Array:
        """(N, m) columns of the unsteady readings on the axes; none where these are noise of their own."""
        return np.empty((len(self.spots), 0)) if self.axes is None else self.axes.T[:, self.spots > 0]

    def _sizes(self, x: Array) -> FormSizes:
        """Of x (B, k) and the curves."""
        law = np.exp(x[:, 3]) if self.laws else np.zeros(len(x))
        local = np.exp(x[:, 2]) * local_size(self._curves(len(x))[0])
        return FormSizes((np.exp(x[:, 0]) * self.scale) ** 2, np.exp(x[:, 1]), law, local)

    def _own(self, sizes: FormSizes) -> Array:
        """(B, N) variances on the axes beside tau^2: what the measurement states, and without such axes what is not
        steady.
        """
        if self.axes is not None:
            return np.broadcast_to(self.own, (len(sizes.local), self.own.size))
        return self.own + sizes.local[:, None] ** 2 * self.spots

    def _on_film(self, eta: Array) -> Array:
        """(B,) the relative error along the states, of the energy (B,) and of what the film and its effects mix."""
        return np.asarray(np.hypot(eta, mixed(*self._curves(len(eta)))))

    def _curves(self, count: int) -> tuple[Array, Array]:
        """Forces (B, N) and traces (B, E, N)."""
        if len(self.force) == count == len(self.traces):
            return self.force, self.traces
        n = len(self.measurement)
        return np.broadcast_to(self.force, (count, n)), np.broadcast_to(self.traces, (count, self.traces.shape[1], n))

    def _shown(self, there: Elsewhere) -> tuple[Array, Array]:
        """Forces (B, G) elsewhere, and traces (B, E, G) of the effects that have one here."""
        if there.traces is None:
            return there.force, np.zeros((len(there.force), len(self.kept), there.force.shape[1]))
        return there.force, there.traces[:, self.kept]

    def _turned(self, residual: Array) -> Array:
        return residual if self.axes is None else residual @ self.axes

    def _columns(self, factors: FormFactors, force: Array, traces: Array, eta: float, law: float) -> Array:
        """U (N, r) of one draw, before it is turned."""
        parts = [eta * force[:, None] * factors.state]
        return np.concatenate([*parts, *(law * t[:, None] * factors.progress for t in traces)], axis=1)

    def _whitened(self, values: Array, x: Array, own: Array) -> Array:
        """(N, c) values on the axes freed of ``own`` (N,) noise and tau^2, with coordinates x (k,)."""
        power = (np.exp(x[0]) * self.scale) ** 2
        white: Array = innovations(values, float(power), for_kernel(own), self._staying(x[None, :])[0])
        return white

    def _each(self, x: Array, factors: FormFactors | None = None) -> Iterator[Array]:
        """U (N, r) on the axes, draw by draw; beside such axes with what is not steady at its end."""
        force, traces = self._curves(len(x))
        sizes = self._sizes(x)
        total = self._on_film(sizes.energy)
        for b in range(len(x)):
            u = self._columns(factors or self.factors, force[b], traces[b], total[b], sizes.law[b])
            yield u if self.axes is None else np.column_stack([self.axes.T @ u, sizes.local[b] * self._turns])


def _solved(root: Array, right: Array) -> Array:
    """M^-1 b of the root of M."""
    half = solve_triangular(root, right, lower=True, check_finite=False)
    return np.asarray(solve_triangular(root, half, lower=True, trans="T", check_finite=False))


@compiled(nogil=True, error_model="numpy")
def innovations(values, power, own, stays):  # type: ignore[no-untyped-def]
    """(N, c): L^-1 v of values v (N, c), with L L^T the covariance of ``own`` (N,) noise and of a process of variance
    ``power`` of which the part ``stays`` (N,) is left of the reading before: R. E. Kalman's filter.
    """
    out = np.empty_like(values)
    mean = np.zeros(values.shape[1])
    variance = power
    for i in range(values.shape[0]):
        f = stays[i] if i > 0 else 0.0
        variance = power + f * f * (variance - power)
        s = max(variance + own[i], 1e-300)
        gain, scale = variance / s, 1.0 / np.sqrt(s)
        for j in range(values.shape[1]):
            m = f * mean[j]
            e = values[i, j] - m
            out[i, j] = e * scale
            mean[j] = m + gain * e
        variance = variance * (1.0 - gain)
    return out


@compiled(nogil=True, error_model="numpy")
def log_scale(power, own, stays):  # type: ignore[no-untyped-def]
    """ln |L L^T| of the same."""
    variance, total = power, 0.0
    for i in range(own.size):
        f = stays[i] if i > 0 else 0.0
        variance = power + f * f * (variance - power)
        s = max(variance + own[i], 1e-300)
        total += np.log(s)
        variance = variance * (1.0 - variance / s)
    return total


@compiled(nogil=True, error_model="numpy")
def _root(w):  # type: ignore[no-untyped-def]
    """Lower triangular root of 1 + w^T w, whose pivots are at least 1 however large w is."""
    size = w.shape[1]
    m = np.dot(np.ascontiguousarray(w.T), w)
    for j in range(size):
        pivot = m[j, j] + 1.0
        for k in range(j):
            pivot -= m[j, k] * m[j, k]
        m[j, j] = np.sqrt(max(pivot, 1.0))
        for i in range(j + 1, size):
            s = m[i, j]
            for k in range(j):
                s -= m[i, k] * m[j, k]
            m[i, j] = s / m[j, j]
            m[j, i] = 0.0
    return m


@compiled(nogil=True, error_model="numpy")
def _squares(residual, force, traces, power, own, stays, eta, law, local, state, progress, axes, turns):  # type: ignore[no-untyped-def]
    """(r^T Sigma^-1 r (B,), ln |Sigma| (B,)); residual, own variance and turns on the axes, if any.

    Loops in place of parts of arrays that are set at once: numba compiles in half the time.
    """
    draws, n = residual.shape
    r, q, effects = state.shape[1], progress.shape[1], 0
    for b in range(draws):
        if law[b] > 0.0:
            effects = traces.shape[1]
    smooth, size = r + effects * q, r + effects * q + turns.shape[1]
    w = np.empty((n, size + 1))
    square, log_det = np.empty(draws), np.empty(draws)
    a = np.empty(size)
    for b in range(draws):
        for i in range(n):
            for j in range(r):
                w[i, j] = eta[b] * force[b, i] * state[i, j]
            for e in range(effects):
                for j in range(q):
                    w[i, r + e * q + j] = law[b] * traces[b, e, i] * progress[i, j]
        if axes.size:
            turned = np.dot(np.ascontiguousarray(axes.T), np.ascontiguousarray(w[:, :smooth]))
            for i in range(n):
                for j in range(smooth):
                    w[i, j] = turned[i, j]
                for j in range(smooth, size):
                    w[i, j] = local[b] * turns[i, j - smooth]
        for i in range(n):
            w[i, size] = residual[b, i]
        white = innovations(w, power[b], own[b], stays[b])
        root = _root(np.ascontiguousarray(white[:, :size]))
        a[:] = 0.0
        for i in range(n):
            for j in range(size):
                a[j] += white[i, j] * white[i, size]
        for j in range(size):
            for k in range(j):
                a[j] -= root[j, k] * a[k]
            a[j] /= root[j, j]
        for j in range(size - 1, -1, -1):
            for k in range(j + 1, size):
                a[j] -= root[k, j] * a[k]
            a[j] /= root[j, j]
        total, logs = 0.0, log_scale(power[b], own[b], stays[b])
        for i in range(n):
            left = white[i, size]
            for j in range(size):
                left -= white[i, j] * a[j]
            total += left * left
        for j in range(size):
            total += a[j] * a[j]
            logs += 2.0 * np.log(root[j, j])
        square[b], log_det[b] = total, logs
    return square, log_det
