"""The curve behind published losses: the shipped files, a round trip with planted misprints, errors."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bayesmembrane.data.published import PublishedTable, read_published_table
from bayesmembrane.data.reading import read_measurement
from bayesmembrane.data.shipped import data_folder
from bayesmembrane.ground.errors import DataError
from bayesmembrane.ground.parameters import Array
from bayesmembrane.ground.stored import read, store
from bayesmembrane.reconstruction.families.smooth_logarithm import SmoothLogarithm
from bayesmembrane.reconstruction.files import write_reconstruction
from bayesmembrane.reconstruction.fit import find_mode, knobs_at
from bayesmembrane.reconstruction.model import LossModel
from bayesmembrane.reconstruction.reconstruct import Reconstruction, reconstruct, simulate_on
from bayesmembrane.reconstruction.rows import _distance, _shortest, check_row
from bayesmembrane.reconstruction.simulations import tabulate
from bayesmembrane.words.reconstruction import document
from tests.ground.values import stored_equals_given
from tests.reconstruction.independent import straightest

STEMS = ("elastosil_50um_op1", "elastosil_50um_op2", "elastosil_50um_first_loading")
MIDDLE = knobs_at(0.14, 5e-3, 1.5e-4, (4e-4, 1e-3))


@pytest.fixture(scope="module")
def table() -> PublishedTable:
    return read_published_table()


@pytest.fixture(scope="module")
def found(table: PublishedTable) -> Reconstruction:
    return reconstruct(table)


@pytest.fixture(scope="module")
def model(table: PublishedTable) -> LossModel:
    simulations = tabulate(table, simulate_on(table))
    return LossModel(
        simulations, SmoothLogarithm(simulations), table.losses, simulations.usable, (0, 1), (10, 9), table.step
    )


# ---- the paper's table -----------------------------------------------------------------------------------------------


def test_table_is_as_printed(table: PublishedTable) -> None:
    assert len(table.rows) == 15
    assert table.losses.shape == (2, 15)
    assert table.ends == pytest.approx((0.0351, 0.0915), rel=1e-12)
    rows = {row.label: row for row in table.rows}
    assert rows["gent OP1"].parameters == ("7.6059127", "523.010")
    assert rows["gent OP1"].losses == ("0.23496124148368835", "12.129879")
    assert rows["ogden INI"].parameters == ("30.9", "0.06", "-0.5", "1.30", "5.00", "-2.00")
    assert rows["yeoh OP2"].losses == ("0.10185724", "0.53057563")


def test_shipped_files_are_rebuilt(found: Reconstruction, table: PublishedTable, tmp_path: Path) -> None:
    written = write_reconstruction(found, table, tmp_path)
    assert {p.name for p in written} == {f"{s}{e}" for s in STEMS for e in (".csv", ".toml", "_covariance.csv")}
    for stem in STEMS:
        new = read_measurement(tmp_path / f"{stem}.csv", tmp_path / f"{stem}.toml")
        old = read_measurement(data_folder() / f"{stem}.csv", data_folder() / f"{stem}.toml")
        assert "RECONSTRUCTED" in old.provenance.origin
        assert new.force_sd is not None
        assert old.force_sd is not None
        np.testing.assert_allclose(new.deflection, old.deflection, atol=5e-5)
        assert np.all(np.abs(new.force - old.force) < 0.2 * old.force_sd + 1e-4)
        np.testing.assert_allclose(new.force_sd, old.force_sd, rtol=0.35)


def test_losses_agree_with_the_curve(found: Reconstruction) -> None:
    gaps = {(c.range, c.material, c.column): c.reconstructed - c.printed for c in found.losses if c.wrong < 0.95}
    first = sorted(abs(g) for (r, *_), g in gaps.items() if r == "OP1")
    second = sorted(abs(g) for (r, *_), g in gaps.items() if r == "OP2")
    assert first[-3] < 2e-3, "nearly all losses of OP1 agree to a millinewton or two"
    assert first[-1] < 8e-3
    assert second[-4] < 12e-3, "nearly all losses of OP2 agree to about ten millinewtons"
    assert second[-1] < 60e-3


def test_positions_are_counted(found: Reconstruction) -> None:
    first, second = found.ranges
    assert first.n_points[10] > 0.99
    assert second.n_points[9] > 0.9
    assert first.first == pytest.approx(1.05e-3, abs=0.15e-3)
    assert 0.1e-3 < second.first < 1.5e-3
    assert first.deflection[-1] == pytest.approx(0.0351)
    assert second.deflection[-1] == pytest.approx(0.0915)
    np.testing.assert_allclose(np.diff(second.deflection), np.diff(second.deflection)[0])


def test_the_one_misprint_is_named(found: Reconstruction) -> None:
    assert [(s.material, s.column) for s in found.suspects] == [("mooney_rivlin", "INI")]
    (correction,) = found.suspects[0].corrections
    assert (correction.entry, correction.printed, correction.consistent) == ("c1", "7.0", 7.5)
    both = found.suspects[0].alternatives[0]
    assert [c.entry for c in both] == ["loss_OP1", "loss_OP2"]


def test_covariance_is_joint_and_positive_definite(found: Reconstruction) -> None:
    sd = np.sqrt(np.diag(found.covariance))
    correlation = found.covariance / np.outer(sd, sd)
    assert np.linalg.eigvalsh(correlation)[0] > 1e-4
    across = correlation[:10, 10:]
    assert np.max(np.abs(across)) > 0.2, "the ranges sample one curve"


def test_assumptions_matter_less_than_the_uncertainty(found: Reconstruction) -> None:
    sd = np.sqrt(np.diag(found.covariance))
    for influence in found.influence:
        if influence.log_evidence is not None and influence.log_evidence > -3:
            # Four times the load-cell noise moves a point by about one sd, a little more or less from build to build.
            assert np.max(np.abs(influence.force - found.force) / sd) < 1.5, influence.changed


def test_families_are_weighed_and_mixed(found: Reconstruction) -> None:
    probability = {f.name: f.probability for f in found.families}
    assert sum(probability.values()) == pytest.approx(1.0, abs=1e-6)
    assert probability["neo_hookean"] < 1e-6, "it has no upturn, whatever the rig"
    assert max(probability.values()) < 0.6, "the losses alone do not choose"
    mixed = [f for f in found.families if f.force is not None]
    share = np.array([f.probability for f in mixed]) / sum(f.probability for f in mixed)
    force, sd = np.array([f.force for f in mixed]), np.array([f.force_sd for f in mixed])
    np.testing.assert_allclose(share @ force, found.force, atol=1e-9)
    variance = share @ (sd**2 + (force - found.force) ** 2)
    np.testing.assert_allclose(np.diag(found.covariance), variance, rtol=1e-6)


def test_the_band_holds_curves_of_other_priors(found: Reconstruction) -> None:
    """At 4.8 and 8.6 mm: smooth in the logarithm 44 and 203 mN; smooth in the force 68 and 216 mN."""
    sd = np.sqrt(np.diag(found.covariance))
    assert found.deflection[1:3] == pytest.approx((4.83e-3, 8.61e-3), abs=0.05e-3)
    for low, high, force, width in zip((0.044, 0.203), (0.068, 0.216), found.force[1:3], sd[1:3], strict=True):
        assert abs(low - force) < 1.645 * width
        assert abs(high - force) < 1.645 * width


def test_another_way_to_the_curve_ends_in_the_band(found: Reconstruction, table: PublishedTable) -> None:
    start = np.linspace(0.5e-3, max(table.ends), 25)
    yeoh = table.rows[11]
    other = straightest(table, (10, 9), 3, np.array([start, simulate_on(table)(yeoh.material, yeoh.values, start)]))
    assert np.all(other.misses < 1.0), "it meets the losses, too"
    z = (other.force(found.deflection) - found.force) / np.sqrt(np.diag(found.covariance))
    assert np.max(np.abs(z)) < 3.0
    assert np.sqrt(np.mean(z**2)) < 1.7


def test_it_is_stored_as_it_is(found: Reconstruction, tmp_path: Path) -> None:
    store(tmp_path, "reconstruction", found, {})
    stored_equals_given(found, read(tmp_path, "reconstruction"))


def test_json_has_the_fields_of_the_contract(found: Reconstruction) -> None:
    answer = json.loads(json.dumps(document(found), allow_nan=False))
    for name in ("OP1", "OP2"):
        part = answer[name]
        assert sum(part["n_points"].values()) == pytest.approx(1.0, abs=1e-4)
        assert set(part["first_mm"]) == {"mean", "sd"}
        assert len(part["deflection_mm"]) == len(part["force_N"]) == len(part["sd_N"])
    assert all(f["probability"] >= 0 for f in answer["families"].values())
    assert set(answer["suspect_rows"][0]) >= {"material", "column", "reason", "corrections"}
    assert set(answer["suspect_rows"][0]["corrections"][0]) >= {"entry", "printed", "consistent"}


# ---- a curve that is known -------------------------------------------------------------------------------------------


def known_curve(x: Array) -> Array:
    """Force (N) at x (m) of a form that no prior knows: powers, an exponential start and an exponential end."""
    s = x / 0.0915
    return np.asarray(6.5 * s**1.4 * np.exp(0.05 * s + s**6) * (1 - np.exp(-((s / 0.06) ** 1.6))))


def published(
    table: PublishedTable, positions: list[Array], rng: np.random.Generator
) -> tuple[PublishedTable, list[Array]]:
    """The table that a paper would print of the known curve, measured with noise and simulated with errors."""
    forces = [known_curve(x) + 3e-3 * rng.standard_normal(x.size) for x in positions]
    simulate = simulate_on(table)
    common = [1 + 2e-4 * rng.standard_normal(x.size) for x in positions]
    rows = []
    for row in table.rows:
        losses = []
        for x, y, c in zip(positions, forces, common, strict=True):
            own = np.ones(x.size) if row.material == "neo_hookean" else 1 + 3e-4 * rng.standard_normal(x.size)
            losses.append(f"{np.linalg.norm(y - simulate(row.material, row.values, x) * c * own):.8g}")
        rows.append(replace(row, losses=tuple(losses)))
    return replace(table, rows=tuple(rows)), forces


@pytest.mark.study
def test_round_trip_with_two_planted_misprints(table: PublishedTable) -> None:
    counts, firsts = (12, 8), (0.8e-3, 1.9e-3)
    positions = [np.linspace(a, e, n) for a, e, n in zip(firsts, table.ends, counts, strict=True)]
    printed, forces = published(table, positions, np.random.default_rng(3))
    mooney, yeoh = printed.rows[3], printed.rows[9]
    right = yeoh.losses[1]
    misprint = f"{right[0]}{(int(right[1]) + 3) % 10}{right[2:]}"
    printed = printed.with_row(3, replace(mooney, parameters=("7.6", *mooney.parameters[1:])))
    printed = printed.with_row(9, replace(yeoh, losses=(yeoh.losses[0], misprint)))

    found = reconstruct(printed)

    for part, n, first, x, y in zip(found.ranges, counts, firsts, positions, forces, strict=True):
        assert max(part.n_points, key=lambda k: part.n_points[k]) == n
        assert abs(part.first - first) < 3.5 * part.first_sd + 2e-5
        there = y + known_curve(part.deflection) - known_curve(x)
        z = (part.force - there) / part.force_sd
        assert np.sqrt(np.mean(z**2)) < 1.8
        assert np.max(np.abs(z)) < 4.0
    named = {(s.material, s.column): s.corrections for s in found.suspects}
    assert set(named) == {("mooney_rivlin", "INI"), ("yeoh", "INI")}
    assert [c.entry for c in named["mooney_rivlin", "INI"]] == ["c1"]
    assert named["mooney_rivlin", "INI"][0].consistent == pytest.approx(7.0, abs=0.02)
    assert [c.entry for c in named["yeoh", "INI"]] == ["loss_OP2"]
    assert named["yeoh", "INI"][0].best == pytest.approx(float(right), abs=0.05)


# ---- parts -----------------------------------------------------------------------------------------------------------


def test_gradient_is_that_of_the_log_posterior(model: LossModel) -> None:
    theta = 0.1 * np.random.default_rng(0).standard_normal((1, model.size))
    gradient = model.log_posterior(theta, MIDDLE)[1][0]
    step = 1e-6 * np.eye(model.size)
    up = model.log_posterior(theta + step, knobs_of(model.size))[0]
    down = model.log_posterior(theta - step, knobs_of(model.size))[0]
    np.testing.assert_allclose((up - down) / 2e-6, gradient, atol=1e-5 * np.max(np.abs(gradient)))


def knobs_of(batch: int) -> object:
    return type(MIDDLE)(*(np.repeat(np.asarray(v), batch, axis=0) for v in MIDDLE))


def test_mode_is_a_maximum(model: LossModel) -> None:
    model = model.without(3)
    mode = find_mode(model, MIDDLE)
    around = mode.theta + 1e-2 * np.random.default_rng(1).standard_normal((20, mode.theta.size))
    assert np.all(model.log_posterior(around, knobs_of(20))[0] < mode.value)


def test_rows_of_one_curve_are_one_family(model: LossModel) -> None:
    assert model.simulations.family.tolist() == [0, 0, 0] + [-1] * 12


def test_row_without_a_curve_is_wrong_and_left_out(table: PublishedTable) -> None:
    def simulate(material: str, parameters: Sequence[float], deflection: Array) -> Array:
        force = simulate_on(table)(material, parameters, deflection)
        return np.where(material == "gent" and parameters[1] < 20, np.nan, force)

    simulations = tabulate(table, simulate)
    assert np.flatnonzero(~simulations.usable).tolist() == [8]
    model = LossModel(
        simulations, SmoothLogarithm(simulations), table.losses, simulations.usable, (0, 1), (10, 9), table.step
    ).without(3)
    check = check_row(model, find_mode(model, MIDDLE), 8)
    assert check.probability == 1.0
    assert np.all(np.isnan(check.excess))


def test_shortest_number_and_edit_distance() -> None:
    assert _shortest(7.5027, 0.002) == 7.5
    assert _shortest(-0.6532, 1e-5) == -0.6532
    assert _distance("0.1234", "0.1324") == 1
    assert _distance("7.", "7.5") == 1
    assert _distance("-0.5", "0.5") == 1


# ---- errors ----------------------------------------------------------------------------------------------------------


def test_too_few_rows(table: PublishedTable) -> None:
    with pytest.raises(DataError, match="cannot be located from 3"):
        replace(table, rows=table.rows[:3])


def test_a_loss_must_be_positive(table: PublishedTable) -> None:
    with pytest.raises(DataError, match="must be positive"):
        table.with_row(0, replace(table.rows[0], losses=("-0.2", "12.5")))


def test_first_row_without_a_curve(table: PublishedTable) -> None:
    with pytest.raises(DataError, match="no force over the whole range"):
        tabulate(table, lambda material, parameters, deflection: np.full(deflection.size, np.nan))


@pytest.mark.parametrize(
    ("which", "old", "new", "match"),
    [
        ("paper_losses.csv", "yeoh,OP2,OP2,0.53057563\n", "", "loss of yeoh OP2 over OP2 is missing"),
        ("paper_losses.csv", "0.53057563", "0,53057563", "cells|number"),
        ("paper_losses.csv", "loss_N", "loss", 'column "loss_N" is missing'),
        ("paper_parameters.csv", "gent,OP2,c2,17.42,-\n", "", "parameter c2 of gent OP2 is missing"),
        ("paper_parameters.csv", "mooney_rivlin", "moony_rivlin", "did you mean"),
    ],
)
def test_damaged_tables_are_refused(tmp_path: Path, which: str, old: str, new: str, match: str) -> None:
    text = (data_folder() / which).read_text()
    assert old in text
    path = tmp_path / which
    path.write_text(text.replace(old, new))
    with pytest.raises(Exception, match=match):
        read_published_table(**{"losses" if "losses" in which else "parameters": path})
