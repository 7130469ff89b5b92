"""Forces at many readings from few: F(delta_i) = sum_j B_ij F(node_j), with a matrix that no draw changes.

A film without effects is one smooth function of the deflection, however many readings it is asked at. The law of a
ring is known to 1e-6 (`mechanics.film_law`), and its pieces are three to five times as long as the gaps between the
nodes: a quintic spline through these adds less than a hundredth of that error, and no more to a strip's closed form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayesmembrane.data.thinning import MOST
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.forward import LONG, Forward, Prediction
from bayesmembrane.physics.mechanics.request import Spared
from bayesmembrane.physics.mechanics.solution import Status

NODES = LONG + 20
"""Deflections; more than `LONG`, so that what is asked there is the law that is asked at all readings, too."""
DEGREE = 5  # of the spline: that of the law's own pieces
WIDTH = 1.6  # of the gap: nodes are even in asinh(delta / (WIDTH L)), as the knots of the law


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a curve at the N readings of ``forward``.

    few : the same films at the nodes (n,)
    spline : (N, n) B, zero where the film is slack
    """

    forward: Forward
    few: Forward

    def __call__(self, x: Array, reached: bool = True, spare: Spared = Spared.NONE) -> Prediction:
        """As ``forward(x)``: forces from those at the nodes, where a film has all of them; others are asked there."""
        found = self.few(x, reached=reached, spare=spare)
        force = found.force @ self.spline.T
        status = np.broadcast_to(np.int8(Status.OK), force.shape)
        lost = np.flatnonzero(~found.ok)
        if lost.size:
            status = status.copy()
            some = self.forward(x[lost], reached=reached, spare=spare)
            force[lost], status[lost] = some.force, some.status
        return replace(found, deflection=self.forward.deflection, force=force, status=status)

    @cached_property
    def spline(self) -> Array:
        from scipy.interpolate import make_interp_spline  # on demand: curves are hardly ever long

        d, length = self.forward.deflection, _length(self.forward)
        u, at = (np.arcsinh(v / length) for v in (self.few.deflection, np.maximum(d, self.few.deflection[0])))
        return np.where(d[:, None] > 0, make_interp_spline(u, np.eye(u.size), k=DEGREE)(at), 0.0)


def nodes_of(forward: Forward) -> Nodes | None:
    """The nodes of a long curve; None where it is short, or not one smooth function of the deflection."""
    rig, m = forward.rig, forward.measurement
    smooth = not forward.hypothesis.effects and m.across is None and rig.slack_below_rest(m)
    if forward.deflection.size <= MOST or not smooth:
        return None
    pulled, length = forward.deflection[forward.deflection > 0], _length(forward)
    low, high = float(np.min(pulled)), float(np.max(pulled))
    at = length * np.sinh(np.linspace(np.arcsinh(low / length), np.arcsinh(high / length), NODES))
    at[0], at[-1] = low, high  # round-off may not ask for more than was reached
    few = replace(forward, deflection=at)
    # Gaps between readings are looked into for convexity: what fills them must not change what is seen there.
    return Nodes(forward, few) if np.array_equal(few.looked_at, forward.looked_at) else None


def _length(forward: Forward) -> float:
    """m: the scale of the deflection on which forces bend."""
    inner, outer = forward.measurement.rig.ring() or (0.0, forward.measurement.rig.size())
    return WIDTH * (outer - inner)
