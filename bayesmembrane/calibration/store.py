"""The files of a run: written whole or not at all, sealed with checksums, and never over anything else."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.fingerprint import SAMPLING, code_of
from bayesmembrane.calibration.layout import Groups
from bayesmembrane.calibration.sampling.segments import FOLDER, LOCK, Segments
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import make_folder, remove_parts, unwritable, write_whole
from bayesmembrane.ground.fingerprint import digest, installed
from bayesmembrane.ground.locks import alone
from bayesmembrane.ground.netcdf import packed, unpacked
from bayesmembrane.ground.sealed import (
    checked,
    damaged,
    is_sealed,
    read_json,
    read_toml,
    sealed,
    write_json,
    write_toml,
)
from bayesmembrane.physics.hypothesis import Hypothesis

ASKED, POSTERIOR, STATUS = "run.toml", "posterior.nc", "status.json"
HOW_LONG = ("ess", "most_steps")
"""What of the settings decides where a walk ends, and not how it goes."""
PACKAGES = ("bayesmembrane", "numpy", "scipy", "numba", "emcee", "arviz")


# ---- what was asked --------------------------------------------------------------------------------------------------


def describe(
    measurement: Measurement,
    hypothesis: Hypothesis,
    settings: Settings,
    seed: int,
    forked: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The content of run.toml; ``fingerprint`` covers all that the draws depend on.

    ``walk`` covers the same but for how long it is: runs that agree in it walk the same way, one further than the
    other. ``forked`` says at the end of which run this one begins.
    """
    chosen = {k: v for k, v in asdict(settings).items() if v is not None}
    asked: dict[str, Any] = {
        "seed": seed,
        "hypothesis": hypothesis.settings(),
        "sampling": chosen,
        "data": {"sha256": measurement.data_hash},
        "code": {"sha256": code_of(SAMPLING, [hypothesis], [measurement])},
    }
    if forked is not None:
        asked["forked"] = dict(forked)
    fingerprint = digest(asked)
    walk = digest({**asked, "sampling": {k: v for k, v in chosen.items() if k not in HOW_LONG}})
    asked |= {"fingerprint": fingerprint, "walk": walk}
    asked["data"] |= {
        "specimen": measurement.specimen.name,
        "points": len(measurement),
        "max_deflection_mm": 1e3 * float(np.max(measurement.deflection)),
        "full_range_mm": 1e3 * measurement.full_range,
        "curve": measurement.provenance.curve,
        "origin": measurement.provenance.origin,
    }
    asked["versions"] = {"python": platform.python_version(), **{p: _version(p) for p in PACKAGES}}
    return asked


def run_name(measurement: Measurement, hypothesis: Hypothesis, asked: dict[str, Any]) -> str:
    """Specimen, hypothesis, range and fingerprint in one word: ``film-1_yeoh_35.1mm_3f2a9c41``."""
    specimen = re.sub(r"[^a-z0-9]+", "-", measurement.specimen.name.lower()).strip("-")[:40] or "film"
    reach = 1e3 * float(np.max(measurement.deflection))
    return f"{specimen}_{hypothesis.label()}_{reach:.4g}mm_{asked['fingerprint'][:8]}"


def _version(package: str) -> str:
    try:
        return installed(package)
    except PackageNotFoundError:
        return "unknown"


# ---- folder ----------------------------------------------------------------------------------------------------------


@contextmanager
def claimed(folder: Path, asked: dict[str, Any]) -> Iterator[Segments]:
    """Have ``folder`` for this run, and nobody else meanwhile; what was walked there of the same walk may be continued.

    Raises `StorageError` if it cannot be written, holds something else, or another process is at it.
    """
    try:
        make_folder(folder)
        foreign = not (folder / ASKED).exists() and {p.name for p in folder.iterdir() if p.name[0] != "."} - {FOLDER}
    except OSError as error:
        reason = error.strerror or str(error)
        raise StorageError(f"the run cannot be stored there ({reason})", str(folder), "choose another folder") from None
    if foreign:
        raise StorageError("the folder holds files that are no run", str(folder), "choose another name or folder")
    with alone(folder / FOLDER / LOCK, "this run"):
        segments = Segments(folder, asked["walk"])
        _check_held(folder, asked, segments)
        try:
            segments.clean()
            for name in (ASKED, POSTERIOR, STATUS):
                remove_parts(folder, name)
        except OSError as error:
            raise unwritable("the run", folder, error) from None
        write_toml(folder / ASKED, asked, "the run")
        yield segments


def _check_held(folder: Path, asked: dict[str, Any], segments: Segments) -> None:
    """Raise `StorageError` unless what lies in ``folder`` may become, or go on as, what is ``asked``."""
    held: dict[str, Any] | None = None
    if (folder / ASKED).exists():
        try:
            held = read_asked(folder)
        except StorageError as fault:
            # What was walked says itself whose it is: then nothing is lost with this file.
            if not segments.paths or not segments.same_walk():
                raise fault from None
    same = segments.same_walk() if held is None else held.get("walk") == asked["walk"]
    if not same:
        told = "" if held is None else f": {'; '.join(differences(held, asked)) or 'another walk'}"
        raise StorageError(f"the folder holds another run{told}", str(folder), _other(folder))
    if held is not None and segments.paths and held.get("versions") != asked["versions"]:
        told = "; ".join(_unlike("versions", held.get("versions"), asked["versions"]))
        raise StorageError(
            f"the run was begun with other versions and would not go on alike: {told}", str(folder), _other(folder)
        )


def read_asked(folder: Path) -> dict[str, Any]:
    """What stands in run.toml; raises `StorageError` if it is damaged."""
    held = read_toml(folder / ASKED, "the run")
    if "fingerprint" not in held:
        raise damaged(folder / ASKED, "the run", "it does not say which run this is")
    return held


def _other(folder: Path) -> str:
    return f"choose another name or folder, or start a new run at its end with --fork {folder}"


def differences(held: Mapping[str, Any], asked: Mapping[str, Any]) -> list[str]:
    """In what two contents of run.toml differ that decides how a run walks: "seed 1 there, 2 asked", one by one."""
    parts = ("seed", "hypothesis", "sampling", "data", "code", "forked")
    return [told for part in parts for told in _unlike(part, held.get(part), asked.get(part))]


def _unlike(name: str, held: Any, asked: Any) -> list[str]:
    if isinstance(held, Mapping) and isinstance(asked, Mapping):
        keys = [k for k in dict.fromkeys([*held, *asked]) if name != "sampling" or k not in HOW_LONG]
        keys = ["sha256"] if "sha256" in keys else keys
        return [told for k in keys for told in _unlike(f"{name}.{k}", held.get(k), asked.get(k))]
    return [] if held == asked else [f"{name} {_short(held)} there, {_short(asked)} asked"]


def _short(value: Any) -> str:
    text = "none" if value is None else str(value)
    return f"{text[:12]}..." if re.fullmatch("[0-9a-f]{64}", text) else text[:60]


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a run that came to its end, and whose numbers are whole."""
    try:
        status = read_json(folder / STATUS, STATUS)
        whole = status.get("posterior_sha256") in (None, checked(folder / POSTERIOR, POSTERIOR))
        # The last is what earlier versions left of a run that was to go on.
        return whole and status.get("status") != "interrupted" and not (folder / "chains.npz").exists()
    except StorageError:
        return False


def serves(folder: Path, asked: Mapping[str, Any]) -> bool:
    """Whether a finished run of the same walk lies in ``folder``, and goes as far as is ``asked``, or can."""
    try:
        if read_asked(folder).get("walk") != asked["walk"] or not is_finished(folder):
            return False
        status, wanted = read_json(folder / STATUS, STATUS), asked["sampling"]
        if status["status"] == "step limit":
            return bool(status["steps"] >= wanted["most_steps"])
        return bool(status["ess_wanted"] >= wanted["ess"])
    except (StorageError, KeyError, TypeError):
        return False


def shorter(folder: Path, asked: Mapping[str, Any]) -> Path | None:
    """The longest finished run beside ``folder`` that walks the same way as is ``asked``; None if there is none."""
    if not folder.parent.is_dir():
        return None
    stem = folder.name.rpartition("_")[0]
    beside = [p for p in folder.parent.iterdir() if p != folder and p.name.startswith(stem)]
    found = [p for p in beside if (p / ASKED).is_file() and _walks(p) == asked["walk"] and is_finished(p)]
    return max(found, key=lambda p: len(Segments(p).paths), default=None)


def _walks(folder: Path) -> Any:
    try:
        return read_asked(folder).get("walk")
    except StorageError:
        return None


def write_run(folder: Path, data: Groups, status: dict[str, Any]) -> None:
    """Write what came out, status last; raises `StorageError` if that fails.

    Every file is then as it was before, or complete; a status beside draws that it does not belong to is told by
    `read_run`, and is written again when the run goes on.
    """
    content, found = sealed(packed(data))
    write_whole(folder / POSTERIOR, lambda part: part.write_bytes(content), "the run")
    write_json(folder / STATUS, {"posterior_sha256": found, **status}, "the run")


def read_run(folder: Path) -> tuple[dict[str, Any], dict[str, Any], Groups]:
    """(run.toml, status.json, groups) of a folder; raises `StorageError` if one is missing or damaged."""
    for name in (ASKED, STATUS, POSTERIOR):
        if not (folder / name).is_file():
            raise StorageError(f"there is no complete run: {name} is missing", str(folder), "sample again")
    asked, status = read_asked(folder), read_json(folder / STATUS, "the run")
    for name in (n for n in (ASKED, STATUS) if not is_sealed(folder / n)):
        if is_sealed(folder / (STATUS if name == ASKED else ASKED)):
            raise damaged(folder / name, "the run", "its checksum is gone")
    found, belongs = checked(folder / POSTERIOR, "the run"), status.pop("posterior_sha256", None)
    if belongs is not None and belongs != found:
        raise damaged(folder / POSTERIOR, "the run", f"it does not belong to {STATUS}")
    try:
        stored = Groups(unpacked(folder / POSTERIOR))
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, AttributeError) as error:
        raise damaged(folder / POSTERIOR, "the run", type(error).__name__) from None
    return asked, status, stored
