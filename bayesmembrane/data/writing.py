"""From a `Measurement` to the files that `reading` reads back; nothing is overwritten."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomli_w

from bayesmembrane.data.measurement import Measurement
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.parameters import Array


def write_measurement(measurement: Measurement, curve_csv: str | Path, specimen_toml: str | Path) -> None:
    """Write what `read_measurement` reads back: in mm, N and s; covariance and blank run in files of their own.

    Raises `StorageError` if a file exists already or cannot be written; nothing is overwritten.
    """
    curve_csv, specimen_toml = Path(curve_csv), Path(specimen_toml)
    arrays = {"time": measurement.time, "deflection": measurement.deflection, "force": measurement.force}
    if measurement.covariance is None:
        arrays["force_sd"] = measurement.force_sd
    columns = measurement.rig.to_columns(
        {k: v for k, v in arrays.items() if v is not None}, measurement.specimen.thickness
    )
    options: dict[str, Any] = {"origin": measurement.provenance.origin} if measurement.provenance.origin else {}
    texts = {curve_csv: csv_text(columns)}
    if measurement.covariance is not None:
        beside = specimen_toml.parent / f"{curve_csv.stem}_covariance.csv"
        options["covariance"] = beside.name
        texts[beside] = "".join(",".join(f"{v:.17g}" for v in row) + "\n" for row in measurement.covariance)
    if measurement.blank_run is not None:
        beside = specimen_toml.parent / f"{curve_csv.stem}_blank_run.csv"
        options["blank_run"] = beside.name
        texts[beside] = csv_text(
            {"deflection_mm": 1e3 * measurement.blank_run[:, 0], "force_N": measurement.blank_run[:, 1]}
        )
    lengths = {f"{k}_mm": float(f"{1e3 * v:.15g}") for k, v in measurement.rig.lengths.items()}
    content = {
        "specimen": {
            "name": measurement.specimen.name,
            "thickness_um": float(f"{1e6 * measurement.specimen.thickness:.15g}"),
        },
        "rig": {"kind": measurement.rig.name, **lengths},
        "measurement": options,
    }
    texts[specimen_toml] = tomli_w.dumps({k: v for k, v in content.items() if v})
    write_new(texts)


def csv_text(columns: dict[str, Array]) -> str:
    """A CSV with a header, columns of equal length, and 15 digits."""
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{v:.15g}" for v in row) for row in rows)]) + "\n"


def write_new(texts: dict[Path, str]) -> None:
    """Write texts to files that do not exist yet; raises `StorageError` before the first if one does."""
    for path in texts:
        if path.exists():
            raise StorageError("the file exists already", str(path), "remove it or choose another name")
    try:
        for path, text in texts.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8", newline="\n") as file:
                file.write(text)
    except OSError as error:
        raise StorageError(
            f"the file cannot be written ({error.strerror})", str(path), "choose another folder"
        ) from None
