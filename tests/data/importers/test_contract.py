"""What every importer must keep, run over all that the registry finds, third parties' included."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bayesmembrane.data.importers.base import Importer, import_export, read_export, recognising
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.registry import component, components

IMPORTERS: dict[str, type[Importer]] = components("importers")
SPECIMEN = "[specimen]\nthickness_um = 50\n[rig]\nkind = 'annulus'\ninner_radius_mm = 10\nouter_radius_mm = 35\n"
STRIP = "[specimen]\nthickness_um = 500\n[rig]\nkind = 'uniaxial'\nlength_mm = 50\nwidth_mm = 10\n"
every = pytest.mark.parametrize("importer", IMPORTERS.values(), ids=IMPORTERS)


@every
def test_it_is_documented(importer: type[Importer]) -> None:
    assert not inspect.isabstract(importer)
    assert len(inspect.getdoc(importer) or "") > 20
    assert component("importers", importer.name) is importer
    assert len(importer.title) > 10


@every
def test_it_reads_its_example(importer: type[Importer]) -> None:
    assert importer.recognises(importer.example)
    found = importer.read(importer.example, "export")
    curves = [{"deflection", "force"}, {"stretch", "nominal_stress"}]
    need = next(c for c in curves if c <= set(found.columns))
    n = len(found.columns[min(need)])
    assert n >= 2
    assert set(found.columns) - need <= {"time", "force_sd", "cycle", "direction"}
    assert all(np.shape(v) == (n,) and np.all(np.isfinite(v)) for v in found.columns.values())
    assert "export" in found.origin
    assert all(g.what and g.value and g.why for g in found.guesses)


@every
def test_only_it_recognises_its_example(importer: type[Importer]) -> None:
    """The first one that recognises a file reads it: layouts must not be taken for each other."""
    assert [i for i in IMPORTERS.values() if i.recognises(importer.example)] == [importer]
    assert recognising(importer.example) is importer


@every
def test_what_it_imports_is_a_measurement(importer: type[Importer], tmp_path: Path) -> None:
    (tmp_path / "export").write_bytes(importer.example)
    columns = importer.read(importer.example, "export").columns
    strip = "stretch" in columns
    (tmp_path / "film.toml").write_text(STRIP if strip else SPECIMEN)
    written = import_export(tmp_path / "export", tmp_path / "curve.csv", specimen=tmp_path / "film.toml")
    assert written.importer == importer.name
    assert written.complete
    m = read_measurement(written.curve, written.specimen)
    if strip:
        assert 1 + m.deflection / m.rig.lengths["length"] == pytest.approx(columns["stretch"], rel=1e-12)
    else:
        assert m.deflection == pytest.approx(columns["deflection"], rel=1e-12)
        assert m.force == pytest.approx(columns["force"], rel=1e-12)
    again = read_export(tmp_path / "export", specimen=tmp_path / "film.toml")
    assert again.data_hash == m.data_hash


@every
@given(data=st.data())
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_it_cannot_read_is_refused(importer: type[Importer], data: st.DataObject) -> None:
    """Whatever was cut out of a file or written into it: finite numbers, or a refusal that names the file."""
    text = importer.example
    at = data.draw(st.integers(0, len(text)))
    cut = data.draw(st.integers(0, len(text) - at))
    damaged = text[:at] + data.draw(st.binary(max_size=20)) + text[at + cut :]
    importer.recognises(damaged)
    found, refusal = None, ""
    try:
        found = importer.read(damaged, "export")
    except DataError as error:
        refusal = str(error)
    assert found is not None or "export" in refusal
    assert found is None or all(np.all(np.isfinite(v)) for v in found.columns.values())
