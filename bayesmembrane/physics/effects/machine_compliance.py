"""Frame, load cell and grips yield: the film gets less than the crosshead's travel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.compiling import compiled, for_kernel
from bayesmembrane.ground.parameters import Array, HalfNormal, LogNormal, Lomax, Normal
from bayesmembrane.physics.effects.base import Compliance, EffectParameter

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

SMALLEST = 1e-9  # N: below it a power less than one has no slope
Rows = NDArray[np.intp]
REPEATED = 0.01
"""Relative: no better does a frame yield as it did in its blank run, for a film is clamped in between."""
RESOLVED = 1e-7
"""m: no crosshead's travel is known better."""
KNOTS = 20
"""Of a blank run's curve, at most; its readings are averaged between them."""
AT_REST = 1e-3
"""Of the largest force: readings below it say where the run began."""
NEAR_ZERO = 4.0
"""Times the force of the first knot: up to there a straight line through knots says so where no reading does."""
CLEAR = 3.0
"""Standard deviations: a frame that yields less has no shape that could be seen, and is taken for a spring."""
FAR = 4.0
"""Standard deviations: farther from what the blank run says no frame is looked for."""


@dataclass(frozen=True)
class FrameCurve:
    """lost = C F_m g(|F| / F_m) sign(F), C = ``compliance`` +- ``sd`` m/N at the largest force F_m of a blank run.

    g, one at F_m, is a monotone cubic through zero and the knots of the run: ``part`` (M,) of F_m, and ``lost`` (M,) of
    the travel there; straight on beyond. F. N. Fritsch, R. E. Carlson, SIAM J. Numer. Anal. 17 (1980) 238.

    most : F_m, N
    """

    part: tuple[float, ...]
    lost: tuple[float, ...]
    most: float
    compliance: float
    sd: float

    @cached_property
    def _law(self) -> tuple[PchipInterpolator, PchipInterpolator, float]:
        """g, its derivative, and its slope beyond the last knot."""
        from scipy.interpolate import PchipInterpolator  # on demand: few frames are known by a curve

        x, y = np.array([0.0, *self.part]), np.array([0.0, *self.lost])
        g = PchipInterpolator(x, y)
        return g, g.derivative(), float((y[-1] - y[-2]) / (x[-1] - x[-2]))

    def at(self, force: Array) -> tuple[Array, Array]:
        """(lost / C, its derivative), in N and 1, at forces of any shape (N)."""
        g, slope, beyond = self._law
        x = np.abs(force) / self.most
        inside, further = np.minimum(x, 1.0), np.maximum(x - 1.0, 0.0)
        lost = self.most * (g(inside) + beyond * further)
        return np.asarray(np.sign(force) * lost), np.where(further > 0, beyond, slope(inside))


@dataclass(frozen=True)
class MachineCompliance(Compliance):
    """delta_film = delta - (1 - s) u(F) - s u(F_m), s = 1 / (1 + exp(-log_odds_seated)),
    u(F) = v(F) + e^log_play v(take_up) (1 - exp(-|F| / take_up)) sign(F), v(F) = compliance F |F / 1 N|^(exponent - 1).

    F_m is the largest force so far. Beams and load cells yield in proportion to the force (exponent 1), contacts of
    round bodies as F^(2/3) (H. Hertz, J. Reine Angew. Math. 92 (1882) 156), joints that open the other way round: the
    compliance of real frames changes with the load, by tens of percents. Pins, couplings and rough seats have play that
    a small force takes up, as in the toe of a tensile test (ASTM D638, annex on toe compensation). A load string that
    was not preloaded gives way for good at its first loading, in grips, lock nuts and couplings (s; that is what its
    makers have it preloaded for: Instron 34SC, operator's guide, "Preload the load string"), and a film behind it looks
    longer after its first pull. Of one that was, next to nothing stays: s may have any order of magnitude. Only a way
    back shows it. And frames differ by orders of magnitude: a prior that falls like a normal one would rather let the
    film be softer than the frame.

    Where a blank run shows the frame, delta_film = delta - compliance F_m g(F / F_m) with the run's curve g up to its
    largest force F_m: there is no exponent then, nothing is seated any more, and the compliance is the run's, but for
    its error.

    curve : what the run shows; held : True for no parameter at all, the compliance being that of the run
    """

    curve: FrameCurve | None = None
    held: bool = False

    name: ClassVar[str] = "machine_compliance"
    title: ClassVar[str] = "compliance of the machine"
    reference: ClassVar[str] = "S. R. Kalidindi, A. Abusafieh, E. El-Danaf, Exp. Mech. 37 (1997) 210"
    signature: ClassVar[str] = (
        "Too soft where the force is high: the residual follows force times slope, and a blank run shows it. It is "
        "alike on all legs, but for what a load string that was not preloaded loses at its first loading."
    )
    remembers: ClassVar[bool] = False
    mistaken: ClassVar[float] = 0.12
    coordinates: ClassVar[tuple[EffectParameter, ...]] = (
        EffectParameter("compliance", "m/N", "travel lost by the first newton", Lomax(5e-4), (0.0, 1e-2), 0.0),
        EffectParameter("exponent", "-", "of the force that the travel lost grows with", Normal(0.9, 0.2), (0.25, 1.6)),
        EffectParameter(
            "log_odds_seated",
            "-",
            "log odds of the part of it that stays after the largest force so far",
            Normal(-4.0, 3.0),
            (-20.0, 6.0),
            begin=-2.0,
        ),
        EffectParameter(
            "log_play",
            "-",
            "ln of the play, in parts of what else is lost at the force that takes it up",
            Normal(0.3, 2.2),
            (-20.0, 8.0),
        ),
        EffectParameter("take_up", "N", "force by which the play is taken up", LogNormal(0.1, 0.8), (2e-3, 2.0)),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.curve is not None:
            own = {"coordinates": () if self.held else (_measured(self.curve),), "title": "the frame of its blank run"}
            for name, value in (own | {"exact": True}).items():
                object.__setattr__(self, name, value)

    @property
    def known(self) -> bool:
        return self.curve is not None

    @property
    def starts(self) -> list[dict[str, float]]:
        """Most of it play: of a frame with hardly any, the force that takes it up is not seen."""
        return [{"log_play": 3.0}] if self.curve is None else []

    def shown_by(self, measurement: Measurement) -> Self:
        shown = None if measurement.blank_run is None else _curve_of(measurement.blank_run.tobytes())
        return self if shown == self.curve else replace(self, curve=shown, held=self.held and shown is not None)

    def as_held(self) -> Self:
        return replace(self, held=self.known)

    def yielding(self, p: Array, force: Array, peaks: Array) -> tuple[Array, Array]:
        if self.curve is None:
            lost, soft = np.empty(force.shape), np.empty(force.shape)
            p = p if len(p) == len(force) else np.broadcast_to(p, (len(force), p.shape[1]))
            _yielding(for_kernel(p), for_kernel(expit(p[:, 2])), for_kernel(force), for_kernel(peaks), lost, soft)
            return lost, soft
        compliance = np.full((len(force), 1), self.curve.compliance) if self.held else p[:, :1]
        lost, slope = self.curve.at(force)
        return compliance * lost, compliance * slope


@compiled(error_model="numpy")
def _yielding(p, seated, force, peaks, lost, soft):  # type: ignore[no-untyped-def]
    """`MachineCompliance.yielding` of p (B, 5), with what is ``seated`` (B,); asked for a thousand times a frame."""
    for b in range(force.shape[0]):
        compliance, power, take_up = p[b, 0], p[b, 1] - 1.0, p[b, 4]
        play = np.exp(p[b, 3]) * compliance * max(take_up, SMALLEST) ** power * take_up
        for n in range(force.shape[1]):
            f = force[b, n]
            secant = compliance * max(abs(f), SMALLEST) ** power
            left = np.exp(-abs(f) / take_up)
            lost[b, n] = secant * f + play * np.sign(f) * (1.0 - left)
            soft[b, n] = (power + 1.0) * secant + play * left / take_up
            if not f >= peaks[b, n]:
                most = peaks[b, n]
                far = compliance * max(abs(most), SMALLEST) ** power * most
                far += play * np.sign(most) * (1.0 - np.exp(-abs(most) / take_up))
                lost[b, n] = (1.0 - seated[b]) * lost[b, n] + seated[b] * far
                soft[b, n] *= 1.0 - seated[b]
            if np.isnan(f):  # which numba's `max` swallows
                lost[b, n] = soft[b, n] = np.nan
            elif np.isnan(peaks[b, n]):
                lost[b, n] = np.nan


def _measured(curve: FrameCurve) -> EffectParameter:
    """The compliance of a frame that was measured: no size that may be nothing, but a value with its error."""
    value, sd = curve.compliance, curve.sd
    clear = value > FAR * sd
    return EffectParameter(
        "compliance",
        "m/N",
        "travel lost per newton at the largest force of the blank run",
        Normal(value, sd) if clear else HalfNormal(float(np.hypot(value, sd))),
        (value - FAR * sd if clear else 0.0, value + FAR * sd),
    )


@lru_cache(maxsize=64)
def _curve_of(run: bytes) -> FrameCurve:
    """From a blank run (M, 2), m and N, as bytes: means of its readings between forces, closer where these are small.

    The error of the compliance is that of half a loop, as where the frame has play or yields another way back, however
    many readings show it; that of a mean by the scatter about the curve; and `REPEATED` of it.
    """
    from scipy.optimize import isotonic_regression  # on demand, as above

    travel, force = np.frombuffer(run).reshape(-1, 2).T
    most = float(np.max(force))
    rows = _between_knots(force / most)
    at, gone = (np.array([np.mean(v[some]) for some in rows]) for v in (force / most, travel))
    resting = np.abs(force) <= AT_REST * most
    begun = float(np.mean(travel[resting])) if np.any(resting) else _at_zero(at, gone)
    gone = isotonic_regression(np.maximum(gone - begun, 0.0), weights=[some.size for some in rows]).x
    top = float(gone[-1] + (gone[-1] - gone[-2]) / (at[-1] - at[-2]) * (1.0 - at[-1]))
    loop = _half_of_a_loop(travel, int(np.argmax(force)), rows)
    shape = (gone[at < 1] / max(top, RESOLVED)).tolist()
    curve = FrameCurve((*at[at < 1].tolist(), 1.0), (*shape, 1.0), most, top / most, 0.0)
    off = travel - begun - curve.compliance * curve.at(force)[0]
    scatter = float(np.sqrt(np.mean(off**2) * len(rows) / off.size))
    sd = float(np.sqrt(loop**2 + scatter**2 + (REPEATED * top) ** 2 + RESOLVED**2))
    if top < CLEAR * sd:
        curve = replace(curve, part=(1.0,), lost=(1.0,))
    return replace(curve, sd=sd / most)


def _between_knots(part: Array) -> list[Rows]:
    """Numbers of the readings in each of the cells of a blank run whose forces are ``part`` (M,) of the largest."""
    loaded = np.flatnonzero(part > AT_REST)
    count = int(np.clip(loaded.size // 2, 2, KNOTS))
    cell = np.minimum((np.sqrt(part[loaded]) * count).astype(int), count - 1)
    found = [loaded[cell == k] for k in range(count) if np.any(cell == k)]
    return found if len(found) > 1 else np.array_split(loaded[np.argsort(part[loaded])], 2)


def _at_zero(at: Array, gone: Array) -> float:
    """m, where the run began: the straight line through its first knots, at no force."""
    near = max(int(np.count_nonzero(at <= NEAR_ZERO * at[0])), 2)
    return float(np.polyval(np.polyfit(at[:near], gone[:near], 1), 0.0))


def _half_of_a_loop(travel: Array, top: int, rows: list[Rows]) -> float:
    """m, root mean square over the cells in which there are readings up to the ``top`` one, and after it; 0 without."""
    both = [(travel[some[some <= top]], travel[some[some > top]]) for some in rows]
    wide = [float(np.mean(a) - np.mean(b)) for a, b in both if a.size and b.size]
    return 0.5 * float(np.sqrt(np.mean(np.square(wide)))) if wide else 0.0
