"""Synthetic measurements with a known fault in them: `generate` draws one, deterministic by its seed.

Nothing here knows the package under test: film, energies, faults and noise are written anew.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any
from zlib import crc32

import numpy as np

from tests.generator.distortions import DISTORTIONS, LIBRARY, Active, response
from tests.generator.energies import FAMILIES, Array
from tests.generator.film import Film, NoSolutionError, film
from tests.generator.noise import Noise
from tests.generator.projection import LEAST_VISIBLE, Projector, angle, best_fit, rivals, sized
from tests.generator.protocols import PROTOCOLS, Path, Protocol, sample

FULL_SNR = 20.0
IDENTIFIABLE = 20.0  # degrees
INNER, OUTER, THICKNESS = 0.010, 0.035, 50e-6  # m
GAIN = 0.03  # of the force, at strength 1: the material absorbs it, so no ratio can size it
MARGIN = 3.5e-3  # m of deflection beyond the largest, for shifts
STRONGEST_FAMILY = 2.5


@dataclass(frozen=True, eq=False)
class Dataset:
    """A measurement and its truth.

    time_s, deflection_mm, force_N : (N,) as the instrument wrote them; clean_N : (N,) without noise; null_N : (N,)
    without noise and faults (for a wrong family: the declared one at its best); covariance : (N, N) N^2 of the noise.
    ``truth`` holds kind, declared material, true family and parameters, effects (size, unit, form, details), the
    ratio ``snr`` of the whole, of each effect alone and of each with the others' signatures absorbed too, whether the
    size asked for was ``reached``, and ``expected``: the verdicts that are right.
    """

    time_s: Array
    deflection_mm: Array
    force_N: Array  # noqa: N815
    clean_N: Array  # noqa: N815
    null_N: Array  # noqa: N815
    covariance: Array
    truth: dict[str, Any]
    path: Path
    film: Film
    at_work: dict[str, Active] = field(repr=False)

    @property
    def csv(self) -> str:
        """The curve, with units in the header."""
        rows = zip(self.time_s, self.deflection_mm, self.force_N, strict=True)
        return "time_s,deflection_mm,force_N\n" + "".join(f"{t:.9g},{d:.9g},{f:.9g}\n" for t, d, f in rows)

    @property
    def toml(self) -> str:
        """Specimen and rig; the noise is left for the reader to find out."""
        return (
            '[specimen]\nname = "synthetic film"\n'
            f"thickness_um = {1e6 * THICKNESS:.6g}\n\n"
            '[rig]\nkind = "annulus"\n'
            f"inner_radius_mm = {1e3 * self.film.inner:.6g}\nouter_radius_mm = {1e3 * self.film.outer:.6g}\n\n"
            '[origin]\nstatement = "SYNTHETIC, not measured"\n'
        )

    def write(self, folder: FilePath, stem: str = "curve") -> tuple[FilePath, FilePath]:
        """(CSV, TOML) written into ``folder``."""
        folder.mkdir(parents=True, exist_ok=True)
        curve, specimen = folder / f"{stem}.csv", folder / f"{stem}.toml"
        curve.write_text(self.csv, encoding="utf-8")
        specimen.write_text(self.toml, encoding="utf-8")
        return curve, specimen

    @cached_property
    def projector(self) -> Projector:
        """Whitening and projection with the true material's sensitivities, without faults."""
        return Projector(self.covariance, self.film.sensitivities(self.path.deflection))

    @cached_property
    def angles(self) -> dict[str, dict[str, float]]:
        """{effect at work: {rival of the library: degrees between projected signatures}}, the nearest form each.

        An effect outside the library has its angles too. Rivals without a trace of their own are left out.
        """
        others = rivals(self.film, self.path, self.projector)
        out = {}
        for name, active in self.at_work.items():
            alone = response(self.film, self.path, {name: active}) - response(self.film, self.path, {})
            left = self.projector(alone)
            if np.linalg.norm(left) > LEAST_VISIBLE * np.linalg.norm(self.projector.whiten(alone)):
                out[name] = {
                    k: angle(left, forms, DISTORTIONS[k].two_sided)
                    for k, forms in others.items()
                    if k not in self.at_work
                }
        return out

    @cached_property
    def refit_snr(self) -> float:
        """Length of the whitened difference between the clean curve and the declared family at its best."""
        declared = self.truth["material"]
        names = FAMILIES[declared].parameters
        same = declared == self.truth["family"]
        start = np.array([self.truth["parameters"][n] for n in names]) if same else _typical(declared)
        rig = (self.film.inner, self.film.outer, self.film.reach)
        return float(
            np.linalg.norm(best_fit(declared, start, rig, self.path.deflection, self.clean_N, self.covariance)[1])
        )

    @property
    def identifiable(self) -> bool:
        """Every effect at work makes at least 20 degrees with every rival, and at work there is one."""
        smallest = [min(a.values(), default=90.0) for a in self.angles.values()]
        return bool(smallest) and len(smallest) == len(self.at_work) and min(smallest) >= IDENTIFIABLE


def generate(
    kind: str,
    material: str = "yeoh",
    protocol: str | Protocol = "staircase",
    noise: str | Noise = "white",
    strength: float = 1.0,
    seed: int = 0,
    inner: float = INNER,
    outer: float = OUTER,
) -> Dataset:
    """A measurement of a film declared as ``material`` with a fault of ``kind``.

    ``kind``: "null", a name of `DISTORTIONS`, several joined by "+"; "family:NAME" for a film that is not of the
    declared family, and so far from it that its ratio is the one asked for; "typical:NAME" for a film of that family
    as they come, however far (either may be joined too). ``strength`` times 20 is the signal-to-noise ratio of each
    projected signature by itself. ``noise``: words of `Noise.named`. One seed gives one material, one path, one noise
    and one set of details, whatever the strength.
    """
    noise = Noise.named(noise) if isinstance(noise, str) else noise
    protocol = PROTOCOLS[protocol] if isinstance(protocol, str) else protocol
    material_rng, path_rng, noise_rng = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    path = sample(protocol, path_rng, noise.uneven)
    covariance = noise.covariance(path.time.size)
    rig = (inner, outer, path.largest + MARGIN)
    names = [] if kind == "null" else kind.split("+")
    families = [n for n in names if ":" in n]
    faults = [n for n in names if ":" not in n]
    target = FULL_SNR * strength

    parameters = FAMILIES[material].draw(material_rng)
    true_family, null, snr = material, None, {}
    if families:
        manner, true_family = families[0].split(":")
        wanted = {"family": target, "typical": None}[manner]
        parameters, null, snr[families[0]] = _foreign(
            material, true_family, path, rig, covariance, wanted, material_rng
        )
    law = film(true_family, tuple(float(v) for v in parameters), *rig)
    unspoilt = response(law, path, {})
    projector = Projector(covariance, law.sensitivities(path.deflection))
    at_work: dict[str, Active] = {}
    for name in faults:
        code = crc32(name.encode())
        at_work[name] = _fault(name, law, path, projector, strength, np.random.default_rng([seed, code]))
        snr[name] = float(np.linalg.norm(projector(response(law, path, {name: at_work[name]}) - unspoilt)))
    clean = response(law, path, at_work) if at_work else unspoilt
    force = noise.rounded(clean + noise.draw(noise_rng, clean.size))
    asked = (
        [abs(s / target - 1) < 0.05 for n, s in snr.items() if n != "gain" and not n.startswith("typical:")]
        if target > 0
        else []
    )
    truth = {
        "kind": kind,
        "material": material,
        "family": true_family,
        "parameters": dict(zip(FAMILIES[true_family].parameters, map(float, parameters), strict=True)),
        "effects": {
            n: {"size": a.size, "unit": DISTORTIONS[n].unit, "form": a.form, **a.details} for n, a in at_work.items()
        },
        "snr": snr,
        "snr_together": float(np.linalg.norm(projector(clean - unspoilt))),
        "snr_own": _own(law, path, projector, at_work),
        "target_snr": target,
        "reached": all(asked),
        "strength": strength,
        "protocol": protocol.name,
        "noise": {"sd": noise.sd, "rho": noise.rho, "quantum": noise.quantum, "uneven": noise.uneven},
        "seed": seed,
        "expected": _expected(faults, families, strength, bool(families) and material == "ogden", all(asked)),
    }
    return Dataset(
        path.time,
        1e3 * path.deflection,
        force,
        clean,
        unspoilt if null is None else null,
        covariance,
        truth,
        path,
        law,
        at_work,
    )


def _fault(name: str, law: Film, path: Path, projector: Projector, strength: float, rng: np.random.Generator) -> Active:
    d = DISTORTIONS[name]
    sign, form, details = d.draw(rng)
    if name == "gain":
        return Active(sign * GAIN * strength, form, details)
    unspoilt = response(law, path, {})

    def snr(size: float) -> float:
        return float(
            np.linalg.norm(projector(response(law, path, {name: Active(sign * size, form, details)}) - unspoilt))
        )

    return Active(sign * sized(snr, FULL_SNR * strength, 3 * d.probe, d.largest), form, details)


def _own(law: Film, path: Path, projector: Projector, at_work: dict[str, Active]) -> dict[str, float]:
    """Of each effect, the ratio left when the other effects' signatures are absorbed too."""
    clean = response(law, path, {})
    left = {n: projector(response(law, path, {n: a}) - clean) for n, a in at_work.items()}
    out = {}
    for name, x in left.items():
        others = [v for k, v in left.items() if k != name and np.linalg.norm(v) > 0]
        if others:
            q = np.linalg.qr(np.stack(others, axis=1))[0]
            x = x - q @ (q.T @ x)
        out[name] = float(np.linalg.norm(x))
    return out


def _foreign(
    declared: str,
    family: str,
    path: Path,
    rig: tuple[float, float, float],
    covariance: Array,
    target: float | None,
    rng: np.random.Generator,
) -> tuple[Array, Array, float]:
    """(parameters of ``family``, (N,) N of ``declared`` at its best, ratio of what that leaves).

    Without a target the parameters are as drawn.
    """
    drawn = FAMILIES[family].draw(rng)
    if target == 0:
        raise ValueError("a wrong family of strength 0 is a null: ask for kind 'null'")
    start = FAMILIES[declared].draw(rng)
    fits: dict[float, tuple[Array, Array]] = {}

    def residual(a: float) -> float:
        nonlocal start
        p = FAMILIES[family].toward_neo_hookean(drawn, a)
        law = film(family, tuple(float(v) for v in p), *rig)
        fits[a] = best_fit(declared, start, rig, path.deflection, law.force(path.deflection), covariance)
        start = fits[a][0]
        return float(np.linalg.norm(fits[a][1]))

    if target is None:
        size = 1.0
        residual(size)
    else:
        size = sized(residual, target, 0.3, STRONGEST_FAMILY, 0.02, 8)
    if size not in fits:
        raise NoSolutionError(f"no film of the family {family} could be solved")
    p, r = fits[size]
    best = film(declared, tuple(float(v) for v in p), *rig).force(path.deflection)
    return FAMILIES[family].toward_neo_hookean(drawn, size), best, float(np.linalg.norm(r))


def _typical(family: str) -> Array:
    return FAMILIES[family].draw(np.random.default_rng(0))


def _expected(faults: list[str], families: list[str], strength: float, flexible: bool, reached: bool) -> list[str]:
    """The verdicts that are right, of those that `diagnose` gives.

    "adequate" is among them where the trace is weaker than was asked for, or where the declared family is so
    ``flexible`` (six parameters) that the best fit here may be missed, and the ratio is then only a bound from above.
    """
    spoilt = [f for f in faults if f != "gain"]
    if (strength == 0 and not families) or not (spoilt or families):
        return ["adequate"]
    weak = ["adequate"] if flexible or not reached else []
    if families:
        return ["material", "unknown", *weak]
    return [*(("named", "ambiguous") if all(f in LIBRARY for f in spoilt) else ("unknown",)), *weak]
