"""What ``force`` and ``convexity`` stored stands on a page."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from bayesmembrane.app.cli import assembled
from bayesmembrane.report.page import TWIN


def test_a_page_of_forces_and_of_convexity(tmp_path: Path) -> None:
    out = ["--out", str(tmp_path / "films"), "--json"]
    gent = ["--material", "gent", "--parameters", "5.312,17.42"]
    force = CliRunner().invoke(assembled(), ["force", *gent, "--deflection-mm", "10,120", *out])
    assert force.exit_code == 0, force.output
    told = json.loads(force.stdout)
    assert Path(told["stored"]).parent == tmp_path / "films"
    words = ["convexity", "--material", "mooney_rivlin", "--parameters", "7,0.5", *out]
    assert CliRunner().invoke(assembled(), words).exit_code == 0
    page = CliRunner().invoke(
        assembled(), ["report", str(tmp_path / "films"), "--out", str(tmp_path / "page"), "--json"]
    )
    assert page.exit_code == 0, page.output
    assert [a["kind"] for a in json.loads(page.stdout)["answers"]] == ["force", "convexity"]
    twin = json.loads((tmp_path / "page" / TWIN).read_text())
    rows = twin["tables"]["forces"]
    assert rows[0]["force_N"] == told["force_N"][0]
    assert rows[1]["force_N"] is None
    assert rows[1]["status"].startswith("locked")
    assert "Gent (5.312, 17.42): forces up to 120 mm; 1 of 2 deflections have none." in twin["answer"]
    assert any("Mooney-Rivlin (7, 0.5) is not convex on [1, 8]^2" in sentence for sentence in twin["answer"])


def test_without_out_nothing_is_stored(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["convexity", "--material", "neo_hookean", "--parameters", "7", "--json"]
    done = CliRunner().invoke(assembled(), words)
    assert json.loads(done.stdout)["stored"] is None
    assert list(tmp_path.iterdir()) == []
