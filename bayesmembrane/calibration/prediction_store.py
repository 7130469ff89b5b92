"""The predictions of a run as a netCDF file beside its draws: named arrays that other programs read too."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from bayesmembrane.calibration.predictions import Predictions, Wanted
from bayesmembrane.ground.files import write_whole
from bayesmembrane.ground.netcdf import packed
from bayesmembrane.ground.sealed import checked, damaged, sealed

FILE, AGAIN = "predictions.nc", "remove the file and report again"

# Dimensions of the stored arrays, so that other programs read them with names.
_DIMS = {
    "at": "point", "force": "point", "sd": "point",
    "rest_at": "rest", "rest_force": "rest", "rest_sd": "rest",
    "deflection": "grid", "beyond": "grid", "curve": "quantile grid", "repeat": "quantile grid", "lost": "reason grid",
    "residual": "quantile point", "rest_residual": "quantile rest", "curves_at": "quantile point",
    "film": "parameter", "shape_at": "shape", "state_1": "shape radius", "state_2": "shape radius",
    "shape_radius": "shape draw radius", "shape_height": "shape draw radius",
    "map_1": "stretch_1", "map_2": "stretch_2", "eigenvalue": "stretch_1 stretch_2",
    "break_at": "specimen", "break_thickness": "specimen", "break_force": "specimen",
    "break_predicted": "quantile specimen", "break_lost": "specimen",
}  # fmt: skip


def write_predictions(found: Predictions, folder: Path, draws_of: str, wanted: Wanted) -> None:
    """Store what was ``wanted`` of the draws called ``draws_of``; raises `StorageError` if that cannot be."""
    values = {f.name: getattr(found, f.name) for f in fields(found)}
    single = {name: value for name, value in values.items() if name not in _DIMS}
    made = {"draws_of": draws_of, "wanted": _plain(wanted)}
    import xarray  # on demand: half a second

    dataset = xarray.Dataset(
        {name: (dims.split(), np.asarray(values[name])) for name, dims in _DIMS.items()},
        attrs={"values": json.dumps(single), "made": json.dumps(made)},
    )
    content, _ = sealed(packed({"/": dataset}))
    write_whole(folder / FILE, lambda part: part.write_bytes(content), "the file of predictions")


def has_predictions(folder: Path, draws_of: str, wanted: Wanted | None = None) -> bool:
    """Whether `read_predictions` would find something; without reading the arrays, which takes twenty times as long.

    Raises `StorageError` if the file is damaged.
    """
    path = folder / FILE
    if not path.is_file():
        return False
    import h5netcdf  # on demand, as all of HDF5

    with _whole(path), h5netcdf.File(path, "r") as file:
        return _serves(json.loads(file.attrs["made"]), draws_of, wanted)


def read_predictions(folder: Path, draws_of: str, wanted: Wanted | None = None) -> Predictions | None:
    """What is stored in ``folder``; None if that is nothing, of other draws, or not what was ``wanted`` (None: any).

    Raises `StorageError` if the file is damaged.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    import xarray

    with _whole(path):
        dataset = xarray.load_dataset(path, engine="h5netcdf")
        if not _serves(json.loads(dataset.attrs["made"]), draws_of, wanted):
            return None
        values: dict[str, Any] = json.loads(dataset.attrs["values"])
        values |= {name: np.asarray(dataset[name].values) for name in _DIMS}
        for name in ("reasons", "specimens"):
            values[name] = tuple(values[name])
        return Predictions(**values)


@contextmanager
def _whole(path: Path) -> Iterator[None]:
    """Raises `StorageError` where the file is not what was written, or what reads it finds it damaged."""
    checked(path, "the file of predictions", AGAIN)
    try:
        yield
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError) as error:
        raise damaged(path, "the file of predictions", type(error).__name__, AGAIN) from None


def _serves(made: Mapping[str, Any], draws_of: str, wanted: Wanted | None) -> bool:
    return bool(made["draws_of"] == draws_of and (wanted is None or made["wanted"] == _plain(wanted)))


def _plain(wanted: Wanted) -> dict[str, Any]:
    return {
        "up_to": wanted.up_to,
        "rest": None if wanted.rest is None else wanted.rest.data_hash,
        "breaks": repr(wanted.breaks),
        "draws": wanted.draws,
    }
