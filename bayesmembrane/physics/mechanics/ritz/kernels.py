"""Compiled inner loops of the spectral Ritz method, `LANES` films side by side.

Unknowns, in t = ln(R/R1) with lengths in units of the stress-free inner radius and l0 the pre-stretch:
    l2(t) = l0 + sum_i a_i phi_i(t),      h(t) = d t/T + sum_i b_i phi_i(t),      T = ln(R2/R1)
    u = l1 cos(theta) = l2' + l2,         w = l1 sin(theta) = exp(-t) h',         l1 = sqrt(u^2 + w^2) > 0
so the boundary values hold exactly and mirror branches (l1 < 0) cannot be reached. The stored energy over 2 pi,
    I(q; d) = int_0^T exp(2 t) W(l1, l2) dt,
is minimised by Newton's method with the exact Hessian K. With g the gradient, K_d the mixed derivative and
z = K^-1 K_d, one factorisation gives
    step -K^-1 g,  F ~ I_d - z.g,  dF/dd ~ I_dd - z.K_d,  dq/dd = -z,  dF/dp ~ I_dp - z.g_p  (envelope theorem).

Every array of films is C-contiguous with shape (rows, LANES), moved by `simd.load` and `simd.store`; lanes never mix,
so a film's result does not depend on its neighbours. Functions are numbered 0..n-1, with unknown 2i for a_i and 2i+1
for b_i; function i is non-zero only at the points g with first[g] <= i < last[g], that is start[i] <= g < stop[i],
which keeps K banded when there are several elements: K_ij (j <= i) stands in row i width + i - j.
Loops are ordered so that neighbouring steps do not wait for each other's sums.
``derivatives``, ``sensitivities`` and ``FIELDS`` are the material's (see `compiled.bind`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bayesmembrane.physics.mechanics.ritz.simd import LANES, greatest, least, load, load_all, splat, store, where

if TYPE_CHECKING:
    derivatives: Any = None
    sensitivities: Any = None
    FIELDS: Any = ()

# Rows per point in the array of local quantities.
U, S, W, L1, P1, P2, P11, P12, P22, ENERGY = range(10)
ROWS = 10
# Rows per deflection in the array of results.
FORCE, SLOPE, STORED, STATUS, COUNT, GAIN, VARIATION = range(7)
STRETCH, ELLIPTIC, CONVEX, LEAST_P11, LEAST_P2, SLACK = range(7, 13)
RESULTS = 13
# What a lane does, and what it is about to do (see `decide`).
ACCEPT, HALVE, RESTART, FINISH, ALPHA, BASE, FALL, MODE = range(8)
FRESH, RUNNING, DONE, LOST = 0.0, 1.0, 2.0, 3.0
# Codes of `solution.Status`.
OK, NOT_ELLIPTIC, INDEFINITE, UNRESOLVED, ITERATION_LIMIT = 0.0, 2.0, 3.0, 4.0, 5.0


def states(q, d, l0, p, points, phi, both, slope, beta, first, last, x):
    """Local quantities x (ROWS G, LANES) at the first ``points`` points, from the unknowns q (2n, LANES)."""
    for g in range(points):
        u, s, w = l0, l0, d * beta[g]
        for i in range(first[g], last[g]):
            a = load(q, 2 * i)
            u = u + a * both[i, g]
            s = s + a * phi[i, g]
            w = w + load(q, 2 * i + 1) * slope[i, g]
        l1 = np.sqrt(u * u + w * w)
        e, p1, p2, p11, p12, p22 = derivatives(p, l1, s)
        r = ROWS * g
        store(x, r + U, u)
        store(x, r + S, s)
        store(x, r + W, w)
        store(x, r + L1, l1)
        store(x, r + P1, p1)
        store(x, r + P2, p2)
        store(x, r + P11, p11)
        store(x, r + P12, p12)
        store(x, r + P22, p22)
        store(x, r + ENERGY, e)


def put(band, i, j, width, aa, ab, ba, bb):
    """The four entries of K that couple functions i and j <= i."""
    o = 2 * i * width + 2 * (i - j)
    store(band, o, aa)
    store(band, o + width, bb)
    store(band, o + width + 1, ba)
    if j < i:
        store(band, o - 1, ab)


def assemble(x, c, row, sums, phi, both, slope, beta, weight, start, stop, low, width, grad, mixed, band):
    """Banded Hessian, gradient and mixed derivative (2n, LANES), and sums = (I, I_d, I_dd, least l2)."""
    zero = splat(0.0)
    energy, force, stiff, lowest = zero, zero, zero, splat(np.inf)
    for g in range(weight.shape[0]):
        om, be, r, o = weight[g], beta[g], ROWS * g, 9 * g
        p1, p11, p12 = load(x, r + P1), load(x, r + P11), load(x, r + P12)
        inverse = 1.0 / load(x, r + L1)
        co, si = load(x, r + U) * inverse, load(x, r + W) * inverse
        geo, lowest = p1 * inverse, least(load(x, r + S), lowest)
        up, ww = om * p1 * si, om * (p11 * si * si + geo * co * co)
        store(c, o, om * p1 * co)
        store(c, o + 1, om * load(x, r + P2))
        store(c, o + 2, up)
        store(c, o + 3, om * (p11 * co * co + geo * si * si))
        store(c, o + 4, ww)
        store(c, o + 5, om * (p11 - geo) * co * si)
        store(c, o + 6, om * p12 * co)
        store(c, o + 7, om * p12 * si)
        store(c, o + 8, om * load(x, r + P22))
        energy = energy + om * load(x, r + ENERGY)
        force = force + up * be
        stiff = stiff + ww * be * be
    store(sums, 0, energy)
    store(sums, 1, force)
    store(sums, 2, stiff)
    store(sums, 3, lowest)
    for i in range(phi.shape[0]):
        ga, gb, ka, kb = zero, zero, zero, zero
        for g in range(start[i], stop[i]):
            a, f, b, be, o, r = both[i, g], phi[i, g], slope[i, g], beta[g], 9 * g, 6 * g
            us, ws, uw = load(c, o + 6), load(c, o + 7), load(c, o + 5)
            to_w, to_b = uw * a + ws * f, load(c, o + 4) * b
            store(row, r, load(c, o + 3) * a + us * f)
            store(row, r + 1, us * a + load(c, o + 8) * f)
            store(row, r + 2, to_w)
            store(row, r + 3, uw * b)
            store(row, r + 4, ws * b)
            store(row, r + 5, to_b)
            ga = ga + load(c, o) * a + load(c, o + 1) * f
            gb = gb + load(c, o + 2) * b
            ka = ka + to_w * be
            kb = kb + to_b * be
        store(grad, 2 * i, ga)
        store(grad, 2 * i + 1, gb)
        store(mixed, 2 * i, ka)
        store(mixed, 2 * i + 1, kb)
        for j in range(low[2 * i] // 2, i + 1, 2):
            # Two functions at once: the rows are loaded once for both.
            k = min(j + 1, i)
            aa, ab, ba, bb = zero, zero, zero, zero
            cc, cd, dc, dd = zero, zero, zero, zero
            for g in range(max(start[i], start[j]), min(stop[i], stop[k])):
                r = 6 * g
                on_u, on_s, on_w = load(row, r), load(row, r + 1), load(row, r + 2)
                of_u, of_s, of_w = load(row, r + 3), load(row, r + 4), load(row, r + 5)
                aa = aa + on_u * both[j, g] + on_s * phi[j, g]
                cc = cc + on_u * both[k, g] + on_s * phi[k, g]
                ba = ba + of_u * both[j, g] + of_s * phi[j, g]
                dc = dc + of_u * both[k, g] + of_s * phi[k, g]
                ab = ab + on_w * slope[j, g]
                cd = cd + on_w * slope[k, g]
                bb = bb + of_w * slope[j, g]
                dd = dd + of_w * slope[k, g]
            put(band, i, j, width, aa, ab, ba, bb)
            put(band, i, k, width, cc, cd, dc, dd)


def factorise(band, low, width, scaled, pivots):
    """K = L D L^T in place, column by column: L_ij for low[i] <= j < i, and 1/D_i; returns the least pivot.

    A pivot that is not positive is replaced by its magnitude, so that the Newton step still descends.
    scaled, pivots (2n, LANES) : room for the row D_r L_jr and for D
    """
    smallest, rows = splat(np.inf), low.shape[0]
    for j in range(rows):
        bj = j * width + j
        pivot = load(band, bj - j)
        for r in range(low[j], j):
            v = load(band, bj - r)
            y = v * load(pivots, r)
            store(scaled, r, y)
            pivot = pivot - v * y
        smallest = least(pivot, smallest)
        pivot = greatest(abs(pivot), splat(1e-300))
        inverse = 1.0 / pivot
        store(pivots, j, pivot)
        store(band, bj - j, inverse)
        for i in range(j + 1, rows):
            if low[i] > j:
                break
            bi = i * width + i
            v = load(band, bi - j)
            for r in range(max(low[i], low[j]), j):
                v = v - load(band, bi - r) * load(scaled, r)
            store(band, bi - j, v * inverse)
    return smallest


def backsolve(band, low, width, y, z):
    """Overwrite y and z (2n, LANES) with K^-1 y and K^-1 z."""
    m = low.shape[0]
    for i in range(m):
        a, b = load(y, i), load(z, i)
        for j in range(low[i], i):
            v = load(band, i * width + i - j)
            a = a - v * load(y, j)
            b = b - v * load(z, j)
        store(y, i, a)
        store(z, i, b)
    for i in range(m):
        v = load(band, i * width)
        store(y, i, load(y, i) * v)
        store(z, i, load(z, i) * v)
    for i in range(m - 1, -1, -1):
        a, b = load(y, i), load(z, i)
        for j in range(low[i], i):
            v = load(band, i * width + i - j)
            store(y, j, load(y, j) - v * a)
            store(z, j, load(z, j) - v * b)


def predict(q, dq, old, dold, d_new, d, d_old, guess):
    """Extrapolate the unknowns to d_new: Hermite cubic through two states, or the tangent if they are the same.

    For small d the hoop coefficients grow like d^2 and then saturate, the height's grow like d: divided by
    d^2/(1+d^2) and by d they vary slowly with x = ln d, and so they are extrapolated.
    """
    ahead, span, one = np.log(d_new / d), np.log(d / d_old), splat(1.0)
    cubic = where(greatest(span - 1e-9, 0.0), one, 0.0)
    inverse = 1.0 / (span + (1.0 - cubic))
    for i in range(q.shape[0]):
        if i % 2 == 0:
            r0, rm = 1.0 / (1.0 + d * d), 1.0 / (1.0 + d_old * d_old)
            s0, sm, rate0, ratem = d * d * r0, d_old * d_old * rm, 2.0 * r0, 2.0 * rm
            back = d_new * d_new / (1.0 + d_new * d_new)
        else:
            s0, sm, rate0, ratem, back = d, d_old, one, one, d_new
        y = load(q, i) / s0
        m = load(dq, i) * d / s0 - rate0 * y
        ym = load(old, i) / sm
        mm = load(dold, i) * d_old / sm - ratem * ym
        chord = (y - ym) * inverse
        c2 = cubic * (m - chord) * inverse
        c3 = cubic * (m + mm - 2.0 * chord) * inverse * inverse
        store(guess, i, (y + ahead * (m + ahead * (c2 + (ahead + span) * c3))) * back)


def examine(x, points, inner, growth, gd, out):
    """Diagnostics of a converged state, into rows VARIATION .. SLACK of ``out`` (RESULTS, LANES).

    rms variation of R P1 sin(theta) over its mean; largest stretch; least of P11, P22 and least eigenvalue of the
    Hessian of W, both over G d; least P11 and P2; least of max(P1, P2), not positive where the film is slack.
    """
    zero, top = splat(0.0), splat(np.inf)
    total, stretch = zero, zero
    ellipse, convex, low11, low2, slack = top, top, top, top, top
    for g in range(points):
        r = ROWS * g
        l1, p1, p2 = load(x, r + L1), load(x, r + P1), load(x, r + P2)
        p11, p12, p22 = load(x, r + P11), load(x, r + P12), load(x, r + P22)
        if g < inner:
            total = total + growth[g] * p1 * load(x, r + W) / l1
        half = 0.5 * (p11 - p22)
        stretch = greatest(greatest(l1, load(x, r + S)), stretch)
        ellipse = least(least(p11, p22), ellipse)
        convex = least(0.5 * (p11 + p22) - np.sqrt(half * half + p12 * p12), convex)
        low11, low2, slack = least(p11, low11), least(p2, low2), least(greatest(p1, p2), slack)
    mean, square = total / inner, zero
    for g in range(inner):
        r = ROWS * g
        e = growth[g] * load(x, r + P1) * load(x, r + W) / load(x, r + L1) - mean
        square = square + e * e
    store(out, VARIATION, np.sqrt(square / inner) / abs(mean))
    store(out, STRETCH, stretch)
    store(out, ELLIPTIC, ellipse / gd)
    store(out, CONVEX, convex / gd)
    store(out, LEAST_P11, low11)
    store(out, LEAST_P2, low2)
    store(out, SLACK, slack)


def energy_gain(x, weight, extra, elements, out):
    """How much energy the next two bubbles of every element would release, sum of g^2 / (2 K_ii), into row GAIN.

    extra (3, 2, points per element, elements) : phi + phi', phi and slope of these bubbles, as in the tables.
    """
    gain, zero = splat(0.0), splat(0.0)
    size = extra.shape[2]
    for e in range(elements):
        for i in range(2):
            ga, gb, ka, kb = zero, zero, zero, zero
            for j in range(size):
                g = e * size + j
                a, f, b, om, r = extra[0, i, j, e], extra[1, i, j, e], extra[2, i, j, e], weight[g], ROWS * g
                p1, p11, inverse = load(x, r + P1), load(x, r + P11), 1.0 / load(x, r + L1)
                co, si, geo = load(x, r + U) * inverse, load(x, r + W) * inverse, p1 * inverse
                ga = ga + om * (p1 * co * a + load(x, r + P2) * f)
                gb = gb + om * p1 * si * b
                cross = load(x, r + P12) * co
                ka = ka + om * ((p11 * co * co + geo * si * si) * a * a + (2.0 * cross * a + load(x, r + P22) * f) * f)
                kb = kb + om * (p11 * si * si + geo * co * co) * b * b
            gain = gain + 0.5 * (ga * ga / abs(ka) + gb * gb / abs(kb))
    store(out, GAIN, gain)


def force_sensitivity(x, p, dq, inner, phi, both, slope, beta, weight, first, last, out):
    """dF/dp_m = dI_d/dp_m + dq/dd.dg/dp_m, into rows RESULTS + m of ``out``."""
    for m in range(len(FIELDS)):
        store(out, RESULTS + m, 0.0)
    for g in range(inner):
        r = ROWS * g
        l1 = load(x, r + L1)
        co, si = load(x, r + U) / l1, load(x, r + W) / l1
        along, across = si * beta[g], splat(0.0)
        for i in range(first[g], last[g]):
            a = load(dq, 2 * i)
            along = along + co * a * both[i, g] + si * load(dq, 2 * i + 1) * slope[i, g]
            across = across + a * phi[i, g]
        rows = sensitivities(p, l1, load(x, r + S))
        for m in range(len(FIELDS)):
            add = weight[g] * (rows[m][1] * along + rows[m][2] * across)
            store(out, RESULTS + m, load(out, RESULTS + m) + add)


def decide(first, last_chance, tolerance, d, lane, sums, dots, pivot, out):
    """Per lane: accept the trial state, halve the step, restart or finish. Scalar code, a few operations per lane.

    lane (8, LANES), kept between iterations: accept, halve, restart, finish (masks), alpha, base energy, fall, mode.
    first : True for the first trial state at this deflection; it may be restarted unless it is the ``last_chance``.
    tolerance : Newton decrement, over d I_d, at which a state has converged
    Returns the number of lanes that are done or lost.
    """
    over = 0
    for k in range(LANES):
        for r in range(4):
            lane[r, k] = 0.0
        if lane[MODE, k] < DONE:
            energy, decrement = sums[0, k], dots[0, k]
            scale, fall = abs(sums[1, k] * d[k]), lane[FALL, k]
            good = np.isfinite(energy) and np.isfinite(decrement) and sums[3, k] > 0.0
            if good and lane[MODE, k] == RUNNING and fall > 1e-5 * scale and fall > 1e-12 * abs(energy):
                # Smaller falls drown in the round-off of the energy: there the step is trusted.
                good = energy <= lane[BASE, k] - 1e-4 * lane[ALPHA, k] * fall
            if good:
                lane[ACCEPT, k], lane[ALPHA, k], lane[MODE, k] = 1.0, 1.0, RUNNING
                lane[BASE, k], lane[FALL, k] = energy, decrement
                if abs(decrement) <= tolerance * scale:
                    lane[FINISH, k], lane[MODE, k] = 1.0, DONE
                    out[FORCE, k] = sums[1, k] - dots[1, k]
                    out[SLOPE, k] = sums[2, k] - dots[2, k]
                    out[STORED, k] = energy - 0.5 * decrement
                    out[STATUS, k] = OK if pivot[0, k] > 0.0 else INDEFINITE
            elif lane[MODE, k] == RUNNING:
                lane[HALVE, k] = 1.0
                lane[ALPHA, k] *= 0.5
            elif first and not last_chance:
                lane[RESTART, k] = 1.0
            else:
                lane[MODE, k] = LOST
        if lane[MODE, k] >= DONE:
            over += 1
    return over


def verdict(out, d, gain_limit, variation_limit):
    """Judge the converged lanes of ``out`` (RESULTS, LANES) at d (LANES,): exact, not elliptic or neither."""
    for k in range(LANES):
        if out[STATUS, k] == ITERATION_LIMIT:
            continue
        # Bubbles judge each on its own; where the film is about to soften without bound they see less than is missing.
        strict = min(max(out[ELLIPTIC, k], 1e-3), 1.0)
        fine = out[GAIN, k] <= gain_limit * strict * abs(out[FORCE, k] * d[k])
        fine = fine and out[VARIATION, k] <= variation_limit
        if not out[LEAST_P11, k] > 0.0:
            out[STATUS, k] = NOT_ELLIPTIC
        elif out[STATUS, k] == OK and not fine:
            out[STATUS, k] = UNRESOLVED


def update(lane, d, d_before, base, step, y, z, old, trial, q, dq):
    """Do what `decide` decided: the next trial state, and for lanes that finish the unknowns and their slopes dq/dd."""
    accept, halve, restart = load(lane, ACCEPT), load(lane, HALVE), load(lane, RESTART)
    finish, alpha, ratio = load(lane, FINISH), load(lane, ALPHA), d / d_before
    for i in range(trial.shape[0]):
        now = load(trial, i)
        b, s = where(accept, now, load(base, i)), where(accept, load(y, i), load(step, i))
        store(base, i, b)
        store(step, i, s)
        kept = load(old, i)
        if i % 2 == 1:
            kept = kept * ratio
        now = where(accept, now - s, where(halve, b - alpha * s, where(restart, kept, now)))
        store(trial, i, now)
        store(q, i, where(finish, now, load(q, i)))
        store(dq, i, where(finish, -load(z, i), load(dq, i)))


def solve_newton(band, low, width, grad, mixed, y, z, dots):
    """y = K^-1 g, z = K^-1 K_d, and dots = (g.y, g.z, K_d.z)."""
    m = low.shape[0]
    for i in range(m):
        store(y, i, load(grad, i))
        store(z, i, load(mixed, i))
    backsolve(band, low, width, y, z)
    gy, gz, kz = splat(0.0), splat(0.0), splat(0.0)
    for i in range(m):
        g_i, z_i = load(grad, i), load(z, i)
        gy = gy + g_i * load(y, i)
        gz = gz + g_i * z_i
        kz = kz + load(mixed, i) * z_i
    store(dots, 0, gy)
    store(dots, 1, gz)
    store(dots, 2, kz)


def spread(rows, films, column):
    """Write rows (R, LANES) to films (LANES, at most R, N) at one column."""
    for k in range(LANES):
        for r in range(films.shape[1]):
            films[k, r, column] = rows[r, k]


def remember(out, q, everywhere, rough, trace, column):
    """Write the unknowns that are wished for to trace (LANES, 2n, N) at one column."""
    for k in range(LANES):
        if everywhere or (rough and out[STATUS, k] == UNRESOLVED):
            for i in range(q.shape[0]):
                trace[k, i, column] = q[i, k]


def follow_block(p_rows, gd, l0, grid, q, tables, limits, keep, wishes, result, trace):
    """`follow` for one block; q (2n, LANES) is overwritten."""
    phi, both, slope, beta, growth, weight, first, last, start, stop, low, width, extra = tables
    most, tolerance, gain_limit, variation_limit = limits
    points, inner, m, p, kept = phi.shape[1], weight.shape[0], 2 * phi.shape[0], load_all(p_rows, FIELDS), 0
    x, c, row = np.empty((ROWS * points, LANES)), np.empty((9 * inner, LANES)), np.empty((6 * inner, LANES))
    band, y, z = np.zeros((m * width, LANES)), np.empty((m, LANES)), np.empty((m, LANES))
    grad, mixed, trial, base = np.empty((m, LANES)), np.empty((m, LANES)), q.copy(), q.copy()
    step, old, dq, dold = np.zeros((m, LANES)), q.copy(), np.zeros((m, LANES)), np.zeros((m, LANES))
    lane, sums, dots = np.zeros((8, LANES)), np.empty((4, LANES)), np.empty((3, LANES))
    pivot, out = np.empty((1, LANES)), np.empty((RESULTS + len(FIELDS), LANES))
    for j in range(grid.shape[0]):
        d, before = load(grid, j), load(grid, max(j - 1, 0))
        if j > 0:
            predict(q, dq, old, dold, d, before, load(grid, max(j - 2, 0)), trial)
        begin(q, dq, old, dold, lane, out)
        count = 0
        while count < most:
            states(trial, d, l0, p, inner, phi, both, slope, beta, first, last, x)
            assemble(x, c, row, sums, phi, both, slope, beta, weight, start, stop, low, width, grad, mixed, band)
            store(pivot, 0, factorise(band, low, width, y, z))
            solve_newton(band, low, width, grad, mixed, y, z, dots)
            count += 1
            over = decide(count == 1, j == 0, tolerance, grid[j], lane, sums, dots, pivot, out)
            update(lane, d, before, base, step, y, z, old, trial, q, dq)
            if over == LANES:
                break
        end(lane)
        if keep[j]:
            states(q, d, l0, p, points, phi, both, slope, beta, first, last, x)
            examine(x, points, inner, growth, gd, out)
            energy_gain(x, weight, extra, extra.shape[3], out)
            if wishes[0]:
                force_sensitivity(x, p, dq, inner, phi, both, slope, beta, weight, first, last, out)
            verdict(out, grid[j], gain_limit, variation_limit)
            store(out, COUNT, float(count))
            spread(out, result, kept)
            remember(out, q, wishes[1], wishes[2], trace, kept)
            kept += 1


def begin(q, dq, old, dold, lane, out):
    """Make the last state the one before, and wake the lanes that are not lost."""
    for i in range(q.shape[0]):
        store(old, i, load(q, i))
        store(dold, i, load(dq, i))
    for k in range(LANES):
        lane[MODE, k] = LOST if lane[MODE, k] == LOST else FRESH
        out[STATUS, k] = ITERATION_LIMIT


def end(lane):
    """Whoever has not arrived is lost."""
    for k in range(LANES):
        if lane[MODE, k] != DONE:
            lane[MODE, k] = LOST


def follow(p, gd, l0, grid, start, tables, limits, keep, wishes, result, trace):
    """Continue B blocks of `LANES` films each through ascending scaled deflections.

    p (B, n_fields, LANES), gd, l0 (B, 1, LANES) : parameters, G d, pre-stretch
    grid (B, M, LANES) : scaled deflections, of which those with keep (M,) are examined, N of them
    start (B, 2n, LANES) : unknowns from which the first deflection is tried (zeros: the flat film)
    tables : see `ritz.basis`
    limits : most iterations; Newton decrement, over d I_d, of a converged state; and what `verdict` judges by
    wishes : whether to give sensitivities, all unknowns, or the unknowns of unresolved states
    result (B, LANES, rows, N) : the rows FORCE .. SLACK, then dF/dp if wished for, in scaled units
    trace (B, LANES, 2n, N) : the unknowns, if wished for

    A lane that loses the path has status `ITERATION_LIMIT` from there on.
    """
    for block in range(grid.shape[0]):
        follow_block(
            p[block],
            load(gd[block], 0),
            load(l0[block], 0),
            grid[block],
            start[block],
            tables,
            limits,
            keep,
            wishes,
            result[block],
            trace[block],
        )


KERNELS = (
    states,
    put,
    assemble,
    factorise,
    backsolve,
    solve_newton,
    predict,
    examine,
    energy_gain,
    force_sensitivity,
    decide,
    verdict,
    update,
    spread,
    remember,
    begin,
    end,
    follow_block,
    follow,
)
