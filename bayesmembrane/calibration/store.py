"""The files of a run: written whole or not at all, and never over anything else."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import arviz
import numpy as np
import tomli_w

from bayesmembrane.calibration.sampling.walk import Chains, Settings
from bayesmembrane.data.measurement import Measurement, Provenance, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import component
from bayesmembrane.physics.hypothesis import Hypothesis

ASKED, POSTERIOR, STATUS, CHAINS = "run.toml", "posterior.nc", "status.json", "chains.npz"
PACKAGES = ("bayesmembrane", "numpy", "scipy", "numba", "emcee", "arviz")
MOTION = ("deflection", "time", "across")
OPTIONAL = ("time", "force_sd", "covariance", "across")
# What the answer of a run depends on; reports and the command line are not among it.
FLOORS = ("ground", "data", "physics", "calibration")


# ---- what was asked --------------------------------------------------------------------------------------------------


def describe(measurement: Measurement, hypothesis: Hypothesis, settings: Settings, seed: int) -> dict[str, Any]:
    """The content of run.toml; ``fingerprint`` covers all that the draws depend on."""
    chosen = {k: v for k, v in asdict(settings).items() if v is not None}
    asked: dict[str, Any] = {
        "seed": seed,
        "hypothesis": hypothesis.settings(),
        "sampling": chosen,
        "data": {"sha256": measurement.data_hash},
        "code": {"sha256": _code()},
    }
    fingerprint = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()
    asked["fingerprint"] = fingerprint
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


@cache
def _code() -> str:
    """SHA-256 of the source that a run depends on."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for floor in FLOORS:
        path = root / floor
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.read_bytes())
    return digest.hexdigest()


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
            _write(folder / ASKED, lambda path: path.write_text(tomli_w.dumps(asked), encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "run.toml is damaged"
        raise StorageError(f"the run cannot be stored there ({reason})", str(folder), "choose another folder") from None
    return folder


def write_run(folder: Path, asked: dict[str, Any], data: Any, status: dict[str, Any], chains: Chains | None) -> None:
    """Write what came out, status last; chains only if the run is to be continued.

    Raises `StorageError` if that fails; every file is then as it was before, or complete.
    """
    try:
        _write(folder / ASKED, lambda path: path.write_text(tomli_w.dumps(asked), encoding="utf-8"))
        _write(folder / POSTERIOR, lambda path: data.to_netcdf(str(path), engine="h5netcdf"))
        if chains is not None:
            _write(folder / CHAINS, lambda path: _save_chains(path, chains))
        text = json.dumps(_plain(status), indent=1, allow_nan=False)
        _write(folder / STATUS, lambda path: path.write_text(text, encoding="utf-8"))
        if chains is None:
            (folder / CHAINS).unlink(missing_ok=True)
    except OSError as error:
        raise StorageError(f"the run cannot be stored ({error.strerror or error})", str(folder)) from None


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


def _write(path: Path, writer: Callable[[Path], Any]) -> None:
    """Let ``writer`` fill a file beside ``path``, then rename it."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    try:
        writer(Path(temporary))
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _plain(value: Any) -> Any:
    """JSON has no nan and no infinity: they become null."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


# ---- chains of an interrupted run ------------------------------------------------------------------------------------


def _save_chains(path: Path, chains: Chains) -> None:
    states: dict[str, Any] = {}
    for e, (_, key, position, has_gauss, gauss) in enumerate(chains.random_states):
        states |= {f"key{e}": key, f"rest{e}": np.array([position, has_gauss, gauss])}
    with path.open("wb") as file:
        np.savez(
            file,
            x=chains.x,
            log_posterior=chains.log_posterior,
            counts=np.array(json.dumps(chains.counts)),
            seconds=np.array(chains.seconds),
            lessons=np.array(chains.lessons, dtype=int),
            **states,
        )


def read_chains(folder: Path) -> Chains | None:
    """Where an interrupted run stands, None if it is not one; raises `StorageError` if the file is damaged."""
    path = folder / CHAINS
    if not path.exists():
        return None
    try:
        with np.load(path) as f:
            states = tuple(
                ("MT19937", f[f"key{e}"], int(rest[0]), int(rest[1]), float(rest[2]))
                for e, rest in ((e, f[f"rest{e}"]) for e in range(len(f["x"])))
            )
            counts = Counter(json.loads(str(f["counts"])))
            lessons = tuple(int(s) for s in f["lessons"])
            return Chains(f["x"], f["log_posterior"], states, counts, float(f["seconds"]), lessons)
    except (OSError, ValueError, KeyError) as error:
        raise StorageError(
            f"the chains are damaged ({error})", str(path), "remove the folder and sample again"
        ) from None


# ---- InferenceData ---------------------------------------------------------------------------------------------------


def inference_data(measurement: Measurement, walk: Mapping[str, Array] | None = None, **groups: Any) -> Any:
    """arviz InferenceData with ``groups``, the measured curve, all that `measurement_of` needs, and a ``walk``.

    walk : ``ensemble_mean`` (E, T, k) means over the walkers at the steps ``ensemble_step`` (T,)
    """
    constant = {"deflection": measurement.deflection, **(walk or {})}
    for name in OPTIONAL:
        values = getattr(measurement, name)
        if values is not None:
            constant[name] = values
    if measurement.motion is not None:
        motion = {n: getattr(measurement.motion, n) for n in MOTION}
        constant |= {f"motion_{n}": v for n, v in motion.items() if v is not None}
        constant["places"] = measurement.on_path.astype(float)
    dims = {n: ["point"] for n in ("force", "curve", "deflection", "time", "force_sd", "across", "places")}
    dims |= {f"motion_{n}": ["station"] for n in MOTION}
    dims |= {"ensemble_mean": ["ensemble", "step", "coordinate"], "ensemble_step": ["step"]}
    data = arviz.from_dict(
        **groups,
        observed_data={"force": measurement.force},
        constant_data=constant,
        dims={**dims, "covariance": ["point", "point_2"]},
    )
    p = measurement.provenance
    about = {
        "rig": {"kind": measurement.rig.name, "lengths": measurement.rig.lengths},
        "specimen": {"name": measurement.specimen.name, "thickness": measurement.specimen.thickness},
        "provenance": {**asdict(p), "notes": list(p.notes)},
        "full_range": measurement.full_range,
    }
    data.constant_data.attrs["measurement"] = json.dumps(about)
    return data


def measurement_of(data: Any) -> Measurement:
    """The measurement that `inference_data` stored."""
    about = json.loads(data.constant_data.attrs["measurement"])
    rig = component("rigs", about["rig"]["kind"])(**about["rig"]["lengths"])
    held = data.constant_data.data_vars

    def array(name: str) -> Array:
        return np.asarray(held[name].values, dtype=float)

    arrays = {name: array(name) for name in ("deflection", *OPTIONAL) if name in held}
    motion = {n: array(f"motion_{n}") for n in MOTION if f"motion_{n}" in held}
    places = array("places").astype(int) if motion else None
    whole = (motion["deflection"], motion.get("time"), about["full_range"], motion.get("across")) if motion else None
    if "covariance" in arrays:
        arrays.pop("force_sd", None)
    notes = {**about["provenance"], "notes": tuple(about["provenance"]["notes"])}
    return Measurement(
        force=np.asarray(data.observed_data["force"].values, dtype=float),
        rig=rig,
        specimen=Specimen(**about["specimen"]),
        provenance=Provenance(**notes),
        full_range=about["full_range"],
        motion=None if whole is None else Motion(*whole),
        places=places,
        **arrays,
    )
