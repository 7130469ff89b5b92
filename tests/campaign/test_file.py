"""The campaign file: what is right is read, and what is wrong is told with file, line and key."""

from pathlib import Path

import pytest

from bayesmembrane.campaign.file import read_campaign
from bayesmembrane.campaign.places import line_of
from bayesmembrane.ground.errors import DataError, SettingsError

WHOLE = """# a night
seed = 3
[measurements]
curves = [
  "a*.csv",
  "b.csv",
]
[hypotheses]
materials = ["yeoh", "gent"]
effects = ["", "prestretch", "prestretch+zero_offset", ["force_offset"]]
noise = ["white", "ar1"]
convexity = ["reached"]
max_deflection_mm = ["all", 20, 35.1]
[analyses]
wanted = ["sample", "compare"]
[sampling]
ess = 400
[stop]
deadline = "07:30"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "night.toml"
    path.write_text(text)
    return path


def test_a_whole_file_is_read(tmp_path: Path) -> None:
    asked = read_campaign(written(tmp_path, WHOLE))
    assert asked.hypotheses.effects == ((), ("prestretch",), ("prestretch", "zero_offset"), ("force_offset",))
    assert asked.hypotheses.max_deflection_mm == ("all", 20.0, 35.1)
    assert (asked.seed, asked.stop.deadline, asked.sampling.stated()) == (3, "07:30", {"ess": 400.0})


@pytest.mark.parametrize(
    ("right", "wrong", "line", "words"),
    [
        ('"gent"', '"gnet"', 9, ["hypotheses.materials", '"gnet"', '"gent"']),
        ("seed = 3", "seed = -1", 2, ["seed", "greater than or equal to 0"]),
        ("seed = 3", "sead = 3", 2, ['"sead"', '"seed"']),
        ("effects =", "efects =", 10, ['"hypotheses.efects"', '"effects"']),
        ('"prestretch",', '"prestrech",', 10, ['"prestrech"', '"prestretch"']),
        ("prestretch+zero_offset", "prestretch+prestretch", 10, ["twice"]),
        ('"white", "ar1"', '"white", "white"', 8, ["noise", "twice"]),
        ('"ar1"', '"pink"', 11, ['"pink"']),
        ('["reached"]', '["rechead"]', 12, ['"rechead"', '"reached"']),
        ("35.1]", "true]", 13, ["max_deflection_mm", "number"]),
        ("35.1]", "-2]", 13, ["max_deflection_mm", "-2.0"]),
        ('"compare"', '"compere"', 15, ["analyses.wanted", "compare"]),
        ("ess = 400", "ess = 0", 17, ["sampling.ess", "greater than 0"]),
        ("ess = 400", "ess = inf", 17, ["sampling.ess", "finite"]),
        ("ess = 400", "ess = 400\nchunk = 40\nmost_steps = 20", 16, ["sampling", "chunk"]),
        ('"07:30"', '"7.30"', 19, ["stop.deadline", '"7.30"', '"07:30"']),
        ('"b.csv"', "3", 4, ["measurements.curves", "string"]),
        ('materials = ["yeoh", "gent"]', "", 8, ['"hypotheses.materials" is missing']),
        ("[stop]", "[halt]", 18, ['"halt"']),
    ],
)
def test_a_fault_is_told_with_file_line_and_key(
    tmp_path: Path, right: str, wrong: str, line: int, words: list[str]
) -> None:
    assert right in WHOLE
    path = written(tmp_path, WHOLE.replace(right, wrong, 1))
    with pytest.raises(SettingsError) as fault:
        read_campaign(path)
    for word in (f"{path}, line {line}", *words):
        assert word in str(fault.value)
    assert "\n" not in str(fault.value)


def test_what_is_no_toml_is_told_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="line 2"):
        read_campaign(written(tmp_path, WHOLE.replace("seed = 3", "seed = 3 4")))
    with pytest.raises(DataError):
        read_campaign(tmp_path / "missing.toml")


def test_a_line_is_that_on_which_a_statement_begins() -> None:
    text = 'a = """\nb = 1\n"""\n\n# b\nb = [\n  1,\n  2,\n]\n[[c]]\nd = 1\n[[c]]\nd = 2\n'
    assert line_of(text, ["a"]) == 1
    assert line_of(text, ["b"]) == 6
    assert line_of(text, ["b", 1]) == 6
    assert line_of(text, ["c", 1, "d"]) == 13
    assert line_of(text, ["c", 1, "missing"]) == 12
    assert line_of(text, ["missing"]) is None
