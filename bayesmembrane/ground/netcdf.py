"""Arrays as netCDF, made in memory: HDF5 that writes to a disk which fills up takes the whole process with it."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

_COMPRESSIBLE = "biufc"
LARGE = 1_000_000
"""Numbers of single precision beyond which they stay as they are: noise, hardly smaller and slowest to compress."""
SMALL = 50_000
"""Bytes up to which an array stays as it is: what HDF5 keeps of its pieces is more than what it saves."""


def packed(groups: Mapping[str, Any]) -> bytes:
    """The content of a netCDF file with these xarray datasets as its groups, large ones compressed; "/" is the file."""
    encoding = {
        f"/{name.strip('/')}": {n: _stored(v) for n, v in held.variables.items()} for name, held in groups.items()
    }
    import xarray  # on demand: half a second

    tree: Any = xarray.DataTree.from_dict(dict(groups))
    with _without_cluster():
        return bytes(tree.to_netcdf(None, engine="h5netcdf", encoding=encoding))


def unpacked(path: Path) -> dict[str, Any]:
    """The xarray datasets of a file's groups, by name; what is large is read when it is asked for."""
    import xarray

    found: Any = xarray.open_groups(path, engine="h5netcdf")
    return {name.strip("/"): held for name, held in found.items() if name.strip("/")}


def _stored(values: Any) -> dict[str, Any]:
    """How an array is stored; no value stands for a missing one."""
    noise = values.dtype.itemsize == 4 and values.size > LARGE
    worth = values.dtype.kind in _COMPRESSIBLE and values.nbytes > SMALL and not noise
    return {"_FillValue": None} | ({"zlib": True} if worth else {})


def _without_cluster() -> AbstractContextManager[Any]:
    """On a worker of Dask xarray asks the scheduler for a lock on the bytes that it writes, and nobody knows those."""
    dask: Any = sys.modules.get("dask.config")  # loaded on every worker
    return nullcontext() if dask is None else dask.set(scheduler="synchronous")
