"""The program's own layout of a biaxial test goes in as it is."""

from pathlib import Path

import numpy as np
import pytest

import bayesmembrane as bm

STATES = np.array([[1.1, 1.05, 0.05, 0.03], [1.2, 1.1, 0.09, 0.05], [1.3, 1.15, 0.12, 0.07], [1.4, 1.2, 0.14, 0.09]])
HEADER = "stretch_1,stretch_2,nominal_stress_1_MPa,nominal_stress_2_MPa"


def written(folder: Path, header: str = HEADER, separator: str = ",", decimal: str = ".") -> Path:
    rows = [separator.join(f"{v:g}".replace(".", decimal) for v in row) for row in STATES]
    path = folder / "sheet.csv"
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "separator", "decimal", "factor"),
    [
        (HEADER, ",", ".", 1.0),
        (HEADER.replace(",", ";"), ";", ",", 1.0),
        (HEADER.replace("MPa", "kPa"), ",", ".", 1e-3),
    ],
)
def test_both_directions_are_read(tmp_path: Path, header: str, separator: str, decimal: str, factor: float) -> None:
    found = bm.read_measurement(written(tmp_path, header, separator, decimal), thickness_um=500)
    assert found.rig.name == "biaxial"
    assert len(found) == 8
    assert found.across is not None
    stretch = 1 + found.deflection / found.rig.size()
    np.testing.assert_allclose(stretch, np.concatenate([STATES[:, 0], STATES[:, 1]]), rtol=1e-9)
    np.testing.assert_allclose(found.across, np.concatenate([STATES[:, 1], STATES[:, 0]]), rtol=1e-9)
    area = 0.010 * 500e-6
    expected = 1e6 * factor * np.concatenate([STATES[:, 2], STATES[:, 3]])
    np.testing.assert_allclose(found.force / area, expected, rtol=1e-9)


def test_what_was_written_is_what_the_other_verbs_read(tmp_path: Path) -> None:
    path = written(tmp_path, HEADER + ",nominal_stress_1_sd_MPa,nominal_stress_2_sd_MPa")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], *(f"{line},0.002,0.003" for line in lines[1:])]))
    direct = bm.read_measurement(path, thickness_um=500)
    from bayesmembrane.data.exports.hints import hints_of
    from bayesmembrane.data.importers.base import import_export

    out = import_export(path, tmp_path / "out.csv", hints_of({"thickness_um": 500}))
    assert out.complete
    again = bm.read(out.curve, out.specimen)
    assert again.data_hash == direct.data_hash
    assert again.force_sd is not None
    np.testing.assert_allclose(again.force_sd / (0.010 * 500e-6), np.repeat([2e3, 3e3], 4))


def test_another_rig_is_refused_and_one_axis_is_a_strip(tmp_path: Path) -> None:
    path = written(tmp_path)
    with pytest.raises(bm.SettingsError, match="two axes"):
        bm.read_measurement(path, thickness_um=500, rig="uniaxial")
    with pytest.raises(bm.SettingsError, match="itself"):
        bm.read_measurement(path, thickness_um=500, zero="force")
    columns = "stretch=stretch_1,stress=nominal_stress_1_MPa"
    one = bm.read_measurement(path, thickness_um=500, rig="uniaxial", columns=columns, stress="engineering")
    assert (one.rig.name, len(one)) == ("uniaxial", 4)
