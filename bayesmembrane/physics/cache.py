"""A cache in front of the solver: same call, same answer, and films that differ in modulus alone are solved once."""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.curve_shelf import CurveShelf, DamagedError, Entry
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.request import Request, Spared
from bayesmembrane.physics.mechanics.solution import Curves

# Powers of (G d, R1) that each field of `Curves` carries; the others are pure numbers.
POWERS = {"deflection": (0, 1), "force": (1, 1), "slope": (1, 0), "energy": (1, 2)}
MOST_IN_MEMORY = 2048
# Batches beyond this of a material with shape parameters are draws that never repeat.
SMALL_BATCH = 4


@dataclass
class Tally:
    """What the cache did.

    hits, from_disk : films found, and entries read from disk for them
    misses, bypassed, rebuilt : films solved and kept, films solved directly, entries found damaged
    spared : calls that needed no solution at all
    """

    hits: int = 0
    from_disk: int = 0
    misses: int = 0
    bypassed: int = 0
    rebuilt: int = 0
    spared: int = 0
    seconds_looking: float = 0.0
    seconds_solving: float = 0.0

    @property
    def seconds_saved(self) -> float:
        """At least: spared calls times the mean time that one film took, less the time spent looking.

        Not hits times that time: films of one call would have been solved side by side. The first film of a process
        includes the loading of compiled code.
        """
        cost = self.seconds_solving / self.misses if self.misses else 0.0
        return self.spared * cost - self.seconds_looking

    def since(self, earlier: Tally) -> Tally:
        """What was done after ``earlier``, a copy of this tally."""
        return Tally(**{f.name: getattr(self, f.name) - getattr(earlier, f.name) for f in fields(self)})

    def summary(self) -> dict[str, float]:
        """Plain values, the time saved among them."""
        return {**asdict(self), "seconds_saved": self.seconds_saved}


@dataclass
class CachedSolver:
    """``solve`` of `mechanics` with a memory.

    The key of a film is what its physics depends on: the strain energy, parameters over G d, R2/R1, pre-stretch,
    deflections over R1; and the texts of material and solvers, so that a stored curve is never older than they are.
    So a change of modulus, thickness or size alone is a hit, rescaled by
        F = G d R1 Phi(delta/R1; R2/R1, l0, parameter ratios).
    Parameters and deflections that agree to 12 digits count as equal.

    Large batches of a material with shape parameters go straight to the solver, since their draws never repeat; the
    tally says how many. ``folder`` (None: memory only) keeps the entries of small batches on disk, in one file that
    several processes share (`curve_shelf`); what cannot be read there is solved again.
    """

    folder: Path | None = None
    tally: Tally = field(default_factory=Tally)
    _memory: OrderedDict[bytes, Entry] = field(default_factory=OrderedDict)

    def __call__(self, asked: Request) -> Curves:
        """As `mechanics.solve`; raises what that raises, and `StorageError` if the folder cannot be written."""
        material = asked.material
        gd = np.broadcast_to(np.asarray(material.shear_modulus(asked.parameters.T), float), asked.prestretch.shape)
        shapes = len(material.field_names()) > 1
        if (shapes and gd.size > SMALL_BATCH) or not np.all(gd > 0):
            self.tally.bypassed += gd.size
            return api.solve(asked)
        begun = time.perf_counter()
        asked = replace(asked, spare=Spared.NONE, read=None)  # what is kept serves everybody
        keys = _keys(asked, gd)
        entries = {key: self._find(key) for key in dict.fromkeys(keys)}
        missing = [key for key, entry in entries.items() if entry is None]
        looked = time.perf_counter()
        solved = {key: self._solve(asked, keys.index(key), gd, key) for key in missing}
        done = time.perf_counter()
        found = {key: entry for key, entry in entries.items() if entry is not None} | solved
        place = {key: i for i, key in enumerate(found)}
        curves = _rescale(asked, gd, list(found.values()), [place[key] for key in keys])
        self.tally.misses += len(missing)
        self.tally.hits += len(keys) - len(missing)
        self.tally.spared += not missing
        self.tally.seconds_looking += looked - begun + time.perf_counter() - done
        self.tally.seconds_solving += done - looked
        return curves

    def _solve(self, asked: Request, film: int, gd: Array, key: bytes) -> Entry:
        one, unit = asked.of(slice(film, film + 1)), float(gd[film])
        if len(asked.material.field_names()) == 1:
            # Such films are all one: solved at the modulus one, it does not tell who asked first, and runs that share a
            # folder answer alike, whichever of them came first. Others repeat only as they were.
            one, unit = replace(one, parameters=_over_modulus(one, gd[film : film + 1])), 1.0
        entry = _scaled(api.solve(one), one, unit)
        self._keep(key, entry)
        self._write(key, entry)
        return entry

    def _find(self, key: bytes) -> Entry | None:
        if key in self._memory:
            self._memory.move_to_end(key)
            return self._memory[key]
        entry = self._read(key)
        if entry is not None:
            self.tally.from_disk += 1
            self._keep(key, entry)
        return entry

    def _keep(self, key: bytes, entry: Entry) -> None:
        self._memory[key] = entry
        if len(self._memory) > MOST_IN_MEMORY:
            self._memory.popitem(last=False)

    def _read(self, key: bytes) -> Entry | None:
        if self.folder is None:
            return None
        try:
            entry = CurveShelf(self.folder).read(key)
        except DamagedError:
            entry = None
            self.tally.rebuilt += 1
        return entry if entry is not None and entry.keys() >= _FIELDS else None

    def _write(self, key: bytes, entry: Entry) -> None:
        if self.folder is None:
            return
        try:
            CurveShelf(self.folder).write(key, entry)
        except DamagedError:
            self.tally.rebuilt += 1
            CurveShelf(self.folder).write(key, entry)


_FIELDS = {f.name for f in fields(Curves)} - {"deflection", "sensitivity"}


def _keys(asked: Request, gd: Array) -> list[bytes]:
    """One key per film: a header, then the scaled numbers rounded to 40 bits."""
    scaled = _over_modulus(asked, gd)
    ratio = np.full((gd.size, 1), asked.ratio)
    numbers = np.hstack([ratio, asked.prestretch[:, None], scaled, asked.deflection / asked.inner_radius])
    mantissa, exponent = np.frexp(numbers)
    numbers = np.ascontiguousarray(np.ldexp(np.round(mantissa * 2.0**40), exponent - 40) + 0.0)
    header = f"{_source(asked.material)} {asked.solver} {asked.sensitivities} ".encode()
    return [header + row.tobytes() for row in numbers]


def _over_modulus(asked: Request, gd: Array) -> Array:
    """(B, n) parameters over G d, those that are pure numbers as they are."""
    scales = np.asarray(asked.material.scales) == 1
    return np.where(scales, asked.parameters / gd[:, None], asked.parameters)


@cache
def _source(material: type[Material]) -> str:
    """Name of the material, and a hash of its text and those of the solvers."""
    texts = [material.source_text().encode()]
    texts += [path.read_bytes() for path in sorted(Path(api.__file__).parent.rglob("*.py"))]
    return f"{material.name} {hashlib.sha256(b''.join(texts)).hexdigest()[:16]}"


def _factor(name: str, asked: Request, gd: Array) -> Array:
    stiffness, length = POWERS.get(name, (0, 0))
    return np.asarray(gd[:, None] ** stiffness * asked.inner_radius**length)


def _field_factor(asked: Request, gd: Array) -> Array:
    """dF/dp_i in units of R1 for moduli, of G d R1 for pure numbers: shape (B, 1, n)."""
    scales = np.asarray(asked.material.scales) == 1
    return np.where(scales, 1.0, gd[:, None])[:, None, :] * asked.inner_radius


def _scaled(curves: Curves, asked: Request, gd: float) -> Entry:
    unit = np.array([gd])
    entry = {name: np.asarray(getattr(curves, name) / _factor(name, asked, unit))[0] for name in _FIELDS}
    if curves.sensitivity is not None:
        entry["sensitivity"] = (curves.sensitivity / _field_factor(asked, unit))[0]
    return entry


def _rescale(asked: Request, gd: Array, entries: list[Entry], place: list[int]) -> Curves:
    """Curves of films with scaled entries[place[i]], i = 0..B-1."""

    def films(name: str) -> Array:
        return np.stack([entry[name] for entry in entries])[place]

    values: dict[str, Any] = {name: films(name) * _factor(name, asked, gd) for name in _FIELDS}
    for name in ("status", "note"):
        values[name] = values[name].astype(np.int8)
    sensitivity = films("sensitivity") * _field_factor(asked, gd) if "sensitivity" in entries[0] else None
    return Curves(deflection=asked.deflection, sensitivity=sensitivity, **values)
