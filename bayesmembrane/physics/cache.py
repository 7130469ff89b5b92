"""A cache in front of the solver: same call, same answer, and films that differ in modulus alone are solved once."""

from __future__ import annotations

import hashlib
import tempfile
import time
import zipfile
from collections import OrderedDict
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.materials.base import Material
from bayesmembrane.physics.mechanics import api
from bayesmembrane.physics.mechanics.problem import Problem, problem
from bayesmembrane.physics.mechanics.solution import Curves

# Powers of (G d, R1) that each field of `Curves` carries; the others are pure numbers.
POWERS = {"deflection": (0, 1), "force": (1, 1), "slope": (1, 0), "energy": (1, 2)}
MOST_IN_MEMORY = 2048
# Batches beyond this of a material with shape parameters are draws that never repeat.
SMALL_BATCH = 4
_DAMAGED = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)

Entry = dict[str, Array]


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
    tally says how many. ``folder`` (None: memory only) keeps the entries of small batches on disk, one file each,
    written under a temporary name and renamed, so that several processes may share it; a file that cannot be read, or
    holds another key, is rebuilt.
    """

    folder: Path | None = None
    tally: Tally = field(default_factory=Tally)
    _memory: OrderedDict[bytes, Entry] = field(default_factory=OrderedDict)

    def __call__(
        self,
        material: type[Material],
        parameters: ArrayLike,
        deflection: ArrayLike,
        *,
        inner_radius: float,
        outer_radius: float,
        prestretch: ArrayLike = 1.0,
        sensitivities: bool = False,
        solver: str = "ritz",
        only: str = "all",
        exact_up_to: float = np.inf,
    ) -> Curves:
        """As `mechanics.solve`; raises what that raises, and `StorageError` if the folder cannot be written."""
        asked = problem(material, parameters, deflection, inner_radius, outer_radius, prestretch)
        gd = np.broadcast_to(np.asarray(material.shear_modulus(asked.parameters.T), float), asked.prestretch.shape)
        shapes = len(material.field_names()) > 1
        if (shapes and gd.size > SMALL_BATCH) or not np.all(gd > 0):
            self.tally.bypassed += gd.size
            return _direct(asked, sensitivities, solver, only, exact_up_to)
        begun = time.perf_counter()
        keys = _keys(asked, gd, sensitivities, solver)
        entries = {key: self._find(key) for key in dict.fromkeys(keys)}
        missing = [key for key, entry in entries.items() if entry is None]
        looked = time.perf_counter()
        solved = {key: self._solve(asked, keys.index(key), gd, sensitivities, solver, key) for key in missing}
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

    def _solve(self, asked: Problem, film: int, gd: Array, sensitivities: bool, solver: str, key: bytes) -> Entry:
        one = replace(
            asked,
            parameters=asked.parameters[film : film + 1],
            deflection=asked.deflection[film : film + 1],
            prestretch=asked.prestretch[film : film + 1],
        )
        entry = _scaled(_direct(one, sensitivities, solver), one, float(gd[film]))
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

    def _path(self, key: bytes) -> Path | None:
        return None if self.folder is None else self.folder / f"{hashlib.sha256(key).hexdigest()[:40]}.npz"

    def _read(self, key: bytes) -> Entry | None:
        path = self._path(key)
        if path is None or not path.exists():
            return None
        try:
            with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
                entry = {name: stored[name] for name in stored.files}
            if entry.pop("key").tobytes() == key and entry.keys() >= _FIELDS:
                return entry
        except _DAMAGED:
            pass
        self.tally.rebuilt += 1
        return None

    def _write(self, key: bytes, entry: Entry) -> None:
        path = self._path(key)
        if path is None:
            return
        part = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
                part = Path(file.name)
                arrays: dict[str, Any] = {"key": np.frombuffer(key, np.uint8), **entry}
                np.savez(file, **arrays)
            part.replace(path)
        except OSError as error:
            if part is not None:
                part.unlink(missing_ok=True)
            raise StorageError(
                f"the curve cache cannot be written ({error.strerror})",
                where=str(path.parent),
                remedy="free some space, make the folder writable, or choose another one with --out",
            ) from None


_FIELDS = {f.name for f in fields(Curves)} - {"deflection", "sensitivity"}


def _direct(asked: Problem, sensitivities: bool, solver: str, only: str = "all", exact_up_to: float = np.inf) -> Curves:
    return api.solve(
        asked.material,
        asked.parameters,
        asked.deflection,
        inner_radius=asked.inner_radius,
        outer_radius=asked.outer_radius,
        prestretch=asked.prestretch,
        sensitivities=sensitivities,
        solver=solver,
        only=only,
        exact_up_to=exact_up_to,
    )


def _keys(asked: Problem, gd: Array, sensitivities: bool, solver: str) -> list[bytes]:
    """One key per film: a header, then the scaled numbers rounded to 40 bits."""
    scales = np.asarray(asked.material.scales) == 1
    scaled = np.where(scales, asked.parameters / gd[:, None], asked.parameters)
    ratio = np.full((gd.size, 1), asked.ratio)
    numbers = np.hstack([ratio, asked.prestretch[:, None], scaled, asked.deflection / asked.inner_radius])
    mantissa, exponent = np.frexp(numbers)
    numbers = np.ascontiguousarray(np.ldexp(np.round(mantissa * 2.0**40), exponent - 40) + 0.0)
    header = f"{_source(asked.material)} {solver} {sensitivities} ".encode()
    return [header + row.tobytes() for row in numbers]


@cache
def _source(material: type[Material]) -> str:
    """Name of the material, and a hash of its text and those of the solvers."""
    texts = [material.source_text().encode()]
    texts += [path.read_bytes() for path in sorted(Path(api.__file__).parent.rglob("*.py"))]
    return f"{material.name} {hashlib.sha256(b''.join(texts)).hexdigest()[:16]}"


def _factor(name: str, asked: Problem, gd: Array) -> Array:
    stiffness, length = POWERS.get(name, (0, 0))
    return np.asarray(gd[:, None] ** stiffness * asked.inner_radius**length)


def _field_factor(asked: Problem, gd: Array) -> Array:
    """dF/dp_i in units of R1 for moduli, of G d R1 for pure numbers: shape (B, 1, n)."""
    scales = np.asarray(asked.material.scales) == 1
    return np.where(scales, 1.0, gd[:, None])[:, None, :] * asked.inner_radius


def _scaled(curves: Curves, asked: Problem, gd: float) -> Entry:
    unit = np.array([gd])
    entry = {name: np.asarray(getattr(curves, name) / _factor(name, asked, unit))[0] for name in _FIELDS}
    if curves.sensitivity is not None:
        entry["sensitivity"] = (curves.sensitivity / _field_factor(asked, unit))[0]
    return entry


def _rescale(asked: Problem, gd: Array, entries: list[Entry], place: list[int]) -> Curves:
    """Curves of films with scaled entries[place[i]], i = 0..B-1."""

    def films(name: str) -> Array:
        return np.stack([entry[name] for entry in entries])[place]

    values: dict[str, Any] = {name: films(name) * _factor(name, asked, gd) for name in _FIELDS}
    for name in ("status", "note"):
        values[name] = values[name].astype(np.int8)
    sensitivity = films("sensitivity") * _field_factor(asked, gd) if "sensitivity" in entries[0] else None
    return Curves(deflection=asked.deflection, sensitivity=sensitivity, **values)
