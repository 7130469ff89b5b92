"""The table of docs/effects.md and the picture of every effect's signature: python docs/make_effects.py.

The signature is what remains of the effect, at a size that the force can show well, after the material has bent to
absorb what it can: the projection onto what is orthogonal to the sensitivities of a Yeoh film, on a staircase of cycles
whose second half runs five times as fast.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from bayesmembrane.data.measurement import Measurement, Specimen
from bayesmembrane.ground.registry import components
from bayesmembrane.physics.effects.base import Effect, stage_number
from bayesmembrane.physics.forward import Forward
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.rigs.annulus import Annulus

HERE = Path(__file__).parent
PICTURE = HERE / "images" / "effects.png"
PAGE = HERE / "effects.md"
FILM = [8.840838, -0.6303258, 0.05632747]
PEAKS_MM, LOWEST_MM = (20.0, 35.0, 50.0, 65.0), 0.5
SPEED, FASTER = 0.5e-3, 5.0
LOADING, UNLOADING = "#1b5e8c", "#d1751c"


def protocol() -> Measurement:
    """Cycles with rising peaks; the last two of four run faster."""
    parts = []
    for peak in PEAKS_MM:
        n = int(2 * peak)
        parts += [np.linspace(LOWEST_MM, peak, n), np.linspace(peak, LOWEST_MM, n)[1:-1]]
    d = 1e-3 * np.concatenate(parts)
    speed = np.where(np.arange(d.size) < sum(p.size for p in parts[:4]), SPEED, FASTER * SPEED)
    time = np.cumsum(np.maximum(np.abs(np.diff(d, prepend=0.0)), 1e-6) / speed)
    return Measurement(d, d, Annulus(0.010, 0.035), Specimen("film", 5e-5), time=time)


def signature(effect: Effect, m: Measurement) -> tuple[np.ndarray, np.ndarray]:
    """(plain force (N,), what the material cannot absorb (N,)) in N, the effect at its typical size."""
    h = hypothesis("yeoh", [effect.name])
    x = np.concatenate([h.material.to_coordinates(FILM), effect.null])
    forward = Forward(h, m, m.deflection)
    plain = forward(x, sensitivities=True)
    assert plain.sensitivity is not None
    x[h.material_size :] = effect.typical
    change = forward(x).force[0] - plain.force[0]
    basis, _ = np.linalg.qr(plain.sensitivity[0, :, : h.material_size])
    return plain.force[0], change - basis @ (basis.T @ change)


def draw(effects: list[Effect]) -> None:
    m = protocol()
    rows = -(-len(effects) // 3)
    figure, axes = plt.subplots(rows, 3, figsize=(11.0, 2.05 * rows), sharex=True, layout="constrained")
    for axis, effect in zip(axes.flat, effects, strict=False):
        _, rest = signature(effect, m)
        largest = np.max(np.abs(rest))
        unit, factor = ("mN", 1e3) if largest < 0.3 else ("N", 1.0)
        for cycle in range(1, int(np.max(m.cycle)) + 1):
            for leg, colour in ((1, LOADING), (-1, UNLOADING)):
                at = (m.cycle == cycle) & (m.leg == leg)
                axis.plot(1e3 * m.deflection[at], factor * rest[at], color=colour, lw=0.6 + 0.35 * cycle)
        axis.axhline(0.0, color="0.6", lw=0.6)
        if effect.absorbed or largest < 1e-6:
            axis.set_ylim(-1, 1)
        p = effect.size
        size = "absorbed by the modulus" if effect.absorbed else f"{p.name} = {p.typical:.3g} {p.unit}".rstrip(" -")
        axis.set_title(f"{effect.name}   ({size})", fontsize=8.5, loc="left")
        axis.set_ylabel(unit, fontsize=8)
        axis.tick_params(labelsize=7.5)
        axis.spines[["top", "right"]].set_visible(False)
    for axis in axes.flat[len(effects) :]:
        axis.set_visible(False)
    for axis in axes[-1]:
        axis.set_xlabel("deflection, mm", fontsize=8)
    figure.legend(
        handles=[
            plt.Line2D([], [], color=LOADING, label="loading"),
            plt.Line2D([], [], color=UNLOADING, label="unloading"),
            plt.Line2D([], [], color="0.3", lw=0.9, label="thin: first cycle"),
            plt.Line2D([], [], color="0.3", lw=2.0, label="thick: last cycle"),
        ],
        loc="outside lower center",
        ncols=4,
        frameon=False,
        fontsize=8,
    )
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURE, dpi=110)
    print(f"{PICTURE}: {PICTURE.stat().st_size // 1000} kB")


HEAD = """# Effects: what a curve can hold beside the film

Written by `python docs/make_effects.py` from the components themselves; change those, not this page.

Effects act in this order, in whatever order they are named, and each is one file in
`bayesmembrane/physics/effects/` (`CONTRIBUTING.md` says how to add one):

{stages}

- Histories (slip, set, tearing, softening) are functions of the deflections reached, relative to the full range D of
  the measurement, and of time where they creep or run at a moment. What has been left out of a fit (other cycles,
  points beyond a limit) is still remembered.
- A slack film carries no force: where no deflection is left for the film its force is zero. Of a film that relaxation
  would push, `viscoelastic.withstood` is the part that it withstands: none if it is thin, all if it is a block.
- Without times, the clock of `viscoelastic` and `force_drift` is the distance travelled at 1 mm/s, so that their
  seconds are millimetres of travel: right for a machine that moves at one speed and does not pause. `rate` needs times.
- The frame yields to the force of the film after everything that it remembers, by a fixed point at every point of the
  curve; what the load cell adds comes after.
- `clamp_slip`, `permanent_set` and `tearing` keep their mechanism, but grow by a law with a free power, since a machine
  does not follow the power of a textbook: G = (1 - c) H + c (a + 1) [(1 - q) int (x / D)^a dx / D over all loading
  + q int (x / D)^a v dt / D], with H = (1 + s) (m / D)^a / (1 + s (m / D)^a) of the largest deflection m so far and v
  the mean speed of the first loading. One first loading to D at one speed ends at G = 1; c is the part that grows on
  when it is repeated, q what of that creeps, in a hold too, and s says how far growth has saturated.
  A clamp also slips at once where a deflection is reached, and a tear runs at some moment and comes to rest; both may
  do so twice, for clamps stick and slip, and tears run in steps. What comes more often is left to the law's error.
- One-sided effects have their null value as a bound.
- Lengths, forces and their rates are parts of what a test reaches: priors and bounds stand here as on OP1 of the source
  (91.5 mm of full range, 2.25 N, 35 s), and grow with the full range D, the largest force and the duration. Where
  forces are stresses they are parts of the largest stress.
- Not here: the weight of a disc that hangs on the load cell is a constant, `force_offset`. Wrinkling: of 2000 films
  drawn from the priors, clamped with stretch 1 and 1.03, none with a convex energy had a state with P1 > 0 > P2 up to
  91.5 mm (Mooney-Rivlin films that are not convex had); a film that was clamped loose wrinkles until it is taut, which
  reads as a shifted zero.

## Signatures

What the force shows of each effect at the size expected before the data, after a Yeoh film (the paper's constants) has
absorbed what it can. Four cycles with rising peaks; the last two run five times as fast.

![signatures of the effects](images/effects.png)

## The effects
"""


def _rigs(e: Effect) -> list[str]:
    return [name for name, rig in components("rigs").items() if e.occurs_on(rig)]


def page(effects: list[Effect]) -> str:
    by_stage: dict[str, list[str]] = {}
    for e in effects:
        by_stage.setdefault(e.stage, []).append(f"`{e.name}`")
    stages = "\n".join(f"{i}. {stage}: {', '.join(names)}" for i, (stage, names) in enumerate(by_stage.items(), 1))
    out = [HEAD.format(stages=stages)]
    for e in effects:
        doc = " ".join((type(e).__doc__ or "").split())
        out.append(f"### `{e.name}`: {e.title}\n\n{doc}\n\n**Residual.** {e.signature}\n")
        if e.absorbed:
            out.append(f"**Absorbed.** {e.absorbed}\n")
        out.append("| parameter | unit | meaning | null | bounds | prior |\n|---|---|---|---|---|---|")
        for p in e.coordinates:
            null = "(shape)" if p.null is None else f"{p.null:g}{', one-sided' if p.one_sided else ''}"
            bounds = f"{p.bounds[0]:g} to {p.bounds[1]:g}"
            out.append(f"| `{e.name}.{p.name}` | {p.unit} | {p.meaning} | {null} | {bounds} | {p.prior} |")
        needs = "; needs times" if e.needs_time else ""
        out.append(f"\nRigs: {', '.join(_rigs(e))}{needs}. Reference: {e.reference}.\n")
    return "\n".join(out)


def main() -> None:
    effects = sorted((cls() for cls in components("effects").values()), key=lambda e: (stage_number(e), e.rank, e.name))
    PAGE.write_text(page(effects), encoding="utf-8")
    draw(effects)


if __name__ == "__main__":
    main()
