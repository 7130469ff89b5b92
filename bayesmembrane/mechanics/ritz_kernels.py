"""Compiled inner loops of the spectral Ritz method, `LANES` films side by side.

Unknowns, in t = ln(R/R1) with lengths in units of the stress-free inner radius and l0 the pre-stretch:
    l2(t) = l0 + sum_i a_i phi_i(t),      h(t) = d t/T + sum_i b_i phi_i(t),      T = ln(R2/R1)
    u = l1 cos(theta) = l2' + l2,         w = l1 sin(theta) = exp(-t) h',         l1 = sqrt(u^2 + w^2) > 0
so the boundary values hold exactly and mirror branches (l1 < 0) cannot be reached. The stored energy over 2 pi,
    I(q; d) = int_0^T exp(2 t) W(l1, l2) dt,
is minimised by Newton's method with the exact Hessian K. With g the gradient, K_d the mixed derivative and
z = K^-1 K_d, one factorisation gives
    step -K^-1 g,  F ~ I_d - z.g,  dF/dd ~ I_dd - z.K_d,  dq/dd = -z,  dF/dp ~ I_dp - z.g_p  (envelope theorem).

Every array of films is C-contiguous with shape (rows, LANES), moved by `simd.load` and `simd.store`; lanes never mix, so
a film's result does not depend on its neighbours. Functions are numbered 0..n-1, with unknown 2i for a_i and 2i+1 for
b_i; function i is non-zero only at the points g with first[g] <= i < last[g], that is start[i] <= g < stop[i], which
keeps K banded when there are several elements: K_ij (j <= i) stands in row i width + i - j.
``derivatives``, ``sensitivities`` and ``FIELDS`` are the material's (see `compiled.bind`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bayesmembrane.mechanics.simd import LANES, greatest, least, load, load_all, splat, store, where

if TYPE_CHECKING:
    derivatives: Any
    sensitivities: Any
    FIELDS: Any

# Rows per point in the array of local quantities.
U, S, W, L1, P1, P2, P11, P12, P22, ENERGY = range(10)
ROWS = 10
# Rows per deflection in the array of results.
FORCE, SLOPE, STORED, STATUS, COUNT, GAIN, VARIATION, STRETCH, ELLIPTIC, CONVEX, LEAST_P11, LEAST_P1, LEAST_P2, SLACK = range(14)
RESULTS = 14


def states(q, d, l0, p, points, phi, both, slope, beta, first, last, x):  # type: ignore[no-untyped-def]
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


def assemble(x, c, row, sums, phi, both, slope, beta, weight, start, stop, low, width, grad, mixed, band):  # type: ignore[no-untyped-def]
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
        for j in range(low[2 * i] // 2, i + 1):
            aa, ab, ba, bb = zero, zero, zero, zero
            for g in range(max(start[i], start[j]), min(stop[i], stop[j])):
                a, f, b, r = both[j, g], phi[j, g], slope[j, g], 6 * g
                aa = aa + load(row, r) * a + load(row, r + 1) * f
                ab = ab + load(row, r + 2) * b
                ba = ba + load(row, r + 3) * a + load(row, r + 4) * f
                bb = bb + load(row, r + 5) * b
            o = 2 * i * width + 2 * (i - j)
            store(band, o, aa)
            store(band, o + width, bb)
            store(band, o + width + 1, ba)
            if j < i:
                store(band, o - 1, ab)


def factorise(band, low, width):  # type: ignore[no-untyped-def]
    """K = L D L^T in place: L_ij for low[i] <= j < i and 1/D_i; returns the least pivot.

    A pivot that is not positive is replaced by its magnitude, so that the Newton step still descends.
    """
    smallest = splat(np.inf)
    for i in range(low.shape[0]):
        bi = i * width + i
        for j in range(low[i], i):
            bj = j * width + j
            v = load(band, bi - j)
            for r in range(max(low[i], low[j]), j):
                v = v - load(band, bi - r) * load(band, bj - r)
            store(band, bi - j, v)
        pivot = load(band, bi - i)
        for j in range(low[i], i):
            v = load(band, bi - j)
            y = v * load(band, j * width)
            pivot = pivot - v * y
            store(band, bi - j, y)
        smallest = least(pivot, smallest)
        store(band, bi - i, 1.0 / greatest(abs(pivot), splat(1e-300)))
    return smallest


def backsolve(band, low, width, y, z):  # type: ignore[no-untyped-def]
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


def predict(q, dq, old, dold, d_new, d, d_old, order, guess):  # type: ignore[no-untyped-def]
    """Extrapolate the unknowns to d_new: Hermite cubic through two states (order 3) or the tangent (1).

    For small d the hoop coefficients grow like d^2 and then saturate, the height's grow like d: divided by
    d^2/(1+d^2) and by d they vary slowly with x = ln d, and so they are extrapolated.
    """
    ahead, span = np.log(d_new / d), np.log(d / d_old)
    one = splat(1.0)
    for i in range(q.shape[0]):
        if i % 2 == 0:
            r0, rm = 1.0 / (1.0 + d * d), 1.0 / (1.0 + d_old * d_old)
            s0, sm, rate0, ratem = d * d * r0, d_old * d_old * rm, 2.0 * r0, 2.0 * rm
            back = d_new * d_new / (1.0 + d_new * d_new)
        else:
            s0, sm, rate0, ratem, back = d, d_old, one, one, d_new
        y = load(q, i) / s0
        m = load(dq, i) * d / s0 - rate0 * y
        if order == 1:
            store(guess, i, (y + m * ahead) * back)
        else:
            ym = load(old, i) / sm
            mm = load(dold, i) * d_old / sm - ratem * ym
            chord = (y - ym) / span
            c2 = (m - chord) / span
            c3 = (m + mm - 2.0 * chord) / (span * span)
            store(guess, i, (y + ahead * (m + ahead * (c2 + (ahead + span) * c3))) * back)


def examine(x, points, inner, growth, gd, out, o):  # type: ignore[no-untyped-def]
    """Diagnostics of a converged state, into rows o + VARIATION .. o + SLACK of ``out``.

    rms variation of R P1 sin(theta) over its mean; largest stretch; least of P11, P22 and least eigenvalue of the
    Hessian of W, both over G d; least P11, P1, P2; least of max(P1, P2), not positive where the film is slack.
    """
    zero, top = splat(0.0), splat(np.inf)
    total, stretch = zero, zero
    ellipse, convex, low11, low1, low2, slack = top, top, top, top, top, top
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
        low11, low1, low2, slack = least(p11, low11), least(p1, low1), least(p2, low2), least(greatest(p1, p2), slack)
    mean, square = total / inner, zero
    for g in range(inner):
        r = ROWS * g
        e = growth[g] * load(x, r + P1) * load(x, r + W) / load(x, r + L1) - mean
        square = square + e * e
    store(out, o + VARIATION, np.sqrt(square / inner) / abs(mean))
    store(out, o + STRETCH, stretch)
    store(out, o + ELLIPTIC, ellipse / gd)
    store(out, o + CONVEX, convex / gd)
    store(out, o + LEAST_P11, low11)
    store(out, o + LEAST_P1, low1)
    store(out, o + LEAST_P2, low2)
    store(out, o + SLACK, slack)


def energy_gain(x, weight, extra, elements, out, o):  # type: ignore[no-untyped-def]
    """How much energy the next two bubbles of every element would release, sum of g^2 / (2 K_ii), into row o + GAIN.

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
    store(out, o + GAIN, gain)


def force_sensitivity(x, p, z, inner, phi, both, slope, beta, weight, first, last, out, o):  # type: ignore[no-untyped-def]
    """dF/dp_m = dI_d/dp_m - z.dg/dp_m, into rows o + m of ``out``."""
    for m in range(len(FIELDS)):
        store(out, o + m, 0.0)
    for g in range(inner):
        r = ROWS * g
        l1 = load(x, r + L1)
        co, si = load(x, r + U) / l1, load(x, r + W) / l1
        along, across = si * beta[g], splat(0.0)
        for i in range(first[g], last[g]):
            a = load(z, 2 * i)
            along = along - co * a * both[i, g] - si * load(z, 2 * i + 1) * slope[i, g]
            across = across + a * phi[i, g]
        rows = sensitivities(p, l1, load(x, r + S))
        for m in range(len(FIELDS)):
            store(out, o + m, load(out, o + m) + weight[g] * (rows[m][1] * along - rows[m][2] * across))


def decide(j, iteration, most_trust, d, lane, sums, dots, pivot, result):  # type: ignore[no-untyped-def]
    """Per lane: accept the trial state, halve the step, restart or finish. Scalar code, a few operations per lane.

    lane (8, LANES), kept between iterations: accept, halve, restart, finish (masks), alpha, base energy, fall, state
    (0 fresh, 1 running, 2 done, 3 lost). Returns the number of lanes that are done or lost.
    """
    over = 0
    for k in range(LANES):
        for r in range(4):
            lane[r, k] = 0.0
        if lane[7, k] >= 2.0:
            over += 1
            continue
        energy, decrement = sums[0, k], dots[0, k]
        scale = abs(sums[1, k] * d[k])
        good = np.isfinite(energy) and np.isfinite(decrement) and sums[3, k] > 0.0
        if good and lane[7, k] == 1.0 and lane[6, k] > 1e-5 * scale and lane[6, k] > 1e-12 * abs(energy):
            # Smaller falls drown in the round-off of the energy: there the step is trusted.
            good = energy <= lane[5, k] - 1e-4 * lane[4, k] * lane[6, k]
        if good:
            lane[0, k], lane[4, k], lane[5, k], lane[6, k], lane[7, k] = 1.0, 1.0, energy, decrement, 1.0
            if abs(decrement) <= most_trust * scale:
                lane[3, k], lane[7, k] = 1.0, 2.0
                result[FORCE, k] = sums[1, k] - dots[1, k]
                result[SLOPE, k] = sums[2, k] - dots[2, k]
                result[STORED, k] = energy - 0.5 * decrement
                result[STATUS, k] = 0.0 if pivot[k] > 0.0 else 3.0
                result[COUNT, k] = iteration + 1.0
        elif lane[7, k] == 1.0:
            lane[1, k] = 1.0
            lane[4, k] *= 0.5
        elif iteration == 0 and j > 0:
            lane[2, k] = 1.0
        else:
            lane[7, k] = 3.0
    return over


def follow(p_rows, gd_row, l0_row, grid, q, tables, most, tolerance, with_sens, keep, result, sens, trace):  # type: ignore[no-untyped-def]
    """Continue one block of films through ascending scaled deflections grid (M, LANES).

    p_rows (n_fields, LANES), gd_row, l0_row (1, LANES) : parameters, G d, pre-stretch
    q (2n, LANES) : unknowns; on entry a start (zeros: the flat film), on exit those of the last deflection
    tables : see `ritz.basis`
    most, tolerance : largest number of iterations; Newton decrement, over d I_d, at which a state has converged
    keep (M,) : False where a deflection only serves the continuation and is not examined
    result (RESULTS M, LANES) : the rows named FORCE .. SLACK above for each deflection, in scaled units
    sens (n_fields M, LANES) : dF/dp if with_sens
    trace (2n M, LANES) or (0, LANES) : the unknowns at every deflection

    A lane that loses the path keeps status 5 from there on.
    """
    phi, both, slope, beta, growth, weight, first, last, start, stop, low, width, extra = tables
    n, points, inner = phi.shape[0], phi.shape[1], weight.shape[0]
    m = 2 * n
    p, gd, l0 = load_all(p_rows, FIELDS), load(gd_row, 0), load(l0_row, 0)
    x, c, row, sums = (
        np.empty((ROWS * points, LANES)),
        np.empty((9 * inner, LANES)),
        np.empty((6 * inner, LANES)),
        np.empty((4, LANES)),
    )
    band, y, z, grad, mixed = (
        np.zeros((m * width, LANES)),
        np.empty((m, LANES)),
        np.empty((m, LANES)),
        np.empty((m, LANES)),
        np.empty((m, LANES)),
    )
    trial, base, step, tangent = q.copy(), q.copy(), np.zeros((m, LANES)), np.zeros((m, LANES))
    old, dq, dold = q.copy(), np.zeros((m, LANES)), np.zeros((m, LANES))
    lane, dots, pivot = np.zeros((8, LANES)), np.empty((3, LANES)), np.empty((1, LANES))
    for j in range(grid.shape[0]):
        d = load(grid, j)
        if j == 1:
            predict(q, dq, old, dold, d, load(grid, 0), load(grid, 0), 1, trial)
        elif j > 1:
            predict(q, dq, old, dold, d, load(grid, j - 1), load(grid, j - 2), 3, trial)
        for i in range(m):
            store(old, i, load(q, i))
            store(dold, i, load(dq, i))
        for r in range(RESULTS):
            store(result, RESULTS * j + r, np.nan)
        store(result, RESULTS * j + STATUS, 5.0)
        for k in range(LANES):
            lane[7, k] = 3.0 if lane[7, k] == 3.0 else 0.0
        for iteration in range(most):
            states(trial, d, l0, p, inner, phi, both, slope, beta, first, last, x)
            assemble(x, c, row, sums, phi, both, slope, beta, weight, start, stop, low, width, grad, mixed, band)
            store(pivot, 0, factorise(band, low, width))
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
            over = decide(j, iteration, tolerance, grid[j], lane, sums, dots, pivot[0], result[RESULTS * j : RESULTS * (j + 1)])
            if over == LANES:
                break
            accept, halve, restart, finish, alpha = (
                load(lane, 0),
                load(lane, 1),
                load(lane, 2),
                load(lane, 3),
                load(lane, 4),
            )
            ratio = d / load(grid, max(j - 1, 0))
            for i in range(m):
                now = load(trial, i)
                b = where(accept, now, load(base, i))
                s = where(accept, load(y, i), load(step, i))
                store(base, i, b)
                store(step, i, s)
                kept = load(old, i)
                if i % 2 == 1:
                    kept = kept * ratio
                now = where(accept, now - s, where(halve, b - alpha * s, where(restart, kept, now)))
                store(trial, i, now)
                store(q, i, where(finish, now, load(q, i)))
                zi = load(z, i)
                store(tangent, i, where(finish, zi, load(tangent, i)))
                store(dq, i, where(finish, -zi, load(dq, i)))
        for k in range(LANES):
            if lane[7, k] != 2.0:
                lane[7, k] = 3.0
        if keep[j]:
            states(q, d, l0, p, points, phi, both, slope, beta, first, last, x)
            examine(x, points, inner, growth, gd, result, RESULTS * j)
            energy_gain(x, weight, extra, extra.shape[3], result, RESULTS * j)
            if with_sens:
                force_sensitivity(
                    x, p, tangent, inner, phi, both, slope, beta, weight, first, last, sens, len(FIELDS) * j
                )
        if trace.shape[0] > 0:
            for i in range(m):
                store(trace, m * j + i, load(q, i))
