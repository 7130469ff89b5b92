"""Synthetic measurements with a known fault in them: `generate` draws one, deterministic by its seed.

Nothing here knows the package under test: film, energies, faults and noise are written anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any
from zlib import crc32

import numpy as np

from tests.generator.distortions import DISTORTIONS, LIBRARY, USUAL, Active, Scale, response
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
USUAL_REACH, USUAL_FORCE = 0.040, 2.5  # m and N: the test for which the sizes of faults are meant


@dataclass(frozen=True)
class Bench:
    """Rig and film: inner and outer radius, thickness (m). Another one than the usual scales the sizes of faults."""

    inner: float = INNER
    outer: float = OUTER
    thickness: float = THICKNESS

    def margin(self, path: Path) -> float:
        """m of deflection that the film's law is made to hold beyond the largest."""
        return MARGIN if self == Bench() else MARGIN / USUAL_REACH * path.largest

    def scale(self, film_: Film, path: Path) -> Scale:
        """By which lengths and forces of this test are larger than the usual ones."""
        if self == Bench():
            return USUAL
        top = float(film_.force(np.array([path.largest]))[0])
        return Scale(path.largest / USUAL_REACH, top / USUAL_FORCE)


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
    bench: Bench = Bench()

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
            f"thickness_um = {1e6 * self.bench.thickness:.6g}\n\n"
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
        others = rivals(self.film, self.path, self.projector, self.bench.scale(self.film, self.path))
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
        start = np.array([self.truth["parameters"][n] for n in names]) if same else self._typical(declared)
        rig = (self.film.inner, self.film.outer, self.film.reach)
        return float(
            np.linalg.norm(best_fit(declared, start, rig, self.path.deflection, self.clean_N, self.covariance)[1])
        )

    def _typical(self, family: str) -> Array:
        return drawn(family, self.bench, np.random.default_rng(0))

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
    strength: float | Sequence[float] = 1.0,
    seed: int = 0,
    bench: Bench = Bench(),
) -> Dataset:
    """A measurement of a film declared as ``material`` with a fault of ``kind``.

    ``kind``: "null", a name of `DISTORTIONS`, several joined by "+"; "family:NAME" for a film that is not of the
    declared family, and so far from it that its ratio is the one asked for; "typical:NAME" for a film of that family
    as they come, however far (either may be joined too). ``strength`` times 20 is the signal-to-noise ratio of each
    projected signature by itself; several are one for each name. ``noise``: words of `Noise.named`. One seed gives one
    material, one path, one noise and one set of details, whatever the strength.
    """
    noise = Noise.named(noise) if isinstance(noise, str) else noise
    protocol = PROTOCOLS[protocol] if isinstance(protocol, str) else protocol
    material_rng, path_rng, noise_rng = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    path = sample(protocol, path_rng, noise.uneven)
    rig = (bench.inner, bench.outer, path.largest + bench.margin(path))
    names = [] if kind == "null" else kind.split("+")
    families = [n for n in names if ":" in n]
    faults = [n for n in names if ":" not in n]
    strengths = dict(zip(names, np.broadcast_to(np.asarray(strength, dtype=float), len(names)), strict=True))
    targets = {n: FULL_SNR * float(s) for n, s in strengths.items()}

    parameters = drawn(material, bench, material_rng)
    true_family, null, snr = material, None, {}
    if families:
        manner, true_family = families[0].split(":")
        parameters = drawn(true_family, bench, material_rng)
    if noise.relative:
        law = film(true_family, tuple(float(v) for v in parameters), *rig)
        noise = noise.at(float(law.force(np.array([path.largest]))[0]))
    covariance = noise.covariance(path.deflection)
    if families:
        start = drawn(material, bench, material_rng)
        wanted = {"family": targets[families[0]], "typical": None}[manner]
        parameters, null, snr[families[0]] = _foreign(
            (material, start), (true_family, parameters), path, rig, covariance, wanted
        )
    law = film(true_family, tuple(float(v) for v in parameters), *rig)
    scale = bench.scale(law, path)
    unspoilt = response(law, path, {})
    projector = Projector(covariance, law.sensitivities(path.deflection))
    at_work: dict[str, Active] = {}
    for name in faults:
        code = crc32(name.encode())
        details_rng = np.random.default_rng([seed, code])
        at_work[name] = _fault(name, law, path, projector, (strengths[name], scale), details_rng)
        snr[name] = float(np.linalg.norm(projector(response(law, path, {name: at_work[name]}) - unspoilt)))
    clean = response(law, path, at_work) if at_work else unspoilt
    force = noise.rounded(clean + noise.draw(noise_rng, path.deflection))
    asked = [
        abs(s / targets[n] - 1) < 0.05
        for n, s in snr.items()
        if n != "gain" and not n.startswith("typical:") and targets[n] > 0
    ]
    single = len(set(strengths.values())) < 2
    each = float(max(strengths.values(), default=float(np.max(strength)))) if single else list(strengths.values())
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
        "target_snr": FULL_SNR * each if isinstance(each, float) else [FULL_SNR * s for s in each],
        "reached": all(asked),
        "strength": each,
        "protocol": protocol.name,
        "noise": {"sd": noise.sd, "rho": noise.rho, "quantum": noise.quantum, "uneven": noise.uneven}
        | ({"grows": noise.grows} if noise.grows else {}),
        "seed": seed,
        "expected": _expected(faults, families, strengths, bool(families) and material == "ogden", all(asked)),
    }
    if bench != Bench():
        truth["bench"] = {"inner": bench.inner, "outer": bench.outer, "thickness": bench.thickness}
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
        bench,
    )


def drawn(family: str, bench: Bench, rng: np.random.Generator) -> Array:
    """Parameters of a film of ``family`` as they come, as thick as the bench says."""
    p = FAMILIES[family].draw(rng)
    return p if bench.thickness == THICKNESS else FAMILIES[family].thicker(p, bench.thickness / THICKNESS)


def _fault(
    name: str, law: Film, path: Path, projector: Projector, size: tuple[float, Scale], rng: np.random.Generator
) -> Active:
    d = DISTORTIONS[name]
    strength, scale = size[0], size[1].of(d.unit)
    sign, form, details = d.draw(rng)
    if name == "gain":
        return Active(sign * GAIN * strength, form, details)
    unspoilt = response(law, path, {})

    def snr(size: float) -> float:
        return float(
            np.linalg.norm(projector(response(law, path, {name: Active(sign * size, form, details)}) - unspoilt))
        )

    return Active(sign * sized(snr, FULL_SNR * strength, 3 * d.probe * scale, d.largest * scale), form, details)


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
    claim: tuple[str, Array],
    true: tuple[str, Array],
    path: Path,
    rig: tuple[float, float, float],
    covariance: Array,
    target: float | None,
) -> tuple[Array, Array, float]:
    """(parameters of the true family, (N,) N of the declared one at its best, ratio of what that leaves).

    Of both the name and parameters as they come; without a target the true ones stay so.
    """
    if target == 0:
        raise ValueError("a wrong family of strength 0 is a null: ask for kind 'null'")
    (declared, start), (family, full) = claim, true
    fits: dict[float, tuple[Array, Array]] = {}

    def residual(a: float) -> float:
        nonlocal start
        p = FAMILIES[family].toward_neo_hookean(full, a)
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
    return FAMILIES[family].toward_neo_hookean(full, size), best, float(np.linalg.norm(r))


def _expected(
    faults: list[str], families: list[str], strengths: Mapping[str, float], flexible: bool, reached: bool
) -> list[str]:
    """The verdicts that are right, of those that `diagnose` gives.

    "adequate" is among them where the trace is weaker than was asked for, or where the declared family is so
    ``flexible`` (six parameters) that the best fit here may be missed, and the ratio is then only a bound from above.
    """
    spoilt = [f for f in faults if f != "gain" and strengths[f] > 0]
    if not (spoilt or families):
        return ["adequate"]
    weak = ["adequate"] if flexible or not reached else []
    if families and spoilt:
        return ["named", "ambiguous", "unknown", *weak]
    if families:
        return ["material", "unknown", *weak]
    return [*(("named", "ambiguous") if all(f in LIBRARY for f in spoilt) else ("unknown",)), *weak]
