"""A run laid out as arviz InferenceData is: the groups and dimensions of its arrays, and the measurement among them.

posterior, prior, log_likelihood, posterior_predictive, observed_data, constant_data (the means of the ensembles over
the whole walk among it), sample_stats; a chain is an ensemble.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from bayesmembrane.data.measurement import Measurement, Provenance, Specimen
from bayesmembrane.data.motion import Motion
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.registry import component

MOTION = ("deflection", "time", "across", "said_leg", "said_cycle")
OPTIONAL = ("time", "force_sd", "covariance", "across", "blank_run")
OF_A_CHAIN = ("chain", "draw")
ONE_FOR_ALL = ("observed_data", "constant_data")
"""Groups whose arrays are not draws."""


class Groups(Mapping[str, Any]):
    """xarray datasets by the names of their groups, which are attributes, too: to import arviz takes a second."""

    def __init__(self, held: Mapping[str, Any]) -> None:
        self._held = dict(held)

    def __getitem__(self, name: str) -> Any:
        return self._held[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._held:
            raise AttributeError(f"there is no group {name!r}")
        return self._held[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._held)

    def __len__(self) -> int:
        return len(self._held)


def laid_out(measurement: Measurement, walk: Mapping[str, Array] | None = None, **groups: Any) -> Groups:
    """``groups`` (None: left out), the measured curve, all that `measurement_of` needs, and a ``walk``.

    groups : arrays by name, (E, draws, ...) each
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
    dims |= {"covariance": ["point", "point_2"], "blank_run": ["blank_point", "blank_column"]}
    groups |= {"observed_data": {"force": measurement.force}, "constant_data": constant}
    data = Groups({name: _dataset(name, arrays, dims) for name, arrays in groups.items() if arrays is not None})
    p = measurement.provenance
    about = {
        "rig": {"kind": measurement.rig.name, "lengths": measurement.rig.lengths},
        "specimen": {"name": measurement.specimen.name, "thickness": measurement.specimen.thickness},
        "provenance": {**asdict(p), "notes": list(p.notes)},
        "full_range": measurement.full_range,
    }
    data.constant_data.attrs["measurement"] = json.dumps(about)
    return data


def _dataset(group: str, arrays: Mapping[str, Array], dims: Mapping[str, list[str]]) -> Any:
    """One group, its dimensions numbered from nought."""
    import xarray  # on demand: a fit needs none of it

    before = () if group in ONE_FOR_ALL else OF_A_CHAIN
    held = {n: ((*before, *dims.get(n, ())), np.atleast_1d(np.asarray(v))) for n, v in arrays.items()}
    sizes = {d: size for along, v in held.values() for d, size in zip(along, v.shape, strict=True)}
    coords = {d: np.arange(size) for d, size in sizes.items()}
    return xarray.Dataset(held, coords, {"creation_library": "bayesmembrane"})


def measurement_of(data: Groups) -> Measurement:
    """The measurement that `laid_out` stored."""
    about = json.loads(data.constant_data.attrs["measurement"])
    rig = component("rigs", about["rig"]["kind"])(**about["rig"]["lengths"])
    held = data.constant_data.data_vars

    def array(name: str) -> Array:
        return np.asarray(held[name].values, dtype=float)

    arrays = {name: array(name) for name in ("deflection", *OPTIONAL) if name in held}
    motion = {n: array(f"motion_{n}") for n in MOTION if f"motion_{n}" in held}
    places = array("places").astype(int) if motion else None
    if "covariance" in arrays:
        arrays.pop("force_sd", None)
    notes = {**about["provenance"], "notes": tuple(about["provenance"]["notes"])}
    return Measurement(
        force=np.asarray(data.observed_data["force"].values, dtype=float),
        rig=rig,
        specimen=Specimen(**about["specimen"]),
        provenance=Provenance(**notes),
        full_range=about["full_range"],
        motion=Motion(**{"time": None, "full_range": about["full_range"], **motion}) if motion else None,
        places=places,
        **arrays,
    )
