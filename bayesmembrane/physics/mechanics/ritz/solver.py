"""Ritz solver: forces of many films at once from the minimum of the stored energy over elements."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.mechanics.locking import locking_deflection
from bayesmembrane.physics.mechanics.request import Request, Spared, extensibility
from bayesmembrane.physics.mechanics.ritz import kernels
from bayesmembrane.physics.mechanics.ritz.batch import LEVELS, Shapes, films, follow, run
from bayesmembrane.physics.mechanics.ritz.edges import ruled_out_at_the_edges
from bayesmembrane.physics.mechanics.ritz.elements import evaluate
from bayesmembrane.physics.mechanics.ritz.walk import RULED_OUT_ON_THE_WAY, Walks, nearly_resolved
from bayesmembrane.physics.mechanics.solution import Curves, Note, Status, joined

# A film that is not deflected has a stiffness: it is looked at this far up (scaled).
SMALLEST = 1e-4
# A margin of convexity or ellipticity below minus this rules a film out, whatever finer bases would say.
RULED_OUT = 1e-6


def shapes(request: Request, t: Array) -> tuple[Curves, Array]:
    """(what `solve` gives, (4, B, M)): l2, u, w and h of B films, each at its only deflection, at t = ln(R/R1) (M,).

    u = l1 cos(theta), w = l1 sin(theta), and the rise h from the disc outwards in units of R1/l0. nan if unresolved.
    """
    search, back = _searched(request)
    span, out = np.log(request.ratio), np.full((4, len(search.d), t.size), np.nan)
    left = search.status[:, 0] == Status.OK
    for rows, found in reversed(search.solved):  # what was solved last of a film is its state
        for k in np.flatnonzero(left[rows]).tolist():
            b = int(rows[k])
            d, l0 = search.d[b, 0], request.prestretch[b]
            (a, rise), (a_slope, slope) = evaluate(found.unknowns[k], found.ends[k], found.bubbles, t)
            out[:, b] = l0 + a, l0 + a + a_slope, np.exp(-t) * (d / span + slope), d * t / span + rise
            left[b] = False
    return _curves(request, search, back), out


def solve(request: Request) -> Curves:
    """Force curves from the minimum of the stored energy,

        F = dE/d(delta),  E(delta) = min over the deformation of 2 pi int R^2 W dt.

    Every film is first followed with six polynomials over the whole width. States whose next polynomials would still
    release energy are refined, each from its own solution, with more and shorter elements; films whose path was lost
    are followed again with these and with shorter steps. A path that ends at the same deflection for two bases ends
    physically, and is given its reason; what is left is flagged.

    Of a film that is spared (a prior rules it out whatever its other forces are) what is not resolved at first stays
    flagged, and one whose edges show that already is not solved. States whose forces are not ``read`` only show whether
    the film stays stable and convex.
    """
    out = ruled_out_at_the_edges(request)
    if not out.films.size:
        return _solved(request)
    rest = np.setdiff1d(np.arange(len(request.parameters)), out.films)
    parts = [out.curves(request)] + ([_solved(request.of(rest))] if rest.size else [])
    return joined(parts).of(np.argsort(np.concatenate([out.films, rest])))


def _solved(request: Request) -> Curves:
    """As `solve`, whatever the edges show."""
    return _curves(request, *_searched(request))


def _searched(request: Request) -> tuple[_Search, NDArray[np.intp] | None]:
    """All that is found of the states of all films, and where they were before they were sorted by deflection."""
    d, order, back = _ascending(np.where(request.deflection == 0, SMALLEST, request.scaled))
    bound = extensibility(request)
    locked = np.zeros(d.shape, np.bool_)
    if np.any(bound < np.inf):
        locked = d >= locking_deflection(bound, request.prestretch, request.ratio)[:, None]
        # A locked deflection is replaced by the last one that can be reached; its answer is not used.
        reach = np.max(np.where(locked, 0.0, d), axis=1, keepdims=True)
        d = np.where(locked, np.where(reach > 0, reach, 1e-3), d)
    search = _Search(request, d, ~locked, order >= d.shape[1] if request.read is None else order >= request.read)
    if np.any(search.status) or np.any(locked):
        for level in range(1, len(LEVELS)):
            if not search.improve(level):
                break
        _pass_on(search.status)
        search.status[locked] = Status.LOCKED
    return search, back


def _shown(result: Array, status: NDArray[np.int8], near: NDArray[np.bool_], spare: Spared) -> NDArray[np.bool_]:
    """(B, N) True for states for which their films are spared: resolved ones, or clearly so if nearly resolved."""
    if spare is Spared.NONE:
        return np.zeros(near.shape, np.bool_)
    margin = result[:, kernels.CONVEX if spare is Spared.NOT_CONVEX else kernels.ELLIPTIC]
    return np.asarray(((status == Status.OK) & (margin < -RULED_OUT)) | (near & (margin < -RULED_OUT_ON_THE_WAY)))


class _Search:
    """What is known of B films at N ascending scaled deflections d (B, N), and how to know more.

    Attributes
    ----------
    wanted, loose : (B, N) True where an answer is wanted, and where nobody reads the force
    result, status : (B, rows, N) and (B, N) `Status` codes
    shown : (B, N) True where a state shows that the film is spared, whatever its status: its margins can be read
    film, column, shapes : (K,), (K,) and `Shapes` of the states that are to be refined
    solved : films (K,) and `Shapes` of their states, as they were solved; of films at one deflection the last is theirs
    walks : where the lost paths stand, and the shapes of all films to begin them from
    """

    def __init__(
        self, request: Request, d: Array, wanted: NDArray[np.bool_], loose: NDArray[np.bool_] | None = None
    ) -> None:
        self.request, self.d = request, d
        self.result, trace = follow(request, d, 0, request.sensitivities)
        self.status = self.result[:, kernels.STATUS].astype(np.int8)
        self.loose = np.zeros(d.shape, np.bool_) if loose is None else loose
        near = (self.status == Status.UNRESOLVED) & nearly_resolved(self.result, d)
        self.shown = _shown(self.result, self.status, near, request.spare)
        self.wanted = wanted & ~np.any(self.shown, axis=1)[:, None]
        self.status[near & self.loose] = Status.OK
        self.film, self.column = np.nonzero((self.status == Status.UNRESOLVED) & self.wanted)
        ends = Shapes.flat(request.ratio, len(d), 0).ends
        self.solved = [(np.arange(len(d)), Shapes.from_trace(trace[..., -1], ends, 0))]
        self.shapes = Shapes.from_trace(trace[self.film, :, self.column], ends[self.film], 0)
        self.walks = Walks(request, d, trace)

    def improve(self, level: int) -> bool:
        """One level up: refine the rough states, and walk on where a path was lost. False if nothing is left to do."""
        if level == 1:
            # The loss of stability is believed when a finer basis confirms it.
            self.status[_named(self.status) & self.wanted] = Status.ITERATION_LIMIT
        if self.film.size:
            self._refine(level)
        _pass_on(self.status)
        lost = (self.status == Status.ITERATION_LIMIT) & self.wanted
        if np.any(lost):
            self._walk(level, lost)
        else:
            self.walks.rest()
        return bool(self.film.size or np.any((self.status == Status.ITERATION_LIMIT) & self.wanted))

    def _refine(self, level: int) -> None:
        """Each rough state from its own solution, all side by side, on new elements; those still rough remain."""
        film, column = self.film, self.column
        d = self.d[film, column]
        start, once = self.shapes.placed(d, level), np.ones(1, np.bool_)
        result, trace = run(films(self.request, film), (d[None], once), start, level, self.request.sensitivities)
        found, trace = result[..., 0], trace[..., 0]
        verdict, before = self._verdict(found, film, column), self.result[film, :, column]
        # A rough state that leads to no stable one lay astray, unless it was nearly resolved: the film is walked there.
        astray = _named(verdict) & ~nearly_resolved(before[..., None], d[:, None])[:, 0]
        verdict[astray] = Status.ITERATION_LIMIT
        self.result[film, :, column], self.status[film, column] = found, verdict
        still = verdict == Status.UNRESOLVED
        self.film, self.column = film[still], column[still]
        refined = Shapes.from_trace(trace, start.ends, level)
        self.solved.append((film, refined))
        self.shapes = refined.of(still)

    def _verdict(self, found: Array, film: NDArray[np.intp], column: NDArray[np.intp]) -> NDArray[np.int8]:
        """Statuses (K,) of results (K, rows): a rough state is good enough where nobody reads its force."""
        verdict = found[:, kernels.STATUS].astype(np.int8)
        enough = (verdict == Status.UNRESOLVED) & self.loose[film, column]
        verdict[enough & nearly_resolved(found[..., None], self.d[film, column][:, None])[:, 0]] = Status.OK
        return verdict

    def _walk(self, level: int, lost: NDArray[np.bool_]) -> None:
        """On from the last states of the films with ``lost`` (B, N) deflections; rough states that are met join."""
        met = self.walks.on(lost, level)
        verdict = self._verdict(met.found, met.film, met.column)
        self.result[met.film, :, met.column], self.status[met.film, met.column] = met.found, verdict
        rough = verdict == Status.UNRESOLVED
        self.solved.append((met.film, met.shapes))
        if np.any(rough):
            more = met.shapes.of(rough)
            self.shapes = Shapes.joined([self.shapes, more]) if self.film.size else more
            self.film, self.column = np.append(self.film, met.film[rough]), np.append(self.column, met.column[rough])
        row, reason = self.walks.reasons(level)
        still = lost[row] & (self.status[row] == Status.ITERATION_LIMIT)
        self.status[row] = np.where(still, reason[:, None], self.status[row])


def _named(status: NDArray[np.int8]) -> NDArray[np.bool_]:
    """True where the loss of stability is the reason."""
    return np.asarray((status == Status.NOT_ELLIPTIC) | (status == Status.INDEFINITE))


def _pass_on(status: NDArray[np.int8]) -> None:
    """What has no state beyond a loss of stability, in ascending deflection (B, N), is given the first such reason."""
    named = _named(status)
    rows = np.flatnonzero(np.any(named, axis=1))
    first = status[rows, np.argmax(named[rows], axis=1)]
    passed = np.logical_or.accumulate(named[rows], axis=1) & (status[rows] != Status.OK)
    status[rows] = np.where(passed, first[:, None], status[rows])


def _ascending(d: Array) -> tuple[Array, NDArray[np.intp], NDArray[np.intp] | None]:
    """d (B, N) sorted film by film, where each value came from (B, N), and where each went; None if none moved."""
    if np.all(d[:, 1:] >= d[:, :-1]):
        return d, np.broadcast_to(np.arange(d.shape[1]), d.shape), None
    order = np.argsort(d, axis=1, kind="stable")
    return np.take_along_axis(d, order, axis=1), order, np.argsort(order, axis=1)


def _curves(request: Request, search: _Search, back: NDArray[np.intp] | None) -> Curves:
    """Undo the scaling and the sorting."""
    k, result, status, shown = kernels, search.result, search.status, search.shown
    if back is not None:
        result = np.take_along_axis(result, back[:, None], axis=2)
        status = np.take_along_axis(status, back, axis=1)
        shown = np.take_along_axis(shown, back, axis=1)
    ok, sign = status == Status.OK, np.sign(request.deflection)
    length = request.inner_radius / request.prestretch[:, None]
    note = np.where(result[:, k.LEAST_P2] < 0, Note.WRINKLED, 0) | np.where(result[:, k.SLACK] <= 0, Note.SLACK, 0)
    factor = 2 * np.pi * length

    def row(index: int | slice, scale: Any = 1.0, there: NDArray[np.bool_] = ok) -> Array:
        # Where it is not ok anything may stand, infinity too.
        with np.errstate(invalid="ignore", over="ignore"):
            return np.where(there if isinstance(index, int) else there[:, None], result[:, index] * scale, np.nan)

    sensitivity = None
    if request.sensitivities:
        rows = row(slice(k.RESULTS, None), (factor * sign)[:, None])
        sensitivity = np.ascontiguousarray(np.moveaxis(rows, 1, 2))
    return Curves(
        deflection=request.deflection,
        force=row(k.FORCE, factor * sign),
        status=status,
        note=np.where(ok, note, 0).astype(np.int8),
        slope=row(k.SLOPE, 2 * np.pi),
        sensitivity=sensitivity,
        variation=row(k.VARIATION),
        max_stretch=row(k.STRETCH),
        ellipticity=row(k.ELLIPTIC, there=ok | shown),
        convexity=row(k.CONVEX, there=ok | shown),
        energy=row(k.STORED, factor * length),
    )
