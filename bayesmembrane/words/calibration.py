"""What calibrations say, in words: what describes the curve, how stiff the film is, what lies beyond, what to trust.

Every function takes the few numbers of `Case` and gives sentences; none of them knows files or pages.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayesmembrane.calibration.fit import Fit
from bayesmembrane.ground.parameters import Array
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.language import digits, interval, listed, millimetres, percent, spoken_parameter
from bayesmembrane.words.seen import DISC, Seen, in_one_unit, seen_by_fit

P_VALUE = 0.01
"""Below this the residuals are larger than the measurement's own noise allows."""

LOOSE = 0.7
"""A posterior at least this wide, relative to its prior, says that the data hardly know the parameter."""

GOOD = ("adequate", "strained")
FAILURES = 1e-3
SAME_FORCE = 1e-6


@dataclass(frozen=True)
class Case:
    """One run in the few numbers that the answer needs. Lengths in m, forces in N, quantiles 5, 50, 95 %.

    Attributes
    ----------
    name : of the material and the effects
    end : largest deflection that was fitted
    rmse : root mean square of the residual
    own_noise : root mean square of the noise that the measurement states, None if it states none
    extra_noise : mean of the inferred noise, None if none was inferred
    dominated : more than half of the posterior has an inferred noise above the stated one
    p_value : of the residuals under the stated noise, None if unknown
    modulus : quantiles of G d, N/m
    thickness : of the film
    status : how sampling ended: "converged", or why it stopped
    ess, wanted : effective draws of the worst coordinate, and how many were asked for
    r_hat : the largest
    failed : share of all evaluations that failed numerically
    last : largest deflection that is predicted
    last_force : quantiles of the force there, nan where most draws have none
    lost : share of the draws without a force there, by reason
    loose : parameters that the data hardly determine, with posterior over prior width
    how : in which quantities and units people read it
    points : how many readings were fitted; 0 if that is told elsewhere
    """

    name: str
    end: float
    rmse: float
    own_noise: float | None
    extra_noise: float | None
    dominated: bool
    p_value: float | None
    modulus: tuple[float, float, float]
    thickness: float
    status: str
    ess: float
    wanted: float
    r_hat: float
    failed: float
    last: float
    last_force: tuple[float, float, float]
    lost: Mapping[str, float]
    loose: Mapping[str, float]
    how: Seen = DISC
    points: int = 0

    @property
    def verdict(self) -> str:
        """``adequate``, ``strained`` (small misfit, yet more than the noise), ``misses``, or ``unknown`` (no noise)."""
        if self.own_noise is None:
            return "unknown"
        if self.dominated:
            return "misses"
        return "strained" if self.p_value is not None and self.p_value < P_VALUE else "adequate"

    @property
    def converged(self) -> bool:
        """Whether sampling reached its goals."""
        return self.status == "converged"


# ---- the answer ------------------------------------------------------------------------------------------------------


def answer(cases: Sequence[Case]) -> list[str]:
    """What to read if one reads nothing else: what describes each range, how stiff, what lies beyond, what to trust."""
    groups = _by_range(cases)
    telling = next((g for g in groups if any(c.verdict in GOOD for c in g)), min(groups, key=_miss))
    told = [*(describes(g) for g in groups)]
    told += [_of_range(f(telling), telling, groups) for f in (stiffness, extrapolation)] + [convergence(cases)]
    return [t for t in told if t]


def details(cases: Sequence[Case]) -> list[str]:
    """The other ranges' stiffness and extrapolation, and what the data leave open."""
    said = answer(cases)
    groups = _by_range(cases)
    told = [_of_range(f(g), g, groups) for g in groups for f in (unknown, stiffness, extrapolation)]
    return [t for t in told if t and t not in said]


def _of_range(told: str, group: Sequence[Case], groups: Sequence[Sequence[Case]]) -> str:
    """A sentence on one range, which it names where there are several."""
    if not told or len(groups) == 1:
        return told
    return f"Fitted up to {group[0].how.place(group[0].end)}: {told[0].lower()}{told[1:]}"


def _miss(group: Sequence[Case]) -> float:
    """The least residual of a range relative to its noise, or to what is predicted where none is stated."""
    return min(c.rmse / (c.own_noise or abs(c.last_force[1]) or math.inf) for c in group)


def _by_range(cases: Sequence[Case]) -> list[list[Case]]:
    return [[c for c in cases if c.end == end] for end in sorted({c.end for c in cases})]


def describes(group: Sequence[Case]) -> str:
    """Which materials describe the curve of one range."""
    end = group[0].how.place(group[0].end)
    if (points := {c.points for c in group}) != {0} and len(points) == 1:
        end += f" ({points.pop()} points)"
    by = {v: [c for c in group if c.verdict == v] for v in ("adequate", "strained", "misses", "unknown")}
    if by["unknown"]:
        best = sorted(group, key=lambda c: c.rmse)
        if len(best) == 1:
            return f"Up to {end}, {_named(best)} cannot be judged by itself: the measurement states no noise."
        tail = f"; the others: {_named(best[1:])}" if best[1:] else ""
        return (
            f"Up to {end} the measurement states no noise: a calibration alone cannot say which material is adequate. "
            f"The smallest root mean square residual has {_named(best[:1])}{tail}."
        )
    noise = group[0].how.force(group[0].own_noise or 0.0)
    parts = []
    if by["adequate"]:
        verb = "describes" if len(by["adequate"]) == 1 else "describe"
        parts.append(f"{_named(by['adequate'])} {verb} the curve within its noise of {noise}")
    if by["strained"]:
        verb, possessive = ("follows", "its") if len(by["strained"]) == 1 else ("follow", "their")
        own = "" if by["adequate"] else f" of {noise}"
        parts.append(
            f"{_named(by['strained'])} {verb} the curve closely, but {possessive} residuals are larger than the "
            f"noise{own} allows"
        )
    if by["misses"]:
        parts.append(_missed(by["misses"], bool(parts), noise))
    return f"Up to {end}, {'; '.join(parts)}."


def _missed(cases: Sequence[Case], others: bool, noise: str) -> str:
    one = len(cases) == 1
    limit = "the noise" if others else f"the noise of {noise}"
    misfit = f"{'its' if one else 'their'} misfit exceeds {limit} and is counted as extra noise"
    conclusion = f"so {'it misses' if one else 'each misses'} something that the film does"
    if others:
        return f"{_named(cases)} {'does' if one else 'do'} not: {misfit}, {conclusion}"
    if one:
        return f"{_named(cases)} does not describe the curve: {misfit}, {conclusion}"
    ordered = sorted(cases, key=lambda c: c.rmse)
    others_told = listed(f"{c.name} ({c.how.force(c.rmse)})" for c in ordered[1:])
    return (
        f"no material describes the curve: {misfit}, {conclusion}; the nearest is {_named(ordered[:1])}, then "
        f"{others_told}"
    )


def _named(cases: Sequence[Case]) -> str:
    """Names with residuals; the first says what the number is."""
    return listed(f"{c.name} ({'rms residual ' if i == 0 else ''}{c.how.force(c.rmse)})" for i, c in enumerate(cases))


def stiffness(group: Sequence[Case]) -> str:
    """The initial stiffness by the materials that describe the curve, or by the nearest one."""
    good = [c for c in group if c.verdict in GOOD] or [min(group, key=lambda c: c.rmse)]
    told = [f"{interval(*c.modulus, 'N/m')} by {c.name}" for c in good]
    modulus = [1e-6 * c.modulus[1] / c.thickness for c in good]
    low, high = digits(min(modulus)), digits(max(modulus))
    span = low if low == high else f"{low} to {high}"
    return f"The initial shear modulus times thickness is {listed(told)}, that is a shear modulus of {span} MPa."


def unknown(group: Sequence[Case]) -> str:
    """What the data leave open: parameters whose posterior is about as wide as the prior."""
    loose = [
        f"{listed(c.loose)} of {c.name} (posterior {listed(percent(w) for w in c.loose.values())} as wide as the prior)"
        for c in group
        if c.loose
    ]
    return f"The data hardly determine {'; '.join(loose)}." if loose else ""


def extrapolation(group: Sequence[Case]) -> str:
    """What is predicted beyond the fitted range, by the materials that describe the curve, and where nothing can be."""
    good = [c for c in group if c.verdict in GOOD]
    beyond = [c for c in good or group if c.last > 1.001 * c.end]
    there = [c for c in beyond if all(math.isfinite(v) for v in c.last_force)]
    gone = [c for c in beyond if c not in there]
    at = f"at {beyond[0].how.place(beyond[0].last)}, beyond the fitted range," if beyond else ""
    parts = []
    if there and (good or len(there) == 1):
        parts.append(f"{at} the {beyond[0].how.load} would be {listed(f'{_span(c)} ({c.name})' for c in there)}")
    elif there:
        low, high = min(there, key=lambda c: c.last_force[0]), max(there, key=lambda c: c.last_force[2])
        span = f"{low.how.force(low.last_force[0])} ({low.name}) to {high.how.force(high.last_force[2])} ({high.name})"
        parts.append(f"{at} the materials give anything from {span}")
    if gone:
        told = listed(f"{c.name} ({reasons(c.lost)})" for c in gone)
        parts.append(f"{'there' if there else at} nothing can be said by {told}")
    some = [c for c in there if sum(c.lost.values()) >= 0.01]
    if some:
        told = listed(f"{percent(sum(c.lost.values()))} of the draws of {c.name}" for c in some)
        parts.append(f"{told} have no force there")
    if not parts:
        return ""
    sentence = "; ".join(parts)
    warning = "This is an extrapolation: only the form of the energy and the priors speak there."
    if not good and beyond[0].verdict == "misses":
        warning = "This is an extrapolation of a form that already misses the fitted points: do not rely on it."
    return f"{sentence[0].upper()}{sentence[1:]}. {warning}"


def _span(case: Case) -> str:
    low, _, high = case.last_force
    return f"{case.how.force(low)} to {case.how.force(high)}"


def reasons(lost: Mapping[str, float]) -> str:
    """``locked for 40 %, not elliptic for 12 % of the draws``."""
    told = [f"{name} for {percent(share)}" for name, share in sorted(lost.items(), key=lambda i: -i[1]) if share > 0]
    return ", ".join(told) + " of the draws" if told else "no draw has a force"


def convergence(cases: Sequence[Case]) -> str:
    """Whether the sampling can be trusted."""
    worst, r_hat = min(c.ess for c in cases), max(c.r_hat for c in cases)
    told = f"worst effective sample size {worst:.0f}, worst R-hat {r_hat:.3f}"
    good = sum(c.converged for c in cases)
    if good == len(cases):
        return f"Sampling converged{'' if good == 1 else f' in all {good} runs'} ({told})."
    if len(cases) == 1:
        return f"Sampling did not converge ({told}): take every number here as provisional."
    return f"Sampling converged in {good} of {len(cases)} runs ({told}); the others are provisional, see the box above."


# ---- warnings --------------------------------------------------------------------------------------------------------


def warnings(cases: Sequence[Case]) -> list[str]:
    """What must be seen before anything else; empty if all is well."""
    return [s for c in cases for s in (not_converged(c), failures(c)) if s]


def not_converged(case: Case) -> str:
    """Why a run is provisional, or ""."""
    if case.converged:
        return ""
    faults = []
    if case.ess < case.wanted:
        faults.append(f"the effective sample size is {case.ess:.0f} instead of {case.wanted:.0f}")
    if case.r_hat > 1.01:
        faults.append(f"R-hat is {case.r_hat:.3f} instead of at most 1.01, so that the ensembles disagree")
    if not faults:
        faults.append("the chains are shorter than 50 autocorrelation times")
    return f"{case.name} up to {case.how.place(case.end)}: sampling stopped early ({case.status}); {listed(faults)}."


def failures(case: Case) -> str:
    """That too many films could not be computed, or ""."""
    if case.failed <= FAILURES:
        return ""
    return (
        f"{case.name} up to {case.how.place(case.end)}: {percent(case.failed)} of the films could not be computed to "
        "1e-6 and count as impossible; if they lie near the posterior, it is narrower than it should be."
    )


def disagreement(name: str, end: str, largest: float) -> str:
    """That two solvers differ, or ""."""
    if not largest > SAME_FORCE:
        return ""
    size = f"{largest:.1e} of the force, more than 1e-6"
    return f"{name} up to {end}: the two solvers disagree by up to {size}."


# ---- beyond the fitted points ----------------------------------------------------------------------------------------


def break_points(name: str, end: float, observed: Sequence[float], low: Sequence[float], high: Sequence[float]) -> str:
    """How many observed breaks lie in the predicted 90 % intervals."""
    inside = sum(a <= o <= b for o, a, b in zip(observed, low, high, strict=True))
    none = sum(not math.isfinite(a) for a in low)
    missing = f"; for {none} no force can be predicted" if none else ""
    return f"{name} fitted up to {millimetres(end)}: {inside} of {len(observed)} inside the 90 % interval{missing}."


def held_out(name: str, residual: Array, how: Seen = DISC) -> str:
    """What a calibration says of points that it has not seen: ``residual`` (3, R) N, at 5, 50 and 95 %; nan where no
    force can be predicted.
    """
    known = np.isfinite(residual[1])
    n = residual.shape[1]
    if not np.any(known):
        return f"{name}: no force can be predicted at any of the {n} points beyond the fitted range."
    inside = int(np.sum((residual[0] <= 0) & (residual[2] >= 0)))
    worst = how.force(float(np.nanmax(np.abs(residual[1]))))
    missing = f", and {n - int(known.sum())} points have no prediction" if not np.all(known) else ""
    return (
        f"{name}: of the {n} points beyond the fitted range {inside} lie in the 90 % band; the median misses them by "
        f"up to {worst}{missing}."
    )


def overview(cases: Sequence[Case]) -> str:
    """How many calibrations there are, of what, and over which ranges."""
    materials = list(dict.fromkeys(c.name for c in cases))
    runs = f"{len(cases)} calibrations" if len(cases) > 1 else "One calibration"
    told = [_reached(group) for group in in_one_unit(sorted(cases, key=lambda c: c.end), lambda c: c.how)]
    return f"{runs}: {listed(materials)}, fitted up to {listed(told)}."


def _reached(cases: Sequence[Case]) -> str:
    """How far runs that are read in the same units were fitted: ``15 and 35 mm of deflection``."""
    if cases[0].how.bare:
        return listed(dict.fromkeys(c.how.place(c.end) for c in cases))
    ends = dict.fromkeys(c.end for c in cases)
    return f"{listed(f'{1e3 * e:.4g}' for e in ends)} mm of deflection"


VERDICTS = {"adequate": "describes the curve", "strained": "close, not within noise", "misses": "misses something"}
"""`Case.verdict` in a table; without a stated noise there is none."""


def verdict(case: Case) -> str:
    """The verdict of one calibration in a few words."""
    return VERDICTS.get(case.verdict, "noise not stated")


LOADS = {"force": "forces", "stress": "stresses"}


def fit_sentence(found: Fit) -> str:
    """The optimum of one fit: how far it misses the data, and whether it can be trusted as one."""
    how = seen_by_fit(found)
    end = how.place(float(np.max(found.deflection)))
    if not math.isfinite(found.rmse_N):
        return f"{spoken(found.hypothesis)} up to {end}: {found.status}"
    told = (
        f"{spoken(found.hypothesis)} fitted up to {end} misses the {LOADS[how.load]} by {how.force(found.rmse_N)} rms"
    )
    told += f", at most {how.force(found.max_N)}"
    if found.at_bound:
        names = listed(spoken_parameter(n) for n in found.at_bound)
        told += f"; there is no optimum inside the bounds for {names}: the loss falls, or is flat, up to it"
    held = found.constrained
    if not found.convex:
        least = (
            "no film that meets the convexity prior was found"
            if held is None
            else (
                f"among films that meet the convexity prior the least loss is {held.loss_N * how.load_scale[0]:.4g} "
                f"instead of {how.loss(found.loss_N)}"
            )
        )
        told += f"; its energy is not convex where the film goes, and {least}"
    return f"{told}."
