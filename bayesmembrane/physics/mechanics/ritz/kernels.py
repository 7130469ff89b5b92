"""Compiled inner loops of the Ritz method, `LANES` films side by side, each on elements of its own lengths.

Unknowns, in t = ln(R/R1) with lengths in units of the stress-free inner radius and l0 the pre-stretch:
    l2(t) = l0 + sum_i a_i phi_i(t),      h(t) = d t/T + sum_i b_i phi_i(t),      T = ln(R2/R1)
    u = l1 cos(theta) = l2' + l2,         w = l1 sin(theta) = exp(-t) h',         l1 = sqrt(u^2 + w^2) > 0
so the boundary values hold exactly and mirror branches (l1 < 0) cannot be reached. The stored energy over 2 pi,
    I(q; d) = int_0^T exp(2 t) W(l1, l2) dt,
is minimised by Newton's method with the exact Hessian K. With g the gradient, K_d the mixed derivative and
z = K^-1 K_d, one factorisation gives
    step -K^-1 g,  F ~ I_d - z.g,  dF/dd ~ I_dd - z.K_d,  dq/dd = -z,  dF/dp ~ I_dp - z.g_p  (envelope theorem).

On an element t = a + (1 + x) half, -1 < x < 1, the functions are the hats of its ends and ``per - 1`` bubbles N_i(x),
the same for all elements and films: local function i is ``value[i]`` and has the slope ``rate[i]`` / half, and is
function e per - 1 + i of the film; hats of the edges do not exist. One element has bubbles alone. Unknowns are
2i for a_i and 2i+1 for b_i; K is banded: K_ij (j <= i) stands in row i width + i - j, low[i] is the least such j.

Every array of films is C-contiguous with shape (rows, LANES), moved by `simd.load` and `simd.store`; lanes never mix,
so a film's result does not depend on its neighbours. Loops are ordered so that neighbouring steps do not wait for each
other's sums. ``derivatives``, ``sensitivities`` and ``FIELDS`` are the material's (see `compiled.bind`).
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
ACCEPT, HALVE, RESTART, FINISH, ALPHA, BASE, FALL, MODE, MOVES = range(9)
FRESH, RUNNING, DONE, LOST = 0.0, 1.0, 2.0, 3.0
# Of ln d: the distance of two states below which what lies between them is round-off.
NEARLY_ONE = 1e-5
# Codes of `solution.Status`.
OK, NOT_ELLIPTIC, INDEFINITE, UNRESOLVED, ITERATION_LIMIT = 0.0, 2.0, 3.0, 4.0, 5.0


def measure(ends, nodes, weights, half, growth, weight):
    """Half lengths (E, LANES) of elements with these ends (E+1, LANES), and exp(t) and weights at their points."""
    elements, size = half.shape[0], nodes.shape[0]
    for e in range(elements):
        start = load(ends, e)
        h = 0.5 * (load(ends, e + 1) - start)
        store(half, e, h)
        for g in range(size):
            grow = np.exp(start + h * (1.0 + nodes[g]))
            store(growth, e * size + g, grow)
            store(weight, e * size + g, weights[g] * h * grow * grow)
    for edge in range(2):
        store(growth, elements * size + edge, np.exp(load(ends, edge * elements)))


def state(q, d, l0, p, e, elements, column, value, rate, half, grow, r, x):
    """Local quantities, rows r .. of x, at one point: ``column`` of the tables, in element e."""
    per, s, bend, rise = value.shape[0] - 1, l0, splat(0.0), d * half
    for i in range(1 if e == 0 else 0, per if e == elements - 1 else per + 1):
        o = 2 * (e * per - 1 + i)
        a, t = load(q, o), rate[i, column]
        s = s + a * value[i, column]
        bend = bend + a * t
        rise = rise + load(q, o + 1) * t
    u, w = s + bend / half, rise / (half * grow)
    l1 = np.sqrt(u * u + w * w)
    energy, p1, p2, p11, p12, p22 = derivatives(p, l1, s)
    store(x, r + U, u)
    store(x, r + S, s)
    store(x, r + W, w)
    store(x, r + L1, l1)
    store(x, r + P1, p1)
    store(x, r + P2, p2)
    store(x, r + P11, p11)
    store(x, r + P12, p12)
    store(x, r + P22, p22)
    store(x, r + ENERGY, energy)


def states(q, d, l0, p, points, span, value, rate, half, growth, x):
    """Local quantities x (ROWS points, LANES) at the Gauss points and, if ``points`` go beyond, at the two edges."""
    elements, size, steep = half.shape[0], value.shape[1] - 2, d / span
    for g in range(points):
        e, column = g // size, g % size
        if e == elements:
            # The edges: the last two columns of the tables, in the first and in the last element.
            e, column = column * (elements - 1), size + column
        state(q, steep, l0, p, e, elements, column, value, rate, load(half, e), load(growth, g), ROWS * g, x)


def add(rows, row, value):
    """Add a vector to a row."""
    store(rows, row, load(rows, row) + value)


def put(band, i, j, width, aa, ab, ba, bb):
    """Add to the four entries of K that couple functions i and j <= i."""
    o = 2 * i * width + 2 * (i - j)
    add(band, o, aa)
    add(band, o + width, bb)
    add(band, o + width + 1, ba)
    if j < i:
        add(band, o - 1, ab)


def coefficients(x, first, size, steep, half, growth, weight, c, sums):
    """What an element's integrands are made of, c (9 size, LANES), and its part of sums (I, I_d, I_dd, least l2).

    For functions v with slope r / half, in a: gradient c0 v + c1 r, Hessian c3 v v' + c4 (v r' + r v') + c5 r r'; in b:
    c2 r and c8 r r'; between them v in a and r' in b: c6 v r' + c7 r r'. The deflection acts like b with r = steep.
    """
    energy, force, stiff, lowest = load(sums, 0), load(sums, 1), load(sums, 2), load(sums, 3)
    inverse = 1.0 / half
    for g in range(size):
        om, r, o = load(weight, first + g), ROWS * (first + g), 9 * g
        p1, p11, inv = load(x, r + P1), load(x, r + P11), 1.0 / load(x, r + L1)
        co, si, steeper = load(x, r + U) * inv, load(x, r + W) * inv, inverse / load(growth, first + g)
        geo, lowest = p1 * inv, least(load(x, r + S), lowest)
        along, up, cross = om * p1 * co, om * p1 * si * steeper, om * load(x, r + P12)
        a, b = om * (p11 * co * co + geo * si * si), om * (p11 - geo) * co * si
        across, flat = cross * co, om * (p11 * si * si + geo * co * co) * steeper * steeper
        store(c, o, along + om * load(x, r + P2))
        store(c, o + 1, along * inverse)
        store(c, o + 2, up)
        store(c, o + 3, a + 2.0 * across + om * load(x, r + P22))
        store(c, o + 4, (a + across) * inverse)
        store(c, o + 5, a * inverse * inverse)
        store(c, o + 6, (b + cross * si) * steeper)
        store(c, o + 7, b * inverse * steeper)
        store(c, o + 8, flat)
        energy = energy + om * load(x, r + ENERGY)
        force = force + up * steep
        stiff = stiff + flat * steep * steep
    store(sums, 0, energy)
    store(sums, 1, force)
    store(sums, 2, stiff)
    store(sums, 3, lowest)


def assemble(x, c, row, sums, span, value, rate, half, growth, weight, width, grad, mixed, band):
    """Banded Hessian, gradient and mixed derivative (2n, LANES), and sums = (I, I_d, I_dd, least l2)."""
    zero, elements, size, per = splat(0.0), half.shape[0], value.shape[1] - 2, value.shape[0] - 1
    for i in range(3):
        store(sums, i, zero)
    store(sums, 3, splat(np.inf))
    for i in range(grad.shape[0]):
        store(grad, i, zero)
        store(mixed, i, zero)
    for i in range(band.shape[0]):
        store(band, i, zero)
    for e in range(elements):
        steep, start = load(half, e) / span, e * per - 1
        coefficients(x, e * size, size, steep, load(half, e), growth, weight, c, sums)
        lowest = 1 if e == 0 else 0
        for i in range(lowest, per if e == elements - 1 else per + 1):
            o = 2 * (start + i)
            ga, gb, ka, kb = zero, zero, zero, zero
            for g in range(size):
                v, t, b, r = value[i, g], rate[i, g], 9 * g, 6 * g
                both, to_b, of_b = load(c, b + 4), load(c, b + 6) * v + load(c, b + 7) * t, load(c, b + 8) * t
                store(row, r, load(c, b + 3) * v + both * t)
                store(row, r + 1, both * v + load(c, b + 5) * t)
                store(row, r + 2, to_b)
                store(row, r + 3, load(c, b + 6) * t)
                store(row, r + 4, load(c, b + 7) * t)
                store(row, r + 5, of_b)
                ga = ga + load(c, b) * v + load(c, b + 1) * t
                gb = gb + load(c, b + 2) * t
                ka = ka + to_b
                kb = kb + of_b
            add(grad, o, ga)
            add(grad, o + 1, gb)
            add(mixed, o, ka * steep)
            add(mixed, o + 1, kb * steep)
            for j in range(lowest, i + 1, 2):
                # Two functions at once: the rows are loaded once for both.
                k = min(j + 1, i)
                aa, ab, ba, bb = zero, zero, zero, zero
                cc, cd, dc, dd = zero, zero, zero, zero
                for g in range(size):
                    r, vj, tj, vk, tk = 6 * g, value[j, g], rate[j, g], value[k, g], rate[k, g]
                    on_v, on_t, on_b = load(row, r), load(row, r + 1), load(row, r + 2)
                    of_v, of_t, of_b = load(row, r + 3), load(row, r + 4), load(row, r + 5)
                    aa = aa + on_v * vj + on_t * tj
                    cc = cc + on_v * vk + on_t * tk
                    ba = ba + of_v * vj + of_t * tj
                    dc = dc + of_v * vk + of_t * tk
                    ab = ab + on_b * tj
                    cd = cd + on_b * tk
                    bb = bb + of_b * tj
                    dd = dd + of_b * tk
                put(band, start + i, start + j, width, aa, ab, ba, bb)
                if k > j:
                    put(band, start + i, start + k, width, cc, cd, dc, dd)


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
    """Extrapolate the unknowns to d_new: Hermite cubic through two states, or the tangent if they are nearly the same.

    Of two states closer than `NEARLY_ONE` in ln d, as where a drive comes back to a place, the difference is round-off.

    For small d the hoop coefficients grow like d^2 and then saturate, the height's grow like d: divided by
    d^2/(1+d^2) and by d they vary slowly with x = ln d, and so they are extrapolated.
    """
    ahead, span, one = np.log(d_new / d), np.log(d / d_old), splat(1.0)
    cubic = where(greatest(span - NEARLY_ONE, 0.0), one, 0.0)
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
            total = total + load(growth, g) * p1 * load(x, r + W) / l1
        half = 0.5 * (p11 - p22)
        stretch = greatest(greatest(l1, load(x, r + S)), stretch)
        ellipse = least(least(p11, p22), ellipse)
        convex = least(0.5 * (p11 + p22) - np.sqrt(half * half + p12 * p12), convex)
        low11, low2, slack = least(p11, low11), least(p2, low2), least(greatest(p1, p2), slack)
    mean, square = total / inner, zero
    for g in range(inner):
        r = ROWS * g
        e = load(growth, g) * load(x, r + P1) * load(x, r + W) / load(x, r + L1) - mean
        square = square + e * e
    store(out, VARIATION, np.sqrt(square / inner) / abs(mean))
    store(out, STRETCH, stretch)
    store(out, ELLIPTIC, ellipse / gd)
    store(out, CONVEX, convex / gd)
    store(out, LEAST_P11, low11)
    store(out, LEAST_P2, low2)
    store(out, SLACK, slack)


def energy_gain(x, half, growth, weight, extra, gains, out):
    """How much energy the next two bubbles of every element would release, sum of g^2 / (2 K_ii).

    extra (2, 2, points per element) : value and rate of these bubbles, as in the tables
    gains (E, LANES) : element by element; their sum goes into row GAIN of ``out``
    """
    total, zero, size = splat(0.0), splat(0.0), extra.shape[2]
    for e in range(half.shape[0]):
        gain, inverse = zero, 1.0 / load(half, e)
        for i in range(2):
            ga, gb, ka, kb = zero, zero, zero, zero
            for j in range(size):
                g = e * size + j
                r, om, f, steep = ROWS * g, load(weight, g), extra[0, i, j], extra[1, i, j] * inverse
                a, b = f + steep, steep / load(growth, g)
                p1, p11, inv = load(x, r + P1), load(x, r + P11), 1.0 / load(x, r + L1)
                co, si, geo = load(x, r + U) * inv, load(x, r + W) * inv, p1 * inv
                ga = ga + om * (p1 * co * a + load(x, r + P2) * f)
                gb = gb + om * p1 * si * b
                cross = load(x, r + P12) * co
                ka = ka + om * ((p11 * co * co + geo * si * si) * a * a + (2.0 * cross * a + load(x, r + P22) * f) * f)
                kb = kb + om * (p11 * si * si + geo * co * co) * b * b
            gain = gain + 0.5 * (ga * ga / abs(ka) + gb * gb / abs(kb))
        store(gains, e, gain)
        total = total + gain
    store(out, GAIN, total)


def force_sensitivity(x, p, dq, span, value, rate, half, growth, weight, out):
    """dF/dp_m = dI_d/dp_m + dq/dd.dg/dp_m, into rows RESULTS + m of ``out``."""
    elements, size, per = half.shape[0], value.shape[1] - 2, value.shape[0] - 1
    for m in range(len(FIELDS)):
        store(out, RESULTS + m, 0.0)
    for g in range(elements * size):
        e, r = g // size, ROWS * g
        h, l1 = load(half, e), load(x, r + L1)
        across, bend, rise = splat(0.0), splat(0.0), h / span
        for i in range(1 if e == 0 else 0, per if e == elements - 1 else per + 1):
            o, t = 2 * (e * per - 1 + i), rate[i, g - e * size]
            a = load(dq, o)
            across = across + a * value[i, g - e * size]
            bend = bend + a * t
            rise = rise + load(dq, o + 1) * t
        along = load(x, r + U) / l1 * (across + bend / h) + load(x, r + W) / l1 * rise / (h * load(growth, g))
        rows = sensitivities(p, l1, load(x, r + S))
        for m in range(len(FIELDS)):
            add = load(weight, g) * (rows[m][1] * along + rows[m][2] * across)
            store(out, RESULTS + m, load(out, RESULTS + m) + add)


def decide(first, last_chance, tolerance, d, lane, sums, dots, pivot, out):
    """Per lane: accept the trial state, halve the step, restart or finish. Scalar code, a few operations per lane.

    lane (9, LANES), kept between iterations: accept, halve, restart, finish (masks), alpha, base energy, fall, mode;
    and whether it moves at all, see `begin`.
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


def spread(rows, films, first, column):
    """Write rows (R, LANES), or as many as there is room for, to films (LANES, first + .., N) at one column."""
    for k in range(LANES):
        for r in range(min(rows.shape[0], films.shape[1] - first)):
            films[k, first + r, column] = rows[r, k]


def follow_block(p_rows, gd, l0, grid, q, ends, tables, limits, keep, wanted, result, trace):
    """`follow` for one block; q (2n, LANES) is overwritten."""
    nodes, weights, value, rate, extra, low, width = tables
    most, tolerance, gain_limit, variation_limit = limits
    elements, size, m = ends.shape[0] - 1, nodes.shape[0], q.shape[0]
    p, kept, span = load_all(p_rows, FIELDS), 0, load(ends, elements)
    inner = elements * size
    points = inner + 2
    half, growth, weight = np.empty((elements, LANES)), np.empty((points, LANES)), np.empty((inner, LANES))
    measure(ends, nodes, weights, half, growth, weight)
    x, c, row = np.empty((ROWS * points, LANES)), np.empty((9 * size, LANES)), np.empty((6 * size, LANES))
    band, y, z = np.zeros((m * width, LANES)), np.empty((m, LANES)), np.empty((m, LANES))
    grad, mixed, trial, base = np.empty((m, LANES)), np.empty((m, LANES)), q.copy(), q.copy()
    step, old, dq, dold = np.zeros((m, LANES)), q.copy(), np.zeros((m, LANES)), np.zeros((m, LANES))
    lane, sums, dots = np.zeros((9, LANES)), np.empty((4, LANES)), np.empty((3, LANES))
    behind = np.empty((1, LANES))
    store(behind, 0, load(grid, 0))
    pivot, out, gains = np.empty((1, LANES)), np.empty((RESULTS + len(FIELDS), LANES)), np.empty((elements, LANES))
    for j in range(grid.shape[0]):
        d, before = load(grid, j), load(grid, max(j - 1, 0))
        if j > 0:
            predict(q, dq, old, dold, d, before, load(behind, 0), trial)
        alive, awake = begin(grid, j, q, dq, old, dold, behind, lane, out)
        count = 0
        while awake > 0 and count < most:
            states(trial, d, l0, p, inner, span, value, rate, half, growth, x)
            assemble(x, c, row, sums, span, value, rate, half, growth, weight, width, grad, mixed, band)
            store(pivot, 0, factorise(band, low, width, y, z))
            solve_newton(band, low, width, grad, mixed, y, z, dots)
            count += 1
            over = decide(count == 1, j == 0, tolerance, grid[j], lane, sums, dots, pivot, out)
            update(lane, d, before, base, step, y, z, old, trial, q, dq)
            if over == LANES:
                break
        end(lane)
        if keep[j] and alive == 0:
            # Nobody is on the way any more: there is nothing to look at.
            spread(out, result, 0, kept)
            kept += 1
        elif keep[j]:
            states(q, d, l0, p, points, span, value, rate, half, growth, x)
            examine(x, points, inner, growth, gd, out)
            energy_gain(x, half, growth, weight, extra, gains, out)
            if wanted:
                force_sensitivity(x, p, dq, span, value, rate, half, growth, weight, out)
            verdict(out, grid[j], gain_limit, variation_limit)
            store(out, COUNT, float(count))
            spread(out, result, 0, kept)
            spread(q, trace, 0, kept)
            spread(gains, trace, m, kept)
            kept += 1


def begin(grid, j, q, dq, old, dold, behind, lane, out):
    """Wake the lanes that go on to deflection j of ``grid`` (M, LANES): their last state becomes the one before.

    behind (1, LANES) : where the states before the last ones, ``old`` and ``dold``, are
    A lane that has arrived sleeps: its deflection is repeated because others of the batch take more steps to theirs.
    Returns how many lanes are not lost, and how many of these are awake.
    """
    alive, awake = 0, 0
    for k in range(LANES):
        moves = j == 0 or grid[j, k] != grid[j - 1, k]
        lane[MOVES, k] = 1.0 if moves else 0.0
        lost = lane[MODE, k] == LOST
        if moves or lost:
            out[STATUS, k] = ITERATION_LIMIT
        if not lost:
            alive += 1
            if moves:
                lane[MODE, k] = FRESH
                awake += 1
    moved = load(lane, MOVES)
    for i in range(q.shape[0]):
        store(old, i, where(moved, load(q, i), load(old, i)))
        store(dold, i, where(moved, load(dq, i), load(dold, i)))
    store(behind, 0, where(moved, load(grid, max(j - 1, 0)), load(behind, 0)))
    return alive, awake


def end(lane):
    """Whoever has not arrived is lost."""
    for k in range(LANES):
        if lane[MODE, k] != DONE:
            lane[MODE, k] = LOST


def follow(p, gd, l0, grid, start, ends, tables, limits, keep, wanted, result, trace):
    """Continue B blocks of `LANES` films each through ascending scaled deflections.

    p (B, n_fields, LANES), gd, l0 (B, 1, LANES) : parameters, G d, pre-stretch
    grid (B, M, LANES) : scaled deflections, of which those with keep (M,) are examined, N of them; a film stays as it
    is where its own is repeated
    start (B, 2n, LANES) : unknowns from which the first deflection is tried (zeros: the flat film)
    ends (B, E+1, LANES) : where in t the elements of each film end, from 0 to T
    tables : see `elements.basis`
    limits : most iterations; Newton decrement, over d I_d, of a converged state; and what `verdict` judges by
    wanted : whether to give sensitivities
    result (B, LANES, rows, N) : the rows FORCE .. SLACK, then dF/dp if wanted, in scaled units
    trace (B, LANES, 2n + E, N) : the unknowns, and what is to be gained in each element

    A lane that loses the path has status `ITERATION_LIMIT` from there on.
    """
    for block in range(grid.shape[0]):
        follow_block(
            p[block],
            load(gd[block], 0),
            load(l0[block], 0),
            grid[block],
            start[block],
            ends[block],
            tables,
            limits,
            keep,
            wanted,
            result[block],
            trace[block],
        )


KERNELS = (
    measure,
    state,
    states,
    add,
    put,
    coefficients,
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
    begin,
    end,
    follow_block,
    follow,
)
