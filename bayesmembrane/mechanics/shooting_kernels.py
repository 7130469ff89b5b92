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
``derivatives`` is the material's (see `compiled.bind`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import DOP853

if TYPE_CHECKING:
    derivatives: Any

STAGES = 12
A = np.ascontiguousarray(DOP853.A[:STAGES, :STAGES])
B = np.ascontiguousarray(DOP853.B)
C = np.ascontiguousarray(DOP853.C[:STAGES])
E3 = np.ascontiguousarray(DOP853.E3)
E5 = np.ascontiguousarray(DOP853.E5)
SIZE = 10
MOST_STEPS = 400


def rates(t, y, l0, ha, hb, p, out):  # type: ignore[no-untyped-def]
    """Right-hand side at y = (l2 - l0, l1 - l0, th, h, then (dl2, dV, dh) for each unknown); False where it ends."""
    l2, l1, th = l0 + y[0], l0 + y[1], y[2]
    if not (l2 > 0.0 and l1 > 0.0):
        return False
    _, p1, p2, p11, p12, p22 = derivatives(p, l1, l2)
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
    return True


def integrate(l1, th, l0, span, p, size2, size1, rtol, stages, y, new):  # type: ignore[no-untyped-def]
    """Integrate to t = span; y (10,) is the final state. Returns False if the film cannot be continued that far.

    size1, size2 : magnitudes of th, h and of the strains, which the absolute tolerance scales with
    """
    _, p1, p2, p11, p12, p22 = derivatives(p, l1, l0)
    if not (p11 > 0.0 and p1 > 0.0):
        return False
    co, si = np.cos(th), np.sin(th)
    ha, hb = p11 * si, p1 * co
    for i in range(SIZE):
        y[i] = 0.0
    y[1], y[2] = l1 - l0, th
    y[5], y[8] = p11 * co, -p1 * si
    t, step = 0.0, span / 3.0
    if not rates(t, y, l0, ha, hb, p, stages[0]):
        return False
    for _ in range(MOST_STEPS):
        last = t + step >= span * (1.0 - 1e-12)
        if last:
            step = span - t
        valid = True
        for s in range(1, STAGES):
            for i in range(SIZE):
                acc = 0.0
                for r in range(s):
                    acc += A[s, r] * stages[r, i]
                new[i] = y[i] + step * acc
            valid = rates(t + C[s] * step, new, l0, ha, hb, p, stages[s])
            if not valid:
                break
        if valid:
            for i in range(SIZE):
                acc = 0.0
                for s in range(STAGES):
                    acc += B[s] * stages[s, i]
                new[i] = y[i] + step * acc
            valid = rates(t + step, new, l0, ha, hb, p, stages[STAGES])
        error = 100.0
        if valid:
            e3, e5 = 0.0, 0.0
            for i in range(4):
                a3, a5 = 0.0, 0.0
                for s in range(STAGES + 1):
                    a3 += E3[s] * stages[s, i]
                    a5 += E5[s] * stages[s, i]
                size = size2 if i < 2 else size1
                w = rtol * max(size, abs(y[i]), abs(new[i]))
                e3 += (a3 / w) ** 2
                e5 += (a5 / w) ** 2
            error = abs(step) * e5 / np.sqrt((e5 + 0.01 * e3) * 4.0) if e5 + e3 > 0.0 else 0.0
        if error < 1.0:
            t += step
            for i in range(SIZE):
                y[i] = new[i]
            if last:
                return True
            for i in range(SIZE):
                stages[0, i] = stages[STAGES, i]
            step *= min(8.0, 0.9 * (error + 1e-12) ** -0.125)
        else:
            step *= max(0.1, 0.9 * error**-0.125)
            if step < 1e-9 * span:
                return False
    return False


def solve_one(x, d, l0, span, p, rtol, most, stages, y, new, tangent):  # type: ignore[no-untyped-def]
    """Damped Newton for x = (l1, th)(0) at deflection d; x is overwritten. Returns the number of iterations, 0 if lost.

    tangent (2,) : dx/dd at the solution. Convergence is of the residual, l2(T) - l0 and h(T) - d over their magnitudes.
    """
    size1 = min(d, 1.0)
    size2 = size1 * size1
    step0, step1, norm = 0.0, 0.0, np.inf
    base0, base1, alpha = x[0], x[1], 1.0
    for iteration in range(most):
        good = integrate(x[0], x[1], l0, span, p, size2, size1, rtol, stages, y, new)
        r0, r1 = y[0] / size2, (y[3] - d) / d
        now = np.sqrt(r0 * r0 + r1 * r1)
        if not good or not now < norm * (1.0 - 1e-3 * alpha):
            if good and now < 30.0 * rtol:
                # Round-off: no further fall is to be had.
                norm = now
            elif alpha < 1e-4 or iteration == 0:
                return 0
            else:
                alpha *= 0.4
                x[0], x[1] = base0 + alpha * step0, base1 + alpha * step1
                continue
        norm, alpha = now, 1.0
        a, b, c, e = y[4], y[7], y[6], y[9]
        det = a * e - b * c
        if not abs(det) > 0.0:
            return 0
        g0, g1 = -y[0], d - y[3]
        base0, base1 = x[0], x[1]
        step0, step1 = (g0 * e - b * g1) / det, (a * g1 - c * g0) / det
        tangent[0], tangent[1] = -b / det, a / det
        x[0], x[1] = base0 + step0, base1 + step1
        if norm < 3e-5 and norm * norm < rtol:
            # One more step squares this residual.
            return iteration + 1
        if norm < rtol:
            return iteration + 1
    return 0


def first_state(x, d, l0, span, p, rtol, stages, y, new, tangent):  # type: ignore[no-untyped-def]
    """A start at deflection d from a coarse search over (l1, th), best residuals first. True if Newton converges."""
    tried = np.full((12, 14), np.inf)
    size1 = min(d, 1.0)
    for i in range(12):
        for j in range(14):
            th = min(d, 2.0) * (0.15 + 0.085 * i) if d < 1.0 else 0.2 + 0.11 * i
            l1 = l0 + (size1 * size1 * 0.04 + 0.05 * max(d - 1.0, 0.0)) * 1.35**j
            if integrate(l1, th, l0, span, p, size1 * size1, size1, 1e-4, stages, y, new):
                tried[i, j] = (y[0] / (size1 * size1)) ** 2 + ((y[3] - d) / d) ** 2
    for _ in range(20):
        at = np.argmin(tried)
        i, j = at // 14, at % 14
        if not np.isfinite(tried[i, j]):
            return False
        tried[i, j] = np.inf
        x[1] = min(d, 2.0) * (0.15 + 0.085 * i) if d < 1.0 else 0.2 + 0.11 * i
        x[0] = l0 + (size1 * size1 * 0.04 + 0.05 * max(d - 1.0, 0.0)) * 1.35**j
        if solve_one(x, d, l0, span, p, rtol, 60, stages, y, new, tangent) > 0 and x[0] > 0.0 and 0.0 < x[1] < np.pi:
            return True
    return False


def walk(x0, slope0, d0, targets, sweep, l0, span, p, rtol, out, stages, y, new):  # type: ignore[no-untyped-def]
    """Continue from the state x0 at d0 through targets (M,), in the direction of ``sweep`` (+1 or -1).

    out (M, 5) : l1(0), th(0), dl1/dd, dth/dd, iterations; nan where the path was lost. Predictions are tangents or
    Hermite cubics of (l1 - l0) (1 + d)/d^2 and th (1 + d)/d in ln d; steps that fail are halved.
    """
    x, tangent, guess = x0.copy(), slope0.copy(), np.empty(2)
    old, told, dold, d, have = x0.copy(), slope0.copy(), d0, d0, False
    hint, new_tangent = x0.copy(), np.empty(2)
    spent = 0
    order = range(targets.size) if sweep > 0 else range(targets.size - 1, -1, -1)
    for m in order:
        stride = 0.5
        while True:
            goal = targets[m]
            far = np.log(goal / d)
            if abs(far) > stride:
                goal = d * np.exp(stride if far > 0 else -stride)
            if goal == d and not have:
                guess[:] = x
            else:
                for i in range(2):
                    power = 2.0 if i == 0 else 1.0
                    zero = l0 if i == 0 else 0.0
                    s, sn = d**power / (1.0 + d), goal**power / (1.0 + goal)
                    rate = power - d / (1.0 + d)
                    v = (x[i] - zero) / s
                    slope = tangent[i] * d / s - rate * v
                    e = np.log(goal / d)
                    value = v + slope * e
                    if have and abs(np.log(d / dold)) > 1e-9:
                        so = dold**power / (1.0 + dold)
                        ro = power - dold / (1.0 + dold)
                        vo = (old[i] - zero) / so
                        slo = told[i] * dold / so - ro * vo
                        wide = np.log(d / dold)
                        chord = (v - vo) / wide
                        c2, c3 = (slope - chord) / wide, (slope + slo - 2.0 * chord) / (wide * wide)
                        value = v + e * (slope + e * (c2 + (e + wide) * c3))
                    guess[i] = zero + value * sn
            hint[:] = guess
            n = solve_one(guess, goal, l0, span, p, rtol, 14, stages, y, new, new_tangent)
            # A mirror branch shows in the signs: l1 < 0, or th outside (0, pi). Another branch shows as a jump.
            if n > 0 and (guess[0] <= 0.0 or guess[1] <= 0.0 or guess[1] >= np.pi):
                n = 0
            if n > 0 and (abs(guess[0] / hint[0] - 1.0) > 0.1 or abs(guess[1] - hint[1]) > 0.1):
                n = 0
            spent += max(n, 1)
            if n == 0:
                have = False
                stride = min(stride, abs(far)) * 0.3
                if stride < 2e-4 or spent > 3000:
                    # The path ends here (-1), or was too long to follow (nan).
                    out[m:, 4] = -1.0 if stride < 2e-4 and sweep > 0 else np.nan
                    return
                continue
            if goal != d:
                old[:], told[:], dold, have = x, tangent, d, True
            x[:], tangent[:], d = guess, new_tangent, goal
            if goal == targets[m]:
                break
            stride = min(stride * 1.6, 0.5)
        out[m, 0], out[m, 1], out[m, 2], out[m, 3], out[m, 4] = x[0], x[1], tangent[0], tangent[1], n


def shoot(targets, start, l0, span, p, rtol, out):  # type: ignore[no-untyped-def]
    """Follow one film through ascending scaled deflections ``targets``, from a state at small or middle deflection.

    For small d every material starts alike (G alone matters, and drops out), so the start from there is a good guess:
    th = d/T l0 for a stretched film, 0.7 d/T for a flat one. Where it fails, a coarse search at ``start`` follows.
    """
    stages, y, new = np.empty((STAGES + 1, SIZE)), np.empty(SIZE), np.empty(SIZE)
    x, tangent = np.empty(2), np.empty(2)
    out[:] = np.nan
    d = min(0.5, targets[-1])
    flat = min((l0 - 1.0) / (0.2 * d * d), 1.0) if l0 > 1.0 else 0.0
    x[0], x[1] = l0 + 0.1183 * d * d, d / (span * l0) * (0.7 + 0.3 * flat)
    found = solve_one(x, d, l0, span, p, rtol, 20, stages, y, new, tangent) > 0 and 0.0 < x[1] < np.pi and x[0] > 0.0
    if not found:
        d = start
    for _ in range(6):
        found = found or first_state(x, d, l0, span, p, rtol, stages, y, new, tangent)
        if found:
            above = np.searchsorted(targets, d)
            walk(x, tangent, d, targets[above:], 1, l0, span, p, rtol, out[above:], stages, y, new)
            walk(x, tangent, d, targets[:above], -1, l0, span, p, rtol, out[:above], stages, y, new)
            return
        d *= 0.5


def survey(x, d, l0, span, p, rtol, nodes, weights, line):  # type: ignore[no-untyped-def]
    """Follow a solved state x = (l1, th, slopes)(0) once more and look at it on the way; into line (12,).

    nodes, weights (G,) : Gauss points and weights on [0, 1]; the film is examined there and at both edges
    line : force and slope dF/dd (over 2 pi, scaled); change of R P1 sin(th) over the film relative to its value;
    residuals of l2 and h; energy over 2 pi; largest stretch; least P11; least of P11, P22; least eigenvalue of the
    Hessian; least P2; least of max(P1, P2)
    """
    stages, y, new = np.empty((STAGES + 1, SIZE)), np.empty(SIZE), np.empty(SIZE)
    size = min(d, 1.0)
    th0 = x[1]
    _, p1, p2, p11, p12, p22 = derivatives(p, x[0], l0)
    line[0] = p1 * np.sin(th0)
    line[1] = p11 * np.sin(th0) * x[2] + p1 * np.cos(th0) * x[3]
    flux, line[2], line[5], line[6] = line[0], 0.0, 0.0, 0.0
    for i in range(7, 12):
        line[i] = np.inf
    for g in range(-1, nodes.size + 1):
        part = 0.0 if g < 0 else (nodes[g] if g < nodes.size else 1.0)
        t = part * span
        if g < 0:
            l1, l2, th = x[0], l0, th0
        else:
            if not integrate(x[0], x[1], l0, t, p, size * size, size, rtol, stages, y, new):
                line[2] = np.inf
                return
            l1, l2, th = l0 + y[1], l0 + y[0], y[2]
        w, p1, p2, p11, p12, p22 = derivatives(p, l1, l2)
        line[2] = max(line[2], abs(np.exp(t) * p1 * np.sin(th) / flux - 1.0))
        if 0 <= g < nodes.size:
            line[5] += weights[g] * span * np.exp(2.0 * t) * w
        line[6] = max(line[6], l1, l2)
        line[7] = min(line[7], p11)
        line[8] = min(line[8], p11, p22)
        half = 0.5 * (p11 - p22)
        line[9] = min(line[9], 0.5 * (p11 + p22) - np.sqrt(half * half + p12 * p12))
        line[10] = min(line[10], p2)
        line[11] = min(line[11], max(p1, p2))
    line[3], line[4] = abs(y[0]) / (size * size), abs(y[3] / d - 1.0)
