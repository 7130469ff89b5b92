"""What real exports have that tidy ones lack: compression counted positive, dead channels, two clocks, torques."""

import numpy as np
import pytest

from bayesmembrane.data.exports.words import fact_of, unit_of
from tests.data.exports.test_layouts import (
    FORCE,
    LENGTH,
    STRESS,
    STRETCH,
    THICKNESS,
    TIME,
    TRAVEL,
    WIDTH,
    imported,
    lines,
)
from tests.data.exports.test_refusals import refusal

MM = 1e3 * TRAVEL
STRIP = {"rig": "uniaxial", "gauge_length": LENGTH, "width": WIDTH, "thickness": THICKNESS}
BLOCK = {"rig": "compression", "gauge_length": LENGTH, "width": WIDTH, "thickness": THICKNESS}


@pytest.mark.parametrize(
    ("key", "fact"), [("h (mm)", "thickness"), ("h0 [µm]:", "thickness"), ("h", ""), ("Time (h)", ""), ("h (N)", "")]
)
def test_h_is_a_thickness_only_with_a_unit_of_length(key: str, fact: str) -> None:
    assert fact_of(key) == fact


@pytest.mark.parametrize(
    ("travel", "force", "sign"), [(1, -1, "flip-force"), (-1, 1, "flip-travel"), (-1, -1, "flip"), (1, 1, "keep")]
)
def test_a_said_sign_turns_what_a_strip_carries_too(travel: int, force: int, sign: str) -> None:
    text = lines("Time (s),Extension (mm),Load (N)", TIME, travel * MM, force * FORCE)
    found = imported(text.encode(), sign=sign, **STRIP)
    assert found.columns["stretch"] == pytest.approx(STRETCH, abs=1e-5)
    assert found.columns["nominal_stress"] == pytest.approx(STRESS, rel=1e-4, abs=20)
    strain = lines("Strain (%),Stress (MPa)", travel * 100 * (STRETCH - 1), force * STRESS / 1e6)
    found = imported(strain.encode(), sign=sign)
    assert found.columns["stretch"] == pytest.approx(STRETCH, abs=1e-5)
    assert found.columns["nominal_stress"] == pytest.approx(STRESS, rel=1e-4, abs=20)


@pytest.mark.parametrize(
    ("travel", "force", "said"),
    [
        (1, -1, "--sign flip-force if it was pulled, flip-travel if it was pressed"),
        (-1, 1, "--sign flip-travel if it was pulled, flip-force if it was pressed"),
    ],
)
def test_a_strip_of_opposite_signs_is_refused_with_what_each_sign_means(travel: int, force: int, said: str) -> None:
    text = lines("Time (s),Extension (mm),Load (N)", TIME, travel * MM, force * FORCE)
    assert said in refusal(text, **STRIP)
    assert said in refusal(lines("Strain (%),Stress (MPa)", travel * 100 * (STRETCH - 1), force * STRESS / 1e6))


def test_the_zero_of_a_strips_force_is_told_and_settled() -> None:
    text = lines("Time (s),Extension (mm),Load (N)", TIME, MM, FORCE + 0.1)
    found = imported(text.encode(), **STRIP)
    assert any(g.what == "zero of the force" and g.option == "--zero force" for g in found.guesses)
    assert found.columns["nominal_stress"][0] == pytest.approx(0.1 / (WIDTH * THICKNESS))
    found = imported(text.encode(), zero="force", **STRIP)
    assert found.columns["nominal_stress"] == pytest.approx(STRESS, rel=1e-3, abs=50)
    stress = lines("Strain (%),Stress (MPa)", 100 * (STRETCH - 1), STRESS / 1e6 + 0.05)
    assert any(g.what == "zero of the stress" for g in imported(stress.encode()).guesses)


@pytest.mark.parametrize(
    "header",
    [
        "时间 (s),位移 (mm),载荷 (N),压缩应变 (%),压缩应力 (MPa)",
        "Time (s),Displacement (mm),Force (N),Compressive strain (%),Compressive stress (MPa)",
        "Zeit (s),Weg (mm),Kraft (N),Stauchung (%),Druckspannung (MPa)",
        "Czas (s),Droga (mm),Siła (N),Odkształcenie przy ściskaniu (%),Naprężenie ściskające (MPa)",
    ],
)
@pytest.mark.parametrize("size", [1.0, 0.02])
def test_a_compression_that_counts_positive_is_no_tension(header: str, size: float) -> None:
    columns = TIME, 0.3 * size * MM, FORCE, 30 * size * (STRETCH - 1), STRESS / 1e6
    text = lines(header, *columns)
    message = refusal(text)
    assert "speaks of compression" in message
    assert "--rig compression" in message
    found = imported(text.encode(), rig="compression")
    assert found.columns["stretch"] == pytest.approx(1 - 0.3 * size * (STRETCH - 1), abs=1e-5)
    assert found.columns["nominal_stress"] == pytest.approx(-STRESS, rel=1e-4, abs=20)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_pressed_block_by_its_sizes_takes_either_sign(sign: int) -> None:
    text = lines("Time (s),Displacement (mm),Load (N)", TIME, sign * 0.5 * MM, sign * FORCE)
    found = imported(text.encode(), **BLOCK)
    assert found.columns["stretch"] == pytest.approx(1 - 0.5 * TRAVEL / LENGTH, abs=1e-5)
    assert found.columns["nominal_stress"] == pytest.approx(-STRESS, rel=1e-4, abs=20)


def test_a_channel_without_any_reading_is_left_aside() -> None:
    rows = [f"{t:.3f}, {f:.6f}, , {x:.6f}, 1" for t, x, f in zip(TIME, MM, FORCE, strict=True)]
    text = "\n\n" + "\n".join(["Time (sec), Load (N), Strain (mm), Position (mm), Cycle", *rows]) + "\n"
    found = imported(text.encode())
    assert found.columns["deflection"] == pytest.approx(TRAVEL, abs=1e-8)
    assert found.columns["force"] == pytest.approx(FORCE, abs=1e-6)
    assert any("ignored columns: Strain (mm)" in note for note in found.notes)


def test_the_clock_that_needs_no_other_word_is_the_time() -> None:
    text = lines(("Crosshead \tLoad \tTime \tVideo Time ", "mm\tN\tsec\tsec"), MM, FORCE, TIME, TIME + 8.1, sep="\t")
    found = imported(text.encode())
    assert found.columns["time"] == pytest.approx(TIME)
    assert any("Video Time" in note for note in found.notes)
    two = lines("Video Time (s),Machine Time (s),Weg (mm),Load (N)", TIME + 8.1, TIME, MM, FORCE)
    assert "may each be the time" in refusal(two)


def test_two_copies_of_one_signal_are_one() -> None:
    header = "Time (s),Position (mm),Digital Position (mm),Force (N)"
    found = imported(lines(header, TIME, MM, MM + 4e-6, FORCE).encode())
    assert found.columns["deflection"] == pytest.approx(TRAVEL, abs=1e-8)
    message = refusal(
        lines("Time (s),Tip Displacement (mm),Base Displacement (mm),Force (N)", TIME, MM, 1.1 * MM, FORCE)
    )
    assert "may each be the travel" in message


@pytest.mark.parametrize("unit", ["N·m", "N.m", "Nm", "N m", "N*m", "kNm", "N·mm", "mN·m"])
def test_a_moment_is_neither_a_length_nor_a_force(unit: str) -> None:
    assert unit_of(unit) == ""
    text = lines(f"Total Time (s),Rotation (deg),Torque ({unit})", TIME, MM, FORCE)
    assert "hold travel and force" in refusal(text)


@pytest.mark.parametrize(
    ("key", "fact"),
    [
        ("Strain : Tensile strain (Extension) gauge length", "gauge_length"),
        ("Odkształcenie : Odkształcenie przy rozciąganiu (Przemieszczenie) długość pomiarowa", "gauge_length"),
        ("Strain : Strain 1 gauge length", "strain_length"),
        ("Odkształcenie : Odkształcenie 1 długość pomiarowa", "strain_length"),
        ("Gage Length (Extensometer)", "strain_length"),
        ("Messlänge Extensometer", "strain_length"),
        ("Deformación : Deformación por tracción (Extensión) distancia inicial", "gauge_length"),
        ("Propiedades de la probeta : Anchura", "width"),
        ("Propiedades de la probeta : Anchura final", ""),
        ("Final Diameter", ""),
        ("Dimension : Length", "length"),
        ("Crosshead Rate", "speed"),
        ("Gauge length", "gauge_length"),
        ("Strain at break", ""),
        ("Test : Rate 1", "speed"),
    ],
)
def test_whose_length_a_preamble_states(key: str, fact: str) -> None:
    assert fact_of(key) == fact


def test_the_length_of_an_extensometer_is_not_that_of_the_crosshead() -> None:
    before = "Strain : Strain 1 gauge length,10.0,mm\nDimension : Length,50.0,mm\n\n"
    text = lines(("Time,Extension,Load", "(s),(mm),(N)"), TIME, MM, FORCE, before=before)
    said = {k: v for k, v in STRIP.items() if k != "gauge_length"}
    message = refusal(text, **said)
    assert "the gauge length is not known" in message
    assert '"Strain : Strain 1 gauge length 10 mm" (line 1)' in message
    assert '"Dimension : Length 50 mm"' in message
    own = before.replace("Strain 1", "Tensile strain (Extension)").replace("10.0", "50.0")
    found = imported(lines(("Time,Extension,Load", "(s),(mm),(N)"), TIME, MM, FORCE, before=own).encode(), **said)
    assert found.columns["stretch"] == pytest.approx(STRETCH, abs=1e-5)


def test_brackets_of_a_name_do_not_hide_the_row_of_units() -> None:
    header = ("Time,Load,Tensile strain (Extension)", "(s),(N),(mm/mm)")
    large = 20 * (STRETCH - 1) / 0.4
    found = imported(lines(header, TIME, FORCE, large).encode(), width=WIDTH, thickness=THICKNESS)
    assert found.columns["stretch"] == pytest.approx(1 + large, abs=1e-5)


@pytest.mark.parametrize("unit", ["microstrain", "µε", "um/m", "µm/m"])
def test_strain_in_millionths(unit: str) -> None:
    text = lines(f"Time (s),Strain ({unit}),Stress (MPa)", TIME, 1e6 * (STRETCH - 1), STRESS / 1e6)
    assert imported(text.encode()).columns["stretch"] == pytest.approx(STRETCH, abs=1e-5)


def test_results_of_whole_tests_are_no_readings() -> None:
    rows = [f"{k},{500 + k}.1,{11 + 0.1 * k:.1f},5.6" for k in range(1, 6)]
    text = "\n".join(["Sample,Young's Modulus (MPa),Max Load (N),Break (%)", *rows]) + "\n"
    message = refusal(text)
    assert "5 lines of numbers seem to be results of whole tests" in message
    assert "raw data" in message


def test_two_columns_without_names_are_asked_for_by_two() -> None:
    assert "--columns travel_mm,force_N," in refusal(lines((), MM, FORCE))


def test_the_name_of_a_specimen_stands_behind_its_group() -> None:
    before = 'Texteingaben : Proben-beschriftung;"dpp-1"\n\n'
    text = lines(("Zeit;Traversenweg;Last", "(sec);(mm);(N)"), TIME, MM, FORCE, sep=";", decimal=",", before=before)
    assert imported(text.encode("cp1252")).film.name == "dpp-1"
    assert np.all(imported(text.encode("cp1252")).columns["force"] >= 0)
