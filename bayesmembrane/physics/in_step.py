"""Curves of several hypotheses at once: those of one energy are solved in one batch, whatever effects are beside it.

A batch of eight films costs what one film does, and searches ask for few of each hypothesis.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import rows_without
from bayesmembrane.physics.forward import AT_ONCE, Forward, Prediction
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.rigs.base import Films, Law, Trial

Asked = tuple[Forward, Array]
"""A hypothesis at the readings of a measurement, and coordinates x (B, k)."""


def in_step(asked: Sequence[Asked], sensitivities: bool = True) -> list[Prediction]:
    """``forward(x, sensitivities, reached=False)`` of each, all of one measurement and with one solver."""
    groups: dict[type[Material], list[int]] = defaultdict(list)
    out: dict[int, Prediction] = {}
    for i, (forward, x) in enumerate(asked):
        if _drawn_through_points(forward, len(x)):
            groups[forward.hypothesis.material].append(i)
        else:
            out[i] = forward(x, sensitivities=sensitivities, reached=False)
    for group in groups.values():
        out |= dict(zip(group, _together([asked[i] for i in group], sensitivities), strict=True))
    return [out[i] for i in range(len(asked))]


def traces_in_step(asked: Sequence[tuple[Forward, Array, Array]]) -> list[Array]:
    """`form_error.traces` (E, N) N of each at one point x (k,), where its force is (N,) N."""
    missing = [rows_without(f.hypothesis, x[None, :], changing=True) for f, x, _ in asked]
    pairs = [
        (f, np.concatenate([row for _, row in rows])) for (f, _, _), rows in zip(asked, missing, strict=True) if rows
    ]
    curves = iter(in_step(pairs, sensitivities=False))
    out = []
    for (forward, _, force), rows in zip(asked, missing, strict=True):
        trace = np.zeros((len(forward.hypothesis.effects), force.size))
        if rows:
            trace[[i for i, _ in rows]] = np.nan_to_num(force - next(curves).force)
        out.append(trace)
    return out


def _drawn_through_points(forward: Forward, rows: int) -> bool:
    """True if films are solved at few points, and all that is computed of them fits into memory at once."""
    size = rows * (forward.hypothesis.curve_size + 1) * forward.path.deflection.size
    return forward.composes and not forward.rig.closed_form and size <= AT_ONCE


def _together(asked: Sequence[Asked], sensitivities: bool) -> list[Prediction]:
    """The curves of films of one energy, from one law of all of them."""
    each = [(f, f.hypothesis.films(x), f.effects(x)) for f, x in asked]
    # Films in another mounting, for differences, are so few of each that they are solved beside them.
    moved = [f.mountings(x) if sensitivities else [] for f, x in asked]
    mounted = [(f, p, m) for (f, p, _), ms in zip(each, moved, strict=True) for m in ms]
    found = _laws(each + mounted, sensitivities)
    own, others, out = found[: len(each)], (law for law, _ in found[len(each) :]), []
    for (forward, x), ms, law in zip(asked, moved, own, strict=True):
        out.append(forward.over(x, law, sensitivities, [next(others) for _ in ms]))
    return out


def _laws(asked: Sequence[tuple[Forward, Array, Array]], sensitivities: bool) -> list[tuple[Law, tuple[Array, Array]]]:
    """What `Forward.law` finds for films (B, n) with effect parameters (B, k) of each, all of one energy."""
    first = asked[0][0]
    trial = Trial(
        first.measurement,
        first.path,
        np.concatenate([f.composition.prestretch(theta) for f, _, theta in asked]),
        np.concatenate([f.composition.end(theta) for f, _, theta in asked]),
    )
    parameters = np.concatenate([p for _, p, _ in asked])
    films = Films(first.hypothesis.material, parameters, sensitivities, solve=first.solve)
    law, margins = first.rig.law(films, trial)
    ends = np.cumsum([len(p) for _, p, _ in asked])
    rows = [slice(e - len(p), e) for e, (_, p, _) in zip(ends, asked, strict=True)]
    return [(law.of(some), (margins[0][some], margins[1][some])) for some in rows]
