"""Compiled inner loops of the shooting method: one film at a time, Dormand-Prince 8(5,3) with step control.

From the inner edge (t = 0, t = ln(R/R1), lengths in units of the stress-free inner radius) integrate
    l2. = l1 cos th - l2                                              l2(0) = l0
    l1. = (P2 cos th - P1 - P12 (l1 cos th - l2)) / P11               l1(0) unknown
    th. = -sin th P2 / P1                                             th(0) unknown
    h.  = exp(t) l1 sin th                                            h(0) = 0
and find (l1, th)(0) such that l2(T) = l0 and h(T) = d. The tangent equations would need third derivatives of W in these
variables; in (l2, V, H) with V = exp(t) P1 cos th, H = exp(t) P1 sin th they need only second ones, since
    V. = exp(t) P2,   H. = 0,
    P11 dl1 + P12 dl2 = exp(-t) (dV cos th + dH sin th),   P1 dth = exp(-t) (dH cos th - dV sin th).
``derivatives`` is the material's (see `compiled.bind`). Here numba compiles twice as fast for saying 14.0
in calls (a whole number written there is a type of its own, for which the callee is compiled anew), and loops in place
of whole arrays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import DOP853

from bayesmembrane.physics.mechanics.compiled import inlined

if TYPE_CHECKING:
    derivatives: Any = None

STAGES = 12
A = np.ascontiguousarray(DOP853.A[:STAGES, :STAGES])
B = np.ascontiguousarray(DOP853.B)
C = np.append(DOP853.C[:STAGES], 1.0)
E3 = np.ascontiguousarray(DOP853.E3)
E5 = np.ascontiguousarray(DOP853.E5)
SIZE = 11
MOST_STEPS = 400
# Continuation in ln d: longest step, the step below which the path has ended, and how many solutions it may take.
LONGEST, SHORTEST, MOST_SOLVES = 0.5, 2e-4, 3000
# Intervals of equal length in ln R after which the film is looked at.
LOOKS = 8
# Rows of what `survey` sees.
FORCE, SLOPE, VARIATION, MISS_1, MISS_2, STORED, STRETCH, LEAST_P11, ELLIPTIC, CONVEX, LEAST_P2, SLACK = range(12)
SEEN = 12


def rates(t, y, l0, ha, hb, p, out):
    """Right-hand side at y = (l2 - l0, l1 - l0, th, h, then (dl2, dV, dh) for each unknown, then the energy over 2 pi).

    ha, hb : dH for each unknown, constant over the film. False where the film cannot be continued.
    """
    l2, l1, th = l0 + y[0], l0 + y[1], y[2]
    if not (l2 > 0.0 and l1 > 0.0):
        return False
    w, p1, p2, p11, p12, p22 = derivatives(p, l1, l2)
    if not (p11 > 0.0 and p1 > 0.0):
        return False
    co, si, grow = np.cos(th), np.sin(th), np.exp(t)
    out[0] = l1 * co - l2
    out[1] = (p2 * co - p1 - p12 * out[0]) / p11
    out[2] = -si * p2 / p1
    out[3] = grow * l1 * si
    for k in range(2):
        dh = ha if k == 0 else hb
        o = 4 + 3 * k
        dl1 = ((y[o + 1] * co + dh * si) / grow - p12 * y[o]) / p11
        dth = (dh * co - y[o + 1] * si) / (grow * p1)
        out[o] = dl1 * co - l1 * si * dth - y[o]
        out[o + 1] = grow * (p12 * dl1 + p22 * y[o])
        out[o + 2] = grow * (dl1 * si + l1 * co * dth)
    out[10] = grow * grow * w
    return True


def launch(l1, th, l0, p, y):
    """Fill y with the state at the disc; returns dH for each unknown, nan if the film cannot start so."""
    _, p1, _, p11, _, _ = derivatives(p, l1, l0)
    if not (p11 > 0.0 and p1 > 0.0):
        return np.nan, np.nan
    co, si = np.cos(th), np.sin(th)
    for i in range(SIZE):
        y[i] = 0.0
    y[1], y[2] = l1 - l0, th
    y[5], y[8] = p11 * co, -p1 * si
    return p11 * si, p1 * co


def attempt(t, step, l0, ha, hb, p, stages, y, new):
    """The stages of one step from (t, y), and its end ``new``. False if the film cannot be continued that far."""
    for s in range(1, STAGES + 1):
        for i in range(SIZE):
            new[i] = y[i]
        for r in range(s):
            a = step * (A[s, r] if s < STAGES else B[r])
            if a != 0.0:
                for i in range(SIZE):
                    new[i] += a * stages[r, i]
        if not rates(t + C[s] * step, new, l0, ha, hb, p, stages[s]):
            return False
    return True


def error_of(step, stages, y, new, size2, size1, rtol):
    """Estimated error of one step over what is allowed, as in ``scipy.integrate.DOP853``."""
    e3, e5 = 0.0, 0.0
    for i in range(4):
        a3, a5 = 0.0, 0.0
        for s in range(STAGES + 1):
            a3 += E3[s] * stages[s, i]
            a5 += E5[s] * stages[s, i]
        w = rtol * max(size2 if i < 2 else size1, abs(y[i]), abs(new[i]))
        e3 += (a3 / w) ** 2
        e5 += (a5 / w) ** 2
    return abs(step) * e5 / np.sqrt((e5 + 0.01 * e3) * 4.0) if e5 + e3 > 0.0 else 0.0


def integrate(t, stop, step, l0, ha, hb, p, size2, size1, rtol, stages, y, new):
    """Continue y (11,) from t to ``stop``; returns the step to go on with, 0 if the film cannot be continued that far.

    size1, size2 : magnitudes of th, h and of the strains, which the absolute tolerance scales with
    """
    shortest = 1e-9 * (stop - t)
    if not rates(t, y, l0, ha, hb, p, stages[0]):
        return 0.0
    for _ in range(MOST_STEPS):
        last = t + step * (1.0 + 1e-9) >= stop
        h = stop - t if last else step
        valid = attempt(t, h, l0, ha, hb, p, stages, y, new)
        error = error_of(h, stages, y, new, size2, size1, rtol) if valid else 100.0
        if error < 1.0:
            t += h
            for i in range(SIZE):
                y[i] = new[i]
                stages[0, i] = stages[STAGES, i]
            longer = h * min(8.0, 0.9 * (error + 1e-12) ** -0.125)
            if last:
                return max(step, longer)
            step = longer
        else:
            step = h * max(0.1, 0.9 * error**-0.125)
            if step < shortest:
                return 0.0
    return 0.0


def cross(x, l0, span, p, size2, size1, rtol, stages, y, new):
    """From x = (l1, th) at the disc to the ring; y (11,) is the state there. False if it is not reached."""
    ha, hb = launch(x[0], x[1], l0, p, y)
    return ha == ha and integrate(0.0, span, span / 3.0, l0, ha, hb, p, size2, size1, rtol, stages, y, new) > 0.0


def newton(y, d, change, tangent):
    """Newton step (2,) for l2 = l0 and h = d at the ring, and dx/dd (2,), from the state y there. False if singular."""
    a, b, c, e = y[4], y[7], y[6], y[9]
    det = a * e - b * c
    if not abs(det) > 0.0:
        return False
    g0, g1 = -y[0], d - y[3]
    change[0], change[1] = (g0 * e - b * g1) / det, (a * g1 - c * g0) / det
    tangent[0], tangent[1] = -b / det, a / det
    return True


def solve_one(x, d, l0, span, p, rtol, most, stages, y, new, tangent):
    """Damped Newton for x = (l1, th)(0) at deflection d; x is overwritten. Returns the number of iterations, 0 if lost.

    tangent (2,) : dx/dd of the last integration. Convergence is of the residual, l2(T) - l0 and h(T) - d over their
    magnitudes. A mirror image (l1 < 0, or th outside (0, pi)) is no solution.
    """
    size1 = min(d, 1.0)
    size2 = size1 * size1
    base, change, norm, alpha = x.copy(), np.zeros(2), np.inf, 1.0
    for iteration in range(int(most)):
        good = cross(x, l0, span, p, size2, size1, rtol, stages, y, new)
        now = np.hypot(y[0] / size2, (y[3] - d) / d)
        # Below 30 rtol there is round-off, and no further fall to be had.
        if not good or (now >= 30.0 * rtol and not now < norm * (1.0 - 1e-3 * alpha)):
            if alpha < 1e-4 or iteration == 0:
                return 0
            alpha *= 0.4
            for i in range(2):
                x[i] = base[i] + alpha * change[i]
            continue
        norm, alpha = now, 1.0
        if not newton(y, d, change, tangent):
            return 0
        for i in range(2):
            base[i] = x[i]
            x[i] += change[i]
        # One more step squares the residual.
        if norm < rtol or (norm < 3e-5 and norm * norm < rtol):
            return iteration + 1 if x[0] > 0.0 and 0.0 < x[1] < np.pi else 0
    return 0


def trial_start(i, j, d, l0, x):
    """Point (i, j) of a coarse grid of starts at deflection d, into x (2,)."""
    size = min(d, 1.0)
    x[0] = l0 + (size * size * 0.04 + 0.05 * max(d - 1.0, 0.0)) * 1.35**j
    x[1] = d * (0.15 + 0.085 * i) if d < 1.0 else 0.2 + 0.11 * i


def first_state(x, d, l0, span, p, rtol, stages, y, new, tangent):
    """A start at deflection d from a coarse search over (l1, th), best residuals first. True if Newton converges."""
    tried = np.full((12, 14), np.inf)
    size = min(d, 1.0)
    for i in range(12):
        for j in range(14):
            trial_start(i, j, d, l0, x)
            if cross(x, l0, span, p, size * size, size, 1e-4, stages, y, new):
                tried[i, j] = (y[0] / (size * size)) ** 2 + ((y[3] - d) / d) ** 2
    for _ in range(20):
        at = int(np.argmin(tried))
        i, j = at // 14, at % 14
        if not np.isfinite(tried[i, j]):
            return False
        tried[i, j] = np.inf
        trial_start(i, j, d, l0, x)
        if solve_one(x, d, l0, span, p, rtol, 60.0, stages, y, new, tangent) > 0:
            return True
    return False


def extrapolate(goal, d, x, tangent, d_old, x_old, tangent_old, zero, power):
    """x at deflection ``goal`` by the Hermite cubic through two states, or the tangent if they are the same.

    x grows like zero + d^power for small d and like d^(power - 1) for large: what is extrapolated, in ln d, is
    (x - zero) (1 + d) / d^power.
    """
    s, s_goal, s_old = d**power / (1.0 + d), goal**power / (1.0 + goal), d_old**power / (1.0 + d_old)
    v, ahead, wide = (x - zero) / s, np.log(goal / d), np.log(d / d_old)
    slope = tangent * d / s - (power - d / (1.0 + d)) * v
    bend = 0.0
    if abs(wide) > 1e-9:
        v_old = (x_old - zero) / s_old
        slope_old = tangent_old * d_old / s_old - (power - d_old / (1.0 + d_old)) * v_old
        chord = (v - v_old) / wide
        bend = (slope - chord) / wide + (ahead + wide) * (slope + slope_old - 2.0 * chord) / (wide * wide)
    return zero + (v + ahead * (slope + ahead * bend)) * s_goal


def walk(x0, slope0, d0, targets, sweep, l0, span, p, rtol, out, end, stages, y, new):
    """Continue from the state x0 at d0 through targets (M,), in the direction of ``sweep`` (+1 or -1).

    out (M, 3) : l1(0), th(0), iterations; nan where the path was lost
    end (3,) : l1(0), th(0) and d of the last state, if the path ends because shorter steps do not help either
    Steps that fail, or land far from where they were expected (another branch), are shortened.
    """
    x, tangent, d = x0.copy(), slope0.copy(), d0
    x_old, tangent_old, d_old = x0.copy(), slope0.copy(), d0
    guess, hint, new_tangent, spent = np.empty(2), np.empty(2), np.empty(2), 0
    order = range(targets.size) if sweep > 0 else range(targets.size - 1, -1, -1)
    for m in order:
        stride, goal, n = LONGEST, d0, 0
        while n == 0 or goal != targets[m]:
            far = np.log(targets[m] / d)
            goal = targets[m] if abs(far) <= stride else d * np.exp(sweep * stride)
            for i in range(2):
                zero, power = (l0, 2.0) if i == 0 else (0.0, 1.0)
                hint[i] = extrapolate(goal, d, x[i], tangent[i], d_old, x_old[i], tangent_old[i], zero, power)
                guess[i] = hint[i]
            n = solve_one(guess, goal, l0, span, p, rtol, 14.0, stages, y, new, new_tangent)
            spent += max(n, 1)
            if n == 0 or abs(guess[0] / hint[0] - 1.0) > 0.1 or abs(guess[1] - hint[1]) > 0.1:
                n, d_old = 0, d
                stride = min(stride, abs(far)) * 0.3
                if stride < SHORTEST or spent > MOST_SOLVES:
                    if stride < SHORTEST and sweep > 0:
                        end[0], end[1], end[2] = x[0], x[1], d
                    return
                continue
            for i in range(2):
                if goal != d:
                    x_old[i], tangent_old[i] = x[i], tangent[i]
                x[i], tangent[i] = guess[i], new_tangent[i]
            if goal != d:
                d_old, d = d, goal
            stride = min(stride * 1.6, LONGEST)
        out[m, 0], out[m, 1], out[m, 2] = x[0], x[1], n


@inlined
def follow(targets, start, l0, span, p, rtol, out, end):
    """Follow one film through ascending scaled deflections ``targets`` (M,), from a state at small deflection.

    For small d every material starts alike (G alone matters, and drops out), so the start from there is a good guess:
    th = d/T l0 for a stretched film, 0.7 d/T for a flat one. Where it fails, a coarse search at ``start`` follows.
    out (M, 3), end (3,) : see `walk`
    """
    stages, y, new = np.empty((STAGES + 1, SIZE)), np.empty(SIZE), np.empty(SIZE)
    x, tangent = np.empty(2), np.empty(2)
    out[:], end[:] = np.nan, np.nan
    d = min(0.5, targets[-1])
    stretched = min((l0 - 1.0) / (0.2 * d * d), 1.0) if l0 > 1.0 else 0.0
    x[0], x[1] = l0 + 0.1183 * d * d, d / (span * l0) * (0.7 + 0.3 * stretched)
    found = solve_one(x, d, l0, span, p, rtol, 20.0, stages, y, new, tangent) > 0
    if not found:
        d = start
    for _ in range(6):
        found = found or first_state(x, d, l0, span, p, rtol, stages, y, new, tangent)
        if found:
            above = 0
            while above < targets.size and targets[above] < d:
                above += 1
            walk(x, tangent, d, targets[above:], 1.0, l0, span, p, rtol, out[above:], end, stages, y, new)
            walk(x, tangent, d, targets[:above], -1.0, l0, span, p, rtol, out[:above], end, stages, y, new)
            return
        d *= 0.5


def look(t, y, l0, p, line):
    """Extremes of what the film passes through, at one point, into ``line`` (SEEN,); returns R P1 sin(th)."""
    l1, l2 = l0 + y[1], l0 + y[0]
    _, p1, p2, p11, p12, p22 = derivatives(p, l1, l2)
    half = 0.5 * (p11 - p22)
    line[STRETCH] = max(line[STRETCH], l1, l2)
    line[LEAST_P11] = min(line[LEAST_P11], p11)
    line[ELLIPTIC] = min(line[ELLIPTIC], p11, p22)
    line[CONVEX] = min(line[CONVEX], 0.5 * (p11 + p22) - np.sqrt(half * half + p12 * p12))
    line[LEAST_P2] = min(line[LEAST_P2], p2)
    line[SLACK] = min(line[SLACK], max(p1, p2))
    return np.exp(t) * p1 * np.sin(y[2])


def survey(x, d, l0, span, p, rtol, line):
    """Follow a solved state x = (l1, th)(0) once more, with one more Newton step in the end; into line (SEEN,).

    line : force and slope dF/dd (over 2 pi, scaled); change of R P1 sin(th) over the film relative to its value;
    residuals of l2 and h before the last step; energy over 2 pi; largest stretch; least P11; least of P11, P22; least
    eigenvalue of the Hessian; least P2; least of max(P1, P2). The film is looked at in LOOKS + 1 points.
    """
    stages, y, new = np.empty((STAGES + 1, SIZE)), np.empty(SIZE), np.empty(SIZE)
    change, tangent, size1 = np.zeros(2), np.zeros(2), min(d, 1.0)
    size2 = size1 * size1
    line[:LEAST_P11], line[LEAST_P11:] = 0.0, np.inf
    ha, hb = launch(x[0], x[1], l0, p, y)
    step = span / LOOKS
    flux = look(0.0, y, l0, p, line)
    for g in range(LOOKS):
        t = span * (g + 1) / LOOKS
        step = integrate(span * g / LOOKS, t, step, l0, ha, hb, p, size2, size1, rtol, stages, y, new)
        if not step > 0.0:
            line[VARIATION] = np.inf
            return
        line[VARIATION] = max(line[VARIATION], abs(look(t, y, l0, p, line) / flux - 1.0))
    line[MISS_1], line[MISS_2], line[STORED] = abs(y[0]) / size2, abs(y[3] / d - 1.0), y[10]
    newton(y, d, change, tangent)
    l1, th = x[0] + change[0], x[1] + change[1]
    _, p1, _, p11, _, _ = derivatives(p, l1, l0)
    line[FORCE] = p1 * np.sin(th)
    line[SLOPE] = p11 * np.sin(th) * tangent[0] + p1 * np.cos(th) * tangent[1]


def shoot(targets, start, l0, span, p, rtol, out, lines):
    """`follow`, then `survey` of every state into lines (M + 1, SEEN), the end of the path last; nan where none is."""
    end = np.empty(3)
    follow(targets, start, l0, span, p, rtol, out, end)
    lines[:] = np.nan
    for m in range(targets.size):
        if np.isfinite(out[m, 0]):
            survey(out[m], targets[m], l0, span, p, rtol, lines[m])
    if np.isfinite(end[0]):
        survey(end, end[2], l0, span, p, rtol, lines[-1])


KERNELS = (
    rates,
    launch,
    attempt,
    error_of,
    integrate,
    cross,
    newton,
    solve_one,
    trial_start,
    first_state,
    extrapolate,
    walk,
    follow,
    look,
    survey,
    shoot,
)
