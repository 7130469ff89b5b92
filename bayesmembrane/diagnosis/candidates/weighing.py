"""Fits of hypotheses by least squares from several starts, freed of noise and of form error, and their evidence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import repeat
from weakref import WeakKeyDictionary

import numpy as np
from scipy.optimize import lsq_linear

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.evidence import Block, Linear, log_inside, tempered, weighed
from bayesmembrane.diagnosis.candidates.side_by_side import Freeing, Searching, run
from bayesmembrane.diagnosis.candidates.standard import Standard
from bayesmembrane.diagnosis.reference.noise import OwnNoise
from bayesmembrane.diagnosis.thresholds import FORM, SEARCH, TINY
from bayesmembrane.ground.lately import Lately
from bayesmembrane.ground.parameters import Array, Normal, Parameter
from bayesmembrane.ground.symmetric import eigh
from bayesmembrane.physics.effects.base import Effect
from bayesmembrane.physics.form_error import LARGEST, LOCAL, error_size
from bayesmembrane.physics.hypothesis import Hypothesis

ROUND_OFF = 1e-11
"""Of the largest number of columns: what differs by less is the same."""
A_PART = (0.0, 1.0)
"""Bounds of a part: it is no more than all, whatever its prior."""
MODELS = 4
"""Linear models that are kept: what is looked for beside one candidate is looked for piece by piece."""


@dataclass(frozen=True, eq=False)
class Sought:
    """A hypothesis, where to look for it from (k,), and the candidate whose form error counts; None: the usual one."""

    hypothesis: Hypothesis
    starts: Sequence[Array]
    parent: Candidate | None = None


Point = tuple[Hypothesis, Standard, Array]
"""A hypothesis, its coordinates, and u (k,)."""


class Weighing(ABC):
    """Fits hypotheses to readings under one noise, and weighs them; what the readings are of, subclasses say.

    noise : of the readings; every hypothesis may scale it a little
    force : (N,) N, the readings
    seed : of draws from priors, and of those that check an evidence
    """

    noise: OwnNoise

    @property
    @abstractmethod
    def force(self) -> Array: ...

    @property
    @abstractmethod
    def seed(self) -> int: ...

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

    def all_traces(self, every: Sequence[tuple[Hypothesis, Array, Array]]) -> list[Array]:
        """`traces` of each hypothesis, with its x (k,) and force (N,)."""
        return [self.traces(hypothesis, x, force) for hypothesis, x, force in every]

    @abstractmethod
    def forms(self, force: Array, effects: Sequence[Effect], traces: Array) -> list[tuple[Parameter | None, Array]]:
        """What a form error could look like, `form_columns`."""

    @abstractmethod
    def event_steps(self, hypothesis: Hypothesis) -> dict[int, float]:
        """{number of a coordinate that says where or when something sudden comes: from one reading to the next}."""

    @abstractmethod
    def axes(self, hypothesis: Hypothesis) -> Standard:
        """The coordinates that are stepped in."""

    @abstractmethod
    def expected_sizes(self, effect: Effect) -> Array:
        """(s,) of an effect, as many as it has, expected before the data, in the units of these parameters."""

    @abstractmethod
    def material_starts(self, hypothesis: Hypothesis) -> list[Array]:
        """Starts (k,) from draws of the material's prior brought to their best modulus, without any effect."""

    def batches(self, asked: Sequence[tuple[Hypothesis, Array]]) -> list[tuple[Array, Array]]:
        """`batch` of each."""
        return [self.batch(hypothesis, x) for hypothesis, x in asked]

    def fit(self, hypothesis: Hypothesis, starts: Sequence[Array], parent: Candidate | None = None) -> Candidate | None:
        """The best of the searches from ``starts`` (k,); None if no film of this hypothesis reaches the data.

        The form error is that of ``parent``, or the usual one of an energy; `polished` takes that of the fit itself.
        """
        return self.fits([Sought(hypothesis, starts, parent)])[0]

    def fits(self, every: Sequence[Sought]) -> list[Candidate | None]:
        """`fit` of each, side by side."""
        searches = [
            self._search(s.hypothesis, self._freeing(s.parent), np.array(s.starts), SEARCH.iterations) for s in every
        ]
        run(searches, self.batches)
        reached = [s for s in searches if np.any(np.isfinite(s.size))]
        found = self._candidates([(s.hypothesis, s.axes, s.u[int(np.argmin(s.size))]) for s in reached])
        by_search = dict(zip(reached, found, strict=True))
        return [by_search.get(s) for s in searches]

    def at(self, hypothesis: Hypothesis, x: Array) -> Candidate | None:
        """The hypothesis weighed at the coordinates x (k,), without a search; None if no film gets there."""
        return self.placed([(hypothesis, x)])[0]

    def placed(self, every: Sequence[tuple[Hypothesis, Array]]) -> list[Candidate | None]:
        """`at` of each."""
        axes = [self.axes(h) for h, _ in every]
        points = [(h, a, a.to_u(x)) for a, (h, x) in zip(axes, every, strict=True)]
        found = self.batches([(h, a.to_x(u)[None, :]) for h, a, u in points])
        reached = [bool(np.all(np.isfinite(r))) for r, _ in found]
        there = iter(self._candidates([p for p, good in zip(points, reached, strict=True) if good]))
        return [next(there) if good else None for good in reached]

    def unweighed(self, hypothesis: Hypothesis, x: Array) -> Candidate | None:
        """`at`, without its evidence and the sizes of noise and form error, for whoever has their own."""
        axes = self.axes(hypothesis)
        u = axes.to_u(x)
        reached = np.all(np.isfinite(self.batch(hypothesis, axes.to_x(u)[None, :])[0]))
        return self._drawn([(hypothesis, axes, u)])[0] if reached else None

    def polished(self, found: Candidate) -> Candidate:
        """The same hypothesis, searched on from where it is with the form error that it shows.

        The form error keeps the traces of the start. Where a law's is large it may carry what its effect did, and
        leave that nothing to do: then it is also searched with sizes no larger than usual. The most probable counts,
        the start among them: evidences rest on linear models, and one may be far from where it holds. Where a law turns
        out to be off by another error than the search knew, it is searched on once more, `SEARCH.polishings` times in
        all. A start without an evidence never counts.
        """
        return self.all_polished([found])[0]

    def all_polished(self, every: Sequence[Candidate], steps: int = SEARCH.last_iterations) -> list[Candidate]:
        """`polished` of each, side by side, by so many ``steps`` at most."""
        out, todo = list(every), list(range(len(every)))
        for _ in range(SEARCH.polishings):
            if not todo:
                break
            ends = self._searched_on([out[i] for i in todo], steps)
            for i, (end, _) in zip(todo, ends, strict=True):
                out[i] = end
            todo = [i for i, (_, again) in zip(todo, ends, strict=True) if again]
        return out

    def _searched_on(self, every: Sequence[Candidate], steps: int) -> list[tuple[Candidate, bool]]:
        """Of each the most probable of where it was and where searches end, and whether a law is off by another error
        than that search knew.
        """
        asked = [(i, False) for i in range(len(every))]
        asked += [(i, True) for i, c in enumerate(every) if max(c.law_errors.values(), default=0.0) > SEARCH.poor_law]
        searches = [
            self._search(c.hypothesis, self._freeing(c, capped), c.x[None, :], steps)
            for c, capped in ((every[i], capped) for i, capped in asked)
        ]
        run(searches, self.batches)
        reached = [s for s in searches if np.isfinite(s.size[0])]
        found = dict(zip(reached, self._candidates([(s.hypothesis, s.axes, s.u[0]) for s in reached]), strict=True))
        out = []
        for i, start in enumerate(every):
            knew = _law_errors(start, False)
            best, height = start, self.log_there(start) if np.isfinite(start.log_evidence) else -np.inf
            for (j, capped), search in zip(asked, searches, strict=True):
                end = found.get(search) if i == j else None
                if end is not None and (there := self.log_there(end)) > height:
                    best, height, knew = end, there, _law_errors(start, capped)
            out.append((best, _differ(knew, best.law_errors)))
        return out

    def log_there(self, candidate: Candidate) -> float:
        """ln p(y, x) at the coordinates x of a candidate, form error and noise integrated out: no linear model of the
        film is in it.
        """
        axes = self.axes(candidate.hypothesis)
        rest = Linear(self.noise.white(candidate.residual), tuple(self._forms(candidate)), self.scale_sd)
        return weighed(rest, candidate.theta).log_evidence + float(axes.log_prior(axes.to_u(candidate.x)))

    def weighed_anew(self, candidate: Candidate) -> Candidate:
        """The same fit under the present noise: its evidence moves with it, and the linear model says how."""
        axes = self.axes(candidate.hypothesis)
        return self._weighed(candidate, axes, axes.to_u(candidate.x))

    @cached_property
    def _models(self) -> Lately[Candidate, Linear]:
        return Lately(MODELS)

    def linear(self, candidate: Candidate) -> Linear:
        """The linear model of a candidate in the coordinates of `standard`, each over the sd of its local prior."""
        return self._models.of(candidate, partial(self._linear, candidate))

    def _linear(self, candidate: Candidate) -> Linear:
        axes = self.axes(candidate.hypothesis)
        u = axes.to_u(candidate.x)
        spread = axes.local(u)
        own = self.noise.white(candidate.slopes * (axes.slope(u) * spread))
        data = self.noise.white(candidate.residual) + own @ (u / spread)
        return Linear(data, (Block(own), *self._forms(candidate)), self.scale_sd)

    def adapted(self, candidate: Candidate) -> Array:
        """(N,) N: the residual once the coordinates have taken what they can of it, to first order, without form error.

        By least squares within the bounds: what a user would call the best fit of this model.
        """
        return self._adapted(candidate, candidate.slopes)

    def squares(self, candidate: Candidate, trace: Array | None = None) -> float:
        """Squares of its best fit, in variances of the noise; with a ``trace`` (N,) N of something else beside it."""
        slopes = candidate.slopes if trace is None else np.column_stack([candidate.slopes, trace])
        white = self.noise.white(self._adapted(candidate, slopes))
        return float(white @ white)

    def _adapted(self, candidate: Candidate, slopes: Array) -> Array:
        """With slopes (N, k or more), the first k of them of the coordinates; what is beside these has no bounds."""
        white = self.noise.white(np.column_stack([slopes, candidate.residual]))
        taken = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=SEARCH.rank)[0]
        low, high = self._room(candidate, slopes.shape[1])
        if np.any((taken < low) | (taken > high)):
            taken = _within(white[:, :-1], white[:, -1], low, high)
        return np.asarray(candidate.residual - slopes @ taken)

    @staticmethod
    def _room(candidate: Candidate, count: int) -> tuple[Array, Array]:
        """(count,), (count,): how far each coordinate may still go; those beyond the candidate's own anywhere."""
        bounds = [p.bounds for p in candidate.hypothesis.parameters[: candidate.x.size]]
        low, high = np.array(bounds).T - candidate.x
        far = np.full(count - candidate.x.size, np.inf)
        return np.concatenate([np.minimum(low, 0.0), -far]), np.concatenate([np.maximum(high, 0.0), far])

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
        _, covariance = self.linear(candidate).first(candidate.theta, candidate.x.size)
        steep = self.steepness(candidate)
        return np.asarray(steep[:, None] * covariance * steep)

    # ---- form error ----------------------------------------------------------------------------------------------

    def _columns(self, candidate: Candidate) -> list[tuple[Parameter | None, Array]]:
        """What its form error could look like, in N, each with the parameter of its relative size, if that is open."""
        return self.forms(self.force - candidate.residual, candidate.hypothesis.effects, candidate.traces)

    def _forms(self, candidate: Candidate) -> list[Block]:
        """The same freed of noise, with the priors of their relative sizes."""
        return [self._form(size, columns) for size, columns in self._columns(candidate)]

    def _form(self, size: Parameter | None, columns: Array) -> Block:
        if size is None:
            return Block(self.noise.white(columns))
        prior, most = _moments(size), float(np.log(LARGEST[size.name]))
        if size is not LOCAL or not columns.size:
            return Block(self.noise.white(columns), prior, most)
        columns, turn = self._turned(columns)
        return Block(columns, prior, most, turn)

    @cached_property
    def _turns(self) -> Lately[int, tuple[Array, Array, Array]]:
        return Lately(1)

    def _turned(self, columns: Array) -> tuple[Array, Array]:
        """(orthogonal columns (N, m), the turn to them) of single readings N, freed of noise.

        Noise that remembers makes neighbours among them alike. Of all candidates of one test they are the same, times
        a number.
        """
        first, turned, turn = self._turns.of(columns.shape[1], lambda: (columns, *self._apart(columns)))
        before, now = float(np.max(first)), float(np.max(columns))
        if before > 0 and np.max(np.abs(columns - now / before * first)) <= ROUND_OFF * now:
            return now / before * turned, turn
        return self._apart(columns)

    def _apart(self, columns: Array) -> tuple[Array, Array]:
        white = self.noise.white(columns)
        turn = eigh(white.T @ white)[1]
        return white @ turn, turn

    @cached_property
    def _freeings(self) -> Lately[tuple[Candidate | None, bool], Freeing]:
        return Lately(MODELS)

    def _freeing(self, parent: Candidate | None, capped: bool = True) -> Freeing:
        return self._freeings.of((parent, capped), partial(self._freed_of, parent, capped))

    def _freed_of(self, parent: Candidate | None, capped: bool) -> Freeing:
        if parent is None:
            force, nothing = np.abs(self.force), np.empty((0, self.force.size))
            forms = [self._form(size, c) for size, c in self.forms(force, (), nothing)]
        else:
            forms = self._forms(parent)
        found: Iterator[float] = repeat(np.inf) if parent is None else iter(parent.theta[1:].tolist())
        etas = [1.0 if b.ln_eta is None else _eta(b.ln_eta[0], next(found), capped) for b in forms]
        columns = np.column_stack([eta * b.columns for eta, b in zip(etas, forms, strict=True)])
        # From the products: LAPACK's decomposition of the columns themselves fails where some are next to nothing.
        square, v = eigh(columns.T @ columns)
        keep = square > SEARCH.least_form**2
        q = columns @ (v[:, keep] / np.sqrt(square[keep]))
        return Freeing(self.noise, q, 1 - 1 / np.sqrt(1 + square[keep]))

    # ---- one fit -------------------------------------------------------------------------------------------------

    def _search(self, hypothesis: Hypothesis, freeing: Freeing, x: Array, most: int) -> Searching:
        axes = self.axes(hypothesis)
        return Searching(hypothesis, axes, freeing, axes.to_u(x), most)

    def _candidates(self, points: Sequence[Point]) -> list[Candidate]:
        """The hypotheses at their points."""
        return [self._weighed(found, axes, u) for found, (_, axes, u) in zip(self._drawn(points), points, strict=True)]

    def _drawn(self, points: Sequence[Point]) -> list[Candidate]:
        """The same, not weighed."""
        x = [axes.to_x(u) for _, axes, u in points]
        found = self.batches([(h, v[None, :]) for (h, _, _), v in zip(points, x, strict=True)])
        traces = self.all_traces(
            [(h, v, r[0] + self.force) for (h, _, _), v, (r, _) in zip(points, x, found, strict=True)]
        )
        nothing, out = np.zeros(self.force.size), []
        for (h, axes, u), v, (r, j), trace in zip(points, x, found, traces, strict=True):
            slopes, bounds = np.where(np.isfinite(j[0]), j[0], 0.0), _at_bound(h, axes, u)
            slopes = self._over_readings(h, v, r[0], slopes)
            out.append(Candidate(h, v, -r[0], slopes, -np.inf, bounds, trace, np.empty(0), nothing))
        return out

    def _over_readings(self, hypothesis: Hypothesis, x: Array, r: Array, slopes: Array) -> Array:
        """Slopes (N, k) at x (k,) with the residual r (N,), by where something sudden comes from reading to reading.

        Between two readings it leaves no trace: by infinitely small steps it would seem that it may have come anywhere,
        which costs nothing. So a film that relaxes was named as one that slips, with 98 % (44 % by these). Searches go
        by infinitely small ones, for those lead to the best place. Of the two sides that one counts along which the
        residual lies least: that a single reading would be better met is no gain that goes on.
        """
        steps = self.event_steps(hypothesis)
        if not steps:
            return slopes
        moves = [(i, side * step) for i, step in steps.items() for side in (1, -1)]
        rows = np.tile(x, (len(moves), 1))
        for row, (i, step) in zip(rows, moves, strict=True):
            row[i] += step
        changes, out = self.misfits(hypothesis, rows) - r, slopes.copy()
        white = self.noise.white(np.column_stack([r, *changes]))
        sizes = np.linalg.norm(white[:, 1:], axis=0)
        along = np.abs(white[:, 0] @ white[:, 1:]) / np.maximum(sizes, TINY)
        for i in steps:
            low, high = hypothesis.parameters[i].bounds
            own = [j for j, (number, _) in enumerate(moves) if number == i and low <= rows[j, i] <= high]
            told = [j for j in own if 0 < sizes[j] < np.inf]
            if told:
                side = min(told, key=lambda j: float(along[j]))
                out[:, i] = changes[side] / moves[side][1]
        return out

    def _weighed(self, found: Candidate, axes: Standard, u: Array) -> Candidate:
        model = self.linear(found)
        z = weighed(model, found.theta)
        mean = model.mean(z.theta)
        form = np.column_stack([c for _, c in self._columns(found)]) @ mean[u.size :]
        log_evidence = z.log_evidence + self.log_corrected(found, model, z.theta)
        out = replace(found, log_evidence=log_evidence, theta=z.theta, form=form, by_draws=0.0)
        self._models.keep(out, model)  # it knows nothing of theta, nor of the evidence
        return out

    @cached_property
    def _tempered(self) -> WeakKeyDictionary[Candidate, tuple[float, float]]:
        return WeakKeyDictionary()

    def log_tempered(self, candidate: Candidate, counts: float) -> float:
        """ln int p(u) L(u)^a du with a = ``counts``: of the likelihood a part counts, and the prior whole.

        a ln Z would count a part of the prior too: what needs a large form error, or many parameters, would pay less
        for it. J. W. Miller, D. B. Dunson, J. Am. Stat. Assoc. 114 (2019) 1113. Of what draws said of ln Z a part a is
        taken.
        """
        known = self._tempered.get(candidate)
        if known is None or known[0] != counts:
            model = tempered(self.linear(candidate), counts)
            z = weighed(model, candidate.theta)
            value = z.log_evidence + self.log_corrected(candidate, model, z.theta) + counts * candidate.by_draws
            known = self._tempered[candidate] = counts, value
        return known[1]

    def log_corrected(self, found: Candidate, model: Linear, theta: Array) -> float:
        """ln Z under the true priors within their bounds less ln Z of the linear ``model`` with its normal ones."""
        axes = self.axes(found.hypothesis)
        u = axes.to_u(found.x)
        spread, k = axes.local(u), u.size
        mean, covariance = model.first(theta, k)
        low, high = axes.ends
        inside = log_inside(mean, covariance, low / spread, high / spread)
        return inside + axes.log_replaced(u, mean * spread, np.diag(covariance) * spread**2)


def _within(white: Array, data: Array, low: Array, high: Array) -> Array:
    """(k,) x between ``low`` and ``high`` with the least squares of white (N, k) x - data (N,); 0 where none shows.

    Columns are brought to one length, so that the ends of a search do not hang on units.
    """
    lengths = np.sqrt(np.sum(white**2, axis=0))
    shown = lengths > SEARCH.rank * np.max(lengths)
    scale, out = lengths[shown], np.zeros(lengths.size)
    # A coordinate at its bound has no room, and the solver wants some.
    bounds = np.minimum(low[shown] * scale, -TINY), np.maximum(high[shown] * scale, TINY)
    out[shown] = lsq_linear(white[:, shown] / scale, data, bounds, method="bvls").x / scale
    return out


def beyond_noise(white: Array, candidate: Candidate) -> float:
    """Squares of residuals (N,), freed of noise, beyond those that noise leaves beside a fit; 0 or more."""
    return max(float(white @ white) - (white.size - candidate.x.size), 0.0)


def starts_with(
    bases: Sequence[Array], effect: Effect, expected: Array, shapes: Sequence[Mapping[str, float]] | None = None
) -> list[Array]:
    """Starts for ``bases`` (k,) with one more effect, in parts of its ``expected`` (s,) sizes: from the first a small
    and a middling one, from the others a small one, and both signs where both are allowed.

    ``shapes`` : values of its other coordinates; without them usual ones, and from the first base `Effect.starts` too.
    """
    from_first = [{}, *effect.starts] if shapes is None else shapes
    signs = (1.0,) if effect.size.one_sided else (1.0, -1.0)
    small, middling = SEARCH.small_share, SEARCH.middling_share
    out = []
    for i, base in enumerate(bases):
        for sign in signs:
            for share in (small, middling) if i == 0 else (small,):
                for shape in from_first if i == 0 else [{}]:
                    theta = np.array([shape.get(p.name, p.first) for p in effect.coordinates])
                    for j, scale in zip(effect.sizes, expected.tolist(), strict=True):
                        theta[j] = (effect.coordinates[j].null or 0.0) + sign * share * scale
                    out.append(np.concatenate([base, effect.within_bounds(theta)]))
    return out


def _law_errors(candidate: Candidate, capped: bool) -> dict[str, float]:
    """Of a search from a candidate, the sizes that it knows of its laws' errors."""
    laws = {e.name: error_size(e) for e in candidate.hypothesis.effects}
    usual = {name: float(np.exp(_moments(law)[0])) for name, law in laws.items() if law is not None}
    return {name: min(e, usual[name]) if capped else e for name, e in candidate.law_errors.items()}


def _differ(knew: Mapping[str, float], shows: Mapping[str, float]) -> bool:
    """True if an error of a law that matters is another one, by more than a factor of e."""
    return any(
        max(e, shows[name]) > SEARCH.law_matters and abs(np.log(shows[name] / e)) > 1.0 for name, e in knew.items()
    )


def _eta(usual: float, found: float, capped: bool) -> float:
    """Of two ln eta; capped, for a poor parent's is large, and would take what the coordinates are to explain."""
    return float(np.exp(min(usual, found) if capped else found))


def _moments(p: Parameter) -> tuple[float, float]:
    assert isinstance(p.prior, Normal)
    return p.prior.mean, p.prior.sd


def _at_bound(hypothesis: Hypothesis, axes: Standard, u: Array) -> tuple[str, ...]:
    """Coordinates at a bound that stops them: not at the absence of an effect, nor where its law ends of itself."""
    out = []
    for i, (p, axis) in enumerate(zip(hypothesis.parameters[: hypothesis.curve_size], axes.axes, strict=True)):
        low, high = axes.bounds[0][i], axes.bounds[1][i]
        support = [e for e in p.prior.support if np.isfinite(e)] + [e for e in A_PART if p.bounds == A_PART]
        ends = {*(float(axis.to_u(np.asarray(e))) for e in support), *([0.0] if axis.one_sided else [])}
        for bound in (low, high):
            if abs(u[i] - bound) <= SEARCH.at_bound * max(high - low, TINY) and bound not in ends:
                out.append(p.name)
    return tuple(out)
