"""How much of each flaw the noise lets see: full ratio |dF/sd|, own ratio |dF/sd| once all else has taken its part.

dF is what is read with the flaw less what is read without it, the other flaws at work. All else is what the parameters
of the energy can absorb (its modulus among them) and what the sizes of the other flaws can, to first order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.generator_three.instrument import Instrument

SLIGHT, LITTLE = 1e-3, 0.02  # changes of a parameter and of a size, in parts of it
SAME = 1e-9


@dataclass(frozen=True)
class Ratios:
    """own, full : signal-to-noise ratio of a flaw with and without what all else can absorb."""

    own: float
    full: float


def visibility(instrument: Instrument, deviations: Any) -> dict[str, Ratios]:
    """Of each flaw at work, with noise of these deviations (N,) N. Raises `NoBalanceError`."""
    whole = instrument.reading()
    of_parameters = _parameter_slopes(instrument, deviations)
    of_sizes = {}
    for name, flaw in instrument.flaws.items():
        step = LITTLE * flaw.size
        more, less = (instrument.with_sizes({name: flaw.size + s}).reading() for s in (step, -step))
        of_sizes[name] = (more - less) / deviations
    out = {}
    for name in instrument.flaws:
        trace = (whole - instrument.with_sizes({name: 0.0}).reading()) / deviations
        others = [of_sizes[other] for other in instrument.flaws if other != name]
        own = remainder(trace, of_parameters + others)
        out[name] = Ratios(float(np.linalg.norm(own)), float(np.linalg.norm(trace)))
    return out


def _parameter_slopes(instrument: Instrument, deviations: Any) -> list[Any]:
    parameters = list(instrument.curves.rubber.parameters)
    out = []
    for i, p in enumerate(parameters):
        step = SLIGHT * abs(p) or 1e-6
        more, less = list(parameters), list(parameters)
        more[i] += step
        less[i] -= step
        out.append((instrument.reading(more) - instrument.reading(less)) / (2 * step) / deviations)
    return out


def remainder(trace: Any, absorbing: Sequence[Any]) -> Any:
    """(N,) what of ``trace`` no sum of the others, each (N,), makes up."""
    if not absorbing:
        return trace
    columns = np.array(absorbing).T
    columns = columns / (np.linalg.norm(columns, axis=0) + 1e-300)
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    u = u[:, s > SAME * s[0]]
    return trace - u @ (u.T @ trace)
