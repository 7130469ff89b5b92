"""The files of a run: written whole or not at all, and never over anything else."""

from __future__ import annotations

import json
import platform
import re
import tomllib
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from bayesmembrane.calibration.fingerprint import SAMPLING, code_of
from bayesmembrane.calibration.sampling.chains import Chains, write_chains
from bayesmembrane.calibration.sampling.walk import Settings
from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_text, write_whole
from bayesmembrane.ground.fingerprint import digest
from bayesmembrane.ground.plain import json_text
from bayesmembrane.ground.quiet import arviz
from bayesmembrane.physics.hypothesis import Hypothesis

ASKED, POSTERIOR, STATUS, CHAINS = "run.toml", "posterior.nc", "status.json", "chains.npz"
PACKAGES = ("bayesmembrane", "numpy", "scipy", "numba", "emcee", "arviz")


# ---- what was asked --------------------------------------------------------------------------------------------------


def describe(measurement: Measurement, hypothesis: Hypothesis, settings: Settings, seed: int) -> dict[str, Any]:
    """The content of run.toml; ``fingerprint`` covers all that the draws depend on."""
    chosen = {k: v for k, v in asdict(settings).items() if v is not None}
    asked: dict[str, Any] = {
        "seed": seed,
        "hypothesis": hypothesis.settings(),
        "sampling": chosen,
        "data": {"sha256": measurement.data_hash},
        "code": {"sha256": code_of(SAMPLING, [hypothesis], [measurement])},
    }
    asked["fingerprint"] = digest(asked)
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
        return version(package)
    except PackageNotFoundError:
        return "unknown"


# ---- folder ----------------------------------------------------------------------------------------------------------


def claim(folder: Path, asked: dict[str, Any]) -> Path:
    """Make ``folder`` for this run, or find it there with the same fingerprint.

    Raises `StorageError` if it cannot be written, or holds something else.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        content = {p.name for p in folder.iterdir()}
        if ASKED in content:
            held = tomllib.loads((folder / ASKED).read_text(encoding="utf-8")).get("fingerprint")
            if held != asked["fingerprint"]:
                raise StorageError("the folder holds another run", str(folder), "choose another name or folder")
        elif content:
            raise StorageError("the folder holds files that are no run", str(folder), "choose another name or folder")
        else:
            write_text(folder / ASKED, tomli_w.dumps(asked), "the run")
    except (OSError, tomllib.TOMLDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "run.toml is damaged"
        raise StorageError(f"the run cannot be stored there ({reason})", str(folder), "choose another folder") from None
    return folder


def is_finished(folder: Path) -> bool:
    """Whether a folder holds a run that came to its end, and no walk to be continued."""
    return (folder / STATUS).exists() and not (folder / CHAINS).exists()


def write_run(folder: Path, asked: dict[str, Any], data: Any, status: dict[str, Any], chains: Chains | None) -> None:
    """Write what came out, status last; chains only if the run is to be continued.

    Raises `StorageError` if that fails; every file is then as it was before, or complete.
    """
    write_text(folder / ASKED, tomli_w.dumps(asked), "the run")
    write_whole(folder / POSTERIOR, lambda part: data.to_netcdf(str(part), engine="h5netcdf"), "the run")
    if chains is not None:
        write_chains(folder / CHAINS, chains)
    write_text(folder / STATUS, json_text(status, indent=1), "the run")
    if chains is None:
        (folder / CHAINS).unlink(missing_ok=True)


def read_run(folder: Path) -> tuple[dict[str, Any], dict[str, Any], Any]:
    """(run.toml, status.json, InferenceData) of a folder; raises `StorageError` if one is missing or damaged."""
    for name in (ASKED, STATUS, POSTERIOR):
        if not (folder / name).is_file():
            raise StorageError(f"there is no complete run: {name} is missing", str(folder), "sample again")
    try:
        asked = tomllib.loads((folder / ASKED).read_text(encoding="utf-8"))
        status = json.loads((folder / STATUS).read_text(encoding="utf-8"))
        stored = arviz.from_netcdf(str(folder / POSTERIOR), engine="h5netcdf")  # type: ignore[no-untyped-call]
    except (OSError, ValueError, KeyError) as error:
        raise StorageError(f"the run is damaged ({error})", str(folder), "remove the folder and sample again") from None
    return asked, status, stored
