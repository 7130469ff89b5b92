"""Friction within the material, as between the fillers of a rubber: loops that know force and way, but no time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Normal, Uniform
from bayesmembrane.physics.effects.base import Carried, EffectParameter, FilmState

TOE = 10.0  # times the force: a steady width is no wider
WIDEST = 3.0  # times what is foretold of the full range: a width that grows towards no force is no wider
SMALLEST = 1e-4  # of the full range: below it a negative power is without bounds
EARLY = 1e-6  # below it the power is an exponential to the last digits


@dataclass(frozen=True)
class Hysteresis(Carried):
    """F = F0 + level z [(1 - steady) min(|F0| |delta / D|^grows, 3 F_D) + steady min(max |F0|, 10 |F0|)], a pull no
    less than 0.

    On each leg z = z_r + s a [1 - (1 + c u / (t a))^(-1 / c)], with s = +1 loading, -1 unloading, u the way since the
    reversal, z_r the z there, a = 1 - s z_r what is left to turn and c how ``late`` it has: exponentially if c = 0, by
    Berg's hyperbola if c = 1. It begins as steeply after any reversal; Dahl's, over one
    length whatever is left, begins twice as steeply after a whole turn. Of the way a part
    ``by_force`` is counted in force, the rest in deflection, each over its full range (`way_of`): sliders within the
    film know the one or the other. The length is t = travel (1 - similar + similar A), with A the way of the leg before
    the reversal (1 for the first loading): the same in all cycles, or small in small cycles. z = 0 at the start,
    max |F0| is the largest so far, and F_D what the tangent there foretells of the full range (`foretold`).

    Berg's friction is constant in N (steady = 1); that of a filled rubber grows with the force that it carries
    (grows = 0), or, where the film lags behind the disc by a length, with the slope of the curve (about -1). Friction
    of one stress all over a film pulls by the sine of its angle alone (-2 in the toe of a ring's curve, -1 later on).
    """

    name: ClassVar[str] = "hysteresis"
    title: ClassVar[str] = "hysteresis of the material"
    reference: ClassVar[str] = (
        "P. R. Dahl, AIAA J. 14 (1976) 1675; M. Berg, Veh. Syst. Dyn. 30 (1998) 197; "
        "M. Sjoberg, L. Kari, Nonlinear Dyn. 33 (2003) 323; W. D. Iwan, J. Appl. Mech. 33 (1966) 893"
    )
    signature: ClassVar[str] = (
        "Unloading below loading in every cycle and at any speed: closed loops, wider at larger forces or as wide at "
        "any, that do not close at rest and do not remember the largest deflection."
    )
    twins_at_one_speed: ClassVar[tuple[str, ...]] = ("viscoelastic",)
    twins_at_any_speed: ClassVar[tuple[str, ...]] = ("friction",)
    of_many_shapes: ClassVar[bool] = True
    of_the_material = True
    needs_return: ClassVar[bool] = True
    scales_with_modulus: ClassVar[bool] = True
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("level", "-", "half of the width of a loop over the force", HalfNormal(0.1), (0.0, 0.9), 0.0),
        EffectParameter(
            "travel",
            "-",
            "way after a reversal over which it turns, as part of a leg",
            LogNormal(0.05, 0.8),
            (2e-3, 2.0),
        ),
        EffectParameter(
            "similar", "-", "part of that way that is shorter in small cycles", Uniform(0.0, 1.0), (0.0, 1.0)
        ),
        EffectParameter(
            "grows",
            "-",
            "power of the deflection by which the width grows beyond its proportion to the force",
            Normal(-0.5, 0.6),
            (-2.5, 1.4),
        ),
        EffectParameter(
            "steady", "-", "part of the width that is as large at any force", Uniform(0.0, 1.0), (0.0, 1.0)
        ),
        EffectParameter("by_force", "-", "part of the way that is counted in force", Uniform(0.0, 1.0), (0.0, 1.0)),
        EffectParameter("late", "-", "how late it has turned, 0: exponentially", Uniform(0.0, 1.5), (0.0, 1.5)),
    )

    def carried(self, p: Array, force: Array, state: FilmState) -> Array:
        part = np.maximum(np.abs(state.deflection) / state.path.full_range, SMALLEST)
        size = np.abs(force)
        # In the toe a steady width is no wider than the force: a slack film carries nothing, and none pushes.
        steady = np.minimum(np.fmax.accumulate(size, axis=-1), TOE * size)
        growing = np.minimum(size * part ** p[:, 3:4], WIDEST * foretold(state))
        width = (1.0 - p[:, 4:5]) * growing + p[:, 4:5] * steady
        z = turned(p[:, 1:2], p[:, 2:3], p[:, 6:7], way_of(p[:, 5:6], force, state), state.path)
        out = force + p[:, :1] * z * width
        return np.asarray(np.where(force > 0, np.maximum(out, 0.0), out))


def turned(travel: Array, similar: Array, late: Array, come: Array, path: Motion) -> Array:
    """z (B, N), -1 to 1, of the `Hysteresis` along a path, with ``travel``, ``similar`` and ``late`` (B, 1).

    ``come`` (B, N) is where the path is, 0 where it started, in parts of all there is: deflection, force, or both.
    """
    out = np.empty(come.shape)
    each = [for_kernel(np.broadcast_to(v, (len(come), 1))[:, 0]) for v in (travel, similar, late)]
    _turned(for_kernel(come), *each, np.where(path.leg > 0, 1.0, -1.0), out)
    return out


@compiled(error_model="numpy")
def _turned(come, travel, similar, late, sign, out):  # type: ignore[no-untyped-def]
    """`turned` of come (B, N), with shapes (B,) and the ``sign`` (N,) of each leg."""
    for b in range(out.shape[0]):
        at, way, z = 0.0, 0.0, 0.0
        if sign[0] < 0.0:  # a test that begins with unloading
            at = come[b, 0]
        length = rest = 0.0
        for n in range(out.shape[1]):
            if n == 0 or sign[n] != sign[n - 1]:
                before = 1.0 if n == 0 else way
                if n > 0:
                    at, z = come[b, n - 1], out[b, n - 1]
                way, rest = 0.0, 1.0 - sign[n] * z
                length = max(travel[b] * (1.0 - similar[b] + similar[b] * before) * rest, 1e-12)
            # How far the leg has come: jitter within it is no way.
            u = sign[n] * (come[b, n] - at)
            if not u <= way:  # what is nan stays so: nothing is known of the rest
                way = u
            power = late[b] * way / length
            left = np.exp(-way / length) if late[b] < EARLY else np.exp(-np.log1p(power) / late[b])
            out[b, n] = z + sign[n] * rest * (1.0 - left)


def way_of(by_force: Array, force: Array, state: FilmState) -> Array:
    """(B, N) where the path is: a part ``by_force`` (B, 1) in force, the rest in deflection, over their full ranges.

    What is not reached yet is not known: each step in force is over what is `foretold` of the full range.
    """
    path, full = state.path, foretold(state)
    over = 0.5 * (full + np.concatenate([full[:, :1], full[:, :-1]], axis=1))
    steps = np.diff(force, axis=1, prepend=0.0) / np.where(over > 0, over, 1.0)
    return np.asarray((1 - by_force) * path.deflection / path.full_range + by_force * np.cumsum(steps, axis=1))


def foretold(state: FilmState) -> Array:
    """(B, N) N: the force at the full range, as the tangent at the largest deflection so far has it."""
    path = state.path
    ahead = np.abs(state.force) + np.abs(state.slope) * np.maximum(path.full_range - state.deflection, 0.0)
    number = np.arange(path.deflection.size)
    largest = path.deflection >= np.fmax.accumulate(path.deflection)
    return np.asarray(ahead[:, np.maximum.accumulate(np.where(largest, number, 0))])
