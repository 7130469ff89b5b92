"""What is written is read back, and nothing is overwritten."""

from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.writing import write_measurement
from bayesmembrane.ground.errors import StorageError
from tests.data.curves import annulus_curve


@pytest.mark.parametrize("noise", ["none", "sd", "covariance"])
def test_what_is_written_is_read_back(tmp_path: Path, noise: str) -> None:
    x = np.array([1.1, 2.3, 35.1])
    given_noise = {
        "none": {},
        "sd": {"force_sd": np.array([0.1, 0.2, 0.3])},
        "covariance": {"covariance": np.array([[2.0, 1 / 3, 0], [1 / 3, 1, 0], [0, 0, 1]])},
    }[noise]
    blank = None if noise == "sd" else np.array([[0.0, 1e-9], [1e-6, 0.1], [2e-6, 0.2], [1 / 3e5, 1 / 3]])
    m = annulus_curve(x, time=np.array([0.0, 1.0, 2.5]), blank_run=blank, **given_noise)
    write_measurement(m, tmp_path / "new" / "a.csv", tmp_path / "new" / "a.toml")
    again = read_measurement(tmp_path / "new" / "a.csv", tmp_path / "new" / "a.toml")
    for name in ("deflection", "force", "time", "force_sd", "covariance", "blank_run"):
        before, after = getattr(m, name), getattr(again, name)
        assert (before is None) == (after is None)
        assert before is None or np.allclose(before, after, rtol=1e-14, atol=0)
    assert (again.rig, again.specimen) == (m.rig, m.specimen)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    m = annulus_curve([1, 2])
    (tmp_path / "a.toml").write_text("mine")
    with pytest.raises(StorageError, match=r"a\.toml: the file exists already"):
        write_measurement(m, tmp_path / "a.csv", tmp_path / "a.toml")
    assert (tmp_path / "a.toml").read_text() == "mine"
    assert not (tmp_path / "a.csv").exists()
