"""Loops that the rubber itself makes: by friction within it, at any speed, and by relaxation, in time."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.generator_four.faults import FaultAtWork
from tests.generator_four.film_laws import CarriedLoad


def inner_friction(fault: FaultAtWork, load: CarriedLoad) -> Any:
    """(N,) N beside the force.

    iwan : size top sum_i w_i z_i, z_i = what F/top does between -y_i and y_i of an element that yields at y_i;
    bouc_wen : size top z sin, a tension of friction in meridians that rise by this slope (1 at the peak), with
    dz = de/l (1 - |z|^n (beta sign(de z) + 1 - beta)) and e their stretch over that at the peak.
    """
    d, top = fault.details, load.scales.top
    if fault.form == "iwan":
        yields = np.array(d["yields"])
        weights = yields ** (d["slope"] - 1)
        weights /= (weights * yields).sum()
        return fault.size * top * sum(w * stopped(load.part, y) for w, y in zip(weights, yields, strict=True))
    return fault.size * top * load.sine * _bouc_wen(load.stretch / d["length"], d["n"], d["beta"])


def stopped(x: Any, limit: float) -> Any:
    """(N,) force of a spring of stiffness 1 behind a slider that gives way at ``limit``."""
    out, z = np.zeros(len(x)), 0.0
    for i, step in enumerate(np.diff(x, prepend=0).tolist()):
        z = min(max(z + step, -limit), limit)
        out[i] = z
    return out


def _bouc_wen(way: Any, n: float, beta: float) -> Any:
    """(N,) z over a way in lengths, in small steps."""
    out, z = np.zeros(len(way)), 0.0
    for i, step in enumerate(np.diff(way, prepend=0).tolist()):
        pieces = int(abs(step) / 0.2) + 1
        for _ in range(pieces):
            turn = beta * (1.0 if step * z > 0 else -1.0) + 1 - beta
            z += step / pieces * (1 - abs(z) ** n * turn)
            z = min(max(z, -1.0), 1.0)
        out[i] = z
    return out


def relaxation_kernel(fault: FaultAtWork, clock: Any) -> Any:
    """(N, N) part of the force put on between readings j - 1 and j that is gone at reading i, for size 1.

    prony : sum_k g_k (1 - exp(-t / t_k)); stretched : 1 - exp(-(t / T)^beta); logarithmic : ln(1 + t / t0) over that of
    the whole test.
    """
    d = fault.details
    middle = np.concatenate([[0], (clock[1:] + clock[:-1]) / 2])
    since = np.maximum(clock[:, None] - middle[None, :], 0)
    if fault.form == "prony":
        gone = sum(g * -np.expm1(-since / t) for g, t in zip(d["shares"], d["times"], strict=True))
    elif fault.form == "stretched":
        gone = -np.expm1(-((since / d["time"]) ** d["beta"]))
    else:
        gone = np.log1p(since / d["shortest"]) / np.log1p(1 / d["shortest"])
    return np.tril(gone)


def relaxed(fault: FaultAtWork, kernel: Any, force: Any, load: CarriedLoad) -> Any:
    """(N,) N: F less size times what is gone of its increments; a film does not push.

    flow : F less size of (F - q), where the overstress q lives in a chain that flows, q' = F' - q / T (|q| / s)^(p-1)
    (1 + F / top): the more it carries, the quicker.
    """
    if fault.form != "flow":
        return np.maximum(force - fault.size * (kernel @ np.diff(force, prepend=0)), 0)
    d, top = fault.details, load.scales.top
    q, out = 0.0, np.zeros(len(force))
    steps = np.diff(force, prepend=0) / top
    for i, (step, span) in enumerate(zip(steps.tolist(), load.spans.tolist(), strict=True)):
        q = _flowed(q + step, span * (1 + force[i] / top) / d["time"], d["power"], d["stress"])
        out[i] = q
    return np.maximum(force - fault.size * (force - top * out), 0)


def _flowed(q: float, turns: float, power: float, stress: float) -> float:
    """The solution of dq/du = -q (|q| / s)^(p - 1) after u = ``turns``, p > 1."""
    if q == 0:
        return 0.0
    return float(q * (1 + (power - 1) * turns * (abs(q) / stress) ** (power - 1)) ** (-1 / (power - 1)))
