"""The first screen of a diagnosis or a loop: short, and of one mind with the JSON answer and the rest of the page."""

import itertools
import re
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bayesmembrane.app.documents import document
from bayesmembrane.calibration.predictions import Wanted
from bayesmembrane.calibration.run import predictions_of
from bayesmembrane.data.measurement import Provenance
from bayesmembrane.diagnosis.loop import Loop
from bayesmembrane.diagnosis.result import Diagnosis
from bayesmembrane.report.blocks import Figure, Heading, Lead, Points, Table, Text
from bayesmembrane.report.page import Content, compose, sections, write_report
from bayesmembrane.report.runs import read
from bayesmembrane.report.sections.diagnosis.lead import handles, steps_of
from bayesmembrane.words import diagnosis as words
from bayesmembrane.words.candidates import sizes
from bayesmembrane.words.hypothesis import spoken
from bayesmembrane.words.seen import seen
from tests.report.sections.loops import only

pytestmark = pytest.mark.usefixtures("blank_pictures")

WORDS = 120
RECONSTRUCTED = Provenance("c.csv", "c.toml", "", "statement: RECONSTRUCTED, not raw data: inferred from losses")


def lead_of(result: Any) -> Lead:
    """That of the page, without the parts of the page below it, whose pictures would be drawn each time."""
    return next(lead for section in sections() if (lead := section.lead([result])) is not None)


def told(content: Content) -> list[str]:
    """Every sentence of a page, with those of its tables and pictures."""
    assert content.lead is not None
    out = [content.title, *content.lead.lines]
    for b in [content.lead.table, content.lead.figure, *(b for p in content.parts for b in p.blocks)]:
        match b:
            case Text() | Heading():
                out.append(b.text)
            case Points():
                out += b.lines
            case Figure():
                out += [b.alt, b.caption]
            case Table():
                out += [b.caption, *(c.head for c in b.columns), *(cell for row in b.cells() for cell in row)]
    return out + [p.title for p in content.parts]


def as_material(d: Diagnosis) -> Diagnosis:
    """The same, had another energy explained the curve."""
    other = next(j for j in d.ranking if j.candidate.hypothesis.material is not d.null.hypothesis.material)
    material = other.candidate.hypothesis.material.name
    return replace(d, verdict="material", material=material, effects=(), members=(other,), best=other.candidate)


def every_end(request: pytest.FixtureRequest) -> dict[str, Any]:
    """Loops and diagnoses with every verdict."""
    loops = {name: request.getfixturevalue(name) for name in ("named", "unknown", "ambiguous", "sampled")}
    first = loops["named"].rounds[0].diagnosis
    alone = {f"{name} diagnosis": loops[name].rounds[0].diagnosis for name in ("named", "unknown", "ambiguous")}
    return {
        **loops,
        **alone,
        "adequate": Loop(loops["named"].rounds[1:], None),
        "stops early": Loop(loops["named"].rounds[:1], None),
        "material": as_material(first),
        "strip": request.getfixturevalue("strip"),
        "reconstructed": replace(first, measurement=replace(first.measurement, provenance=RECONSTRUCTED)),
    }


def test_a_first_screen_has_fewer_than_120_words_and_begins_with_probabilities(request: pytest.FixtureRequest) -> None:
    for name, result in every_end(request).items():
        lead = lead_of(result)
        assert lead.words < WORDS, name
        assert re.match(r"[<>] |\d", lead.brief.answer), name
        assert all("%" in line for line in lead.brief.probable), name
        assert lead.brief.left.startswith("leaving "), name
        assert lead.brief.following.endswith("."), name


def test_what_a_first_screen_has_no_room_for_is_left_to_the_page_below(strip: Diagnosis) -> None:
    """How many effects are probable, and how long a film's name is, is not ours to choose."""
    plain, m = lead_of(strip), strip.measurement
    told = []
    for more in (0, 4, 12, 20):
        specimen = replace(m.specimen, name=" ".join([m.specimen.name, *["strip"] * more]))
        lead = lead_of(replace(strip, measurement=replace(m, specimen=specimen)))
        assert lead.words < WORDS
        assert lead.brief.following == plain.brief.following
        told.append(len(lead.brief.answer.split()))
    assert told == sorted(told, reverse=True)
    assert told[-1] <= told[0]


def test_every_part_of_a_page_is_made_once(named: Loop, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its pictures are what a page takes most of its time for."""
    made: list[str] = []
    for section in sections():
        kind, parts = type(section), type(section).parts

        def counted(self: Any, results: Any, parts: Any = parts) -> Any:
            made.append(self.name)
            return parts(self, results)

        monkeypatch.setattr(kind, "parts", counted)
    lead = compose([named]).lead
    assert lead is not None
    assert lead.lines == lead_of(named).lines
    assert sorted(made) == sorted(s.name for s in sections())


def test_a_name_says_what_it_leaves_in_its_own_sentence(named: Loop, strip: Diagnosis) -> None:
    assert lead_of(named).lines[1].endswith("misses, leaving noise alone.")
    assert strip.remaining.reduced_chi2 > 1.2
    (sentence,) = (s for s in lead_of(strip).lines if "viscoelastic" in s)
    times = strip.after.rmse_N / strip.noise.sd
    assert re.search(rf"leaving {times:.2g} times the noise, (mostly .*, )?(of no known kind|smooth as if)\b", sentence)


def test_the_small_table_has_the_numbers_of_the_json_answer(named: Loop, strip: Diagnosis) -> None:
    rounds = document(named)["rounds"]
    errors = [rounds[0]["error"], rounds[-1]["error"]]
    rows = lead_of(named).table.rows
    assert [r[0] for r in rows] == ["before", "after", "noise"]
    for (_, inside, held), error in zip(rows, errors, strict=False):
        assert inside == pytest.approx(1e3 * error["before"]["rmse_N"])
        assert held == pytest.approx(1e3 * error["heldout_before"]["rmse_N"])
    assert rows[2][1] == pytest.approx(1e3 * rounds[-1]["noise"]["sd_N"])
    answer, factor = document(strip)["error"], strip.rig.shown(strip.thickness)["N"][0]
    assert lead_of(strip).table.rows[0][1:] == pytest.approx(
        [factor * answer[k]["rmse_N"] for k in ("before", "heldout_before")]
    )
    answer = document(named.rounds[0].diagnosis)["error"]
    assert lead_of(named.rounds[0].diagnosis).table.rows[1][1:] == pytest.approx(
        [1e3 * answer[k]["rmse_N"] for k in ("after", "heldout_after")]
    )


def test_what_was_not_measured_is_called_so_in_title_legend_and_axes(named: Loop) -> None:
    d = named.rounds[0].diagnosis
    other = replace(d, measurement=replace(d.measurement, provenance=RECONSTRUCTED))
    content = compose([other])
    assert content.lead is not None
    assert content.title.startswith("What the reconstructed force curve of ")
    assert "(reconstructed, not measured)" in content.lead.brief.tested
    assert handles(steps_of(other), seen(other.measurement))[0].get_label() == "reconstructed"
    assert "reconstructed less fitted" in content.lead.figure.caption
    assert not any(re.match("Measured less fitted", s) for s in told(content))
    assert handles(steps_of(d), seen(d.measurement))[0].get_label() == "measured"


def test_an_estimate_at_its_bound_and_an_implausible_size_are_flagged_where_they_stand(named: Loop) -> None:
    d = only(named, "named")
    (member,) = d.members
    c = member.candidate
    place = c.hypothesis.names.index("friction.level")
    x = c.x.copy()
    x[place] *= 30
    far = replace(c, x=x, at_bound=("friction.level", "friction.travel"))
    flagged = replace(d, members=(replace(member, candidate=far),), best=far)
    size = re.search(r"friction in the guide \((.*?)\)", lead_of(flagged).brief.answer)
    assert size is not None
    assert re.fullmatch(r"level [\d.]+ mN, implausible: usual [\d.]+ mN, at its bound, travel at its bound", size[1]), (
        size[1]
    )
    assert sizes(far, d) == [size[1]]
    assert "implausible" not in lead_of(d).brief.answer
    assert "bound" not in lead_of(d).brief.answer
    assert "at a size that is hardly met" not in lead_of(replace(d, verdict="ambiguous")).brief.answer
    assert "at a size that is hardly met" in lead_of(replace(flagged, verdict="ambiguous")).brief.answer


def test_an_energy_that_is_sure_is_told_where_effects_stay_open(named: Loop) -> None:
    d = replace(only(named, "named"), verdict="ambiguous")
    assert words.other_energy(d) == ""
    sure = replace(d, probabilities=replace(d.probabilities, energies={"gent": 0.995, "yeoh": 0.005}))
    assert d.null.hypothesis.material.name != "gent"
    for told in (lead_of(sure).brief.answer, words.sentence(sure)):
        assert f"the energy is Gent (99.5 %), not {d.null.hypothesis.material.title}" in told
    assert words.other_energy(replace(sure, declared=False)) == ""


def test_of_one_explanation_that_is_not_sure_nobody_says_that_it_has_rivals(ambiguous: Loop) -> None:
    several = only(ambiguous, "ambiguous")
    one = replace(several, members=several.members[:1], experiments=())
    for found, rivals in ((several, True), (one, False)):
        said = " ".join((words.sentence(found), words.finding_sentence(found), *told(compose([found]))))
        for phrase in ("cannot tell which", "may be right", "tell them apart"):
            assert (phrase in said.lower()) is rivals, phrase
        assert ("most probably it is" in said) is not rivals
        assert ("another effect may be behind" in said) is not rivals


def test_a_strip_is_told_in_stretch_and_stress(strip: Diagnosis, tmp_path: Path) -> None:
    content = compose([strip])
    for s in told(content):
        assert not re.search(r"\d ?(mm|mN|N)\b|\((mm|mN|N)\)|deflection \(", s), s
    assert "a stretch of " in content.answer[0]
    assert content.lead is not None
    assert content.lead.table.columns[0].head.endswith("(MPa)")
    page = write_report([strip], tmp_path).read_text(encoding="utf-8")
    assert "lengths in mm" not in page


# ---- one quantity, one value, one name -------------------------------------------------------------------------------


def labelled(content: Content, models: tuple[str, str]) -> dict[tuple[str, str], list[tuple[float, str]]]:
    """{(model, quantity with its unit): [(value, where)]} of all tables with a row for each model, and of sentences.

    ``models`` are those that the first screen calls before and after.
    """
    found = defaultdict(list)
    assert content.lead is not None
    unit = re.findall(r"\((.*?)\)", content.lead.table.columns[0].head)[0]
    names = {"before": models[0], "as given": models[0], "after": models[1]}
    for row in content.lead.table.cells():
        if row[0] in names:
            for head, cell in zip(
                (f"root mean square ({unit})", f"held out: root mean square ({unit})"), row[1:], strict=True
            ):
                found[names[row[0]], head].append((number(cell), "first screen"))
    for table in (b for p in content.parts for b in p.blocks if isinstance(b, Table)):
        if table.columns[0].key not in ("model", "run"):
            continue
        for row in table.cells():
            for column, cell in zip(table.columns[1:], row[1:], strict=True):
                if re.fullmatch(r"[−-]?[\d.,]+( %)?", cell) and column.head not in ("+-", "sd"):
                    found[row[0].removesuffix(" (not added)"), column.head].append((number(cell), table.name))
    known = {name for name, _ in found}
    for sentence in told(content):
        for model, value, own in re.findall(r"([\w\s-]+?) \((?:rms residual )([\d.]+) (mN|MPa)\)", sentence):
            name = next((k for k in sorted(known, key=len, reverse=True) if model.endswith(k)), model)
            found[name, f"rms residual ({own})"].append((number(value), sentence))
        for model, value, own in re.findall(r": ([\w\s-]+?), root mean square ([\d.]+) (mN|MPa)", sentence):
            found[model, f"root mean square ({own})"].append((number(value), sentence))
    return dict(found)


def number(cell: str) -> float:
    return float(cell.replace("−", "-").replace(",", "").removesuffix(" %"))


def test_a_quantity_of_a_model_has_one_value_on_a_page(named: Loop, strip: Diagnosis) -> None:
    both = [s.run for s in (named.rounds[0].before, named.rounds[0].after)]
    runs = [read(run, predictions_of(run, Wanted(draws=20))) for run in both]
    models = [spoken(run.hypothesis) for run in both]
    pages = [
        labelled(compose([*runs, named]), (models[0], models[1])),
        labelled(compose([strip]), (spoken(strip.null.hypothesis), spoken(strip.best.hypothesis))),
    ]
    for found in pages:
        for key, values in found.items():
            for (a, one), (b, other) in itertools.combinations(values, 2):
                assert a == pytest.approx(b, rel=6e-3), (key, one, other)
    several = [key for key, values in pages[0].items() if len(values) > 1]
    assert {q for _, q in several} >= {"root mean square (mN)", "held out: root mean square (mN)", "rms residual (mN)"}


def test_where_loops_share_a_page_each_part_begins_with_its_own_first_screen(named: Loop, unknown: Loop) -> None:
    content = compose([named, unknown])
    assert content.lead is None
    first = [p.blocks[0] for p in content.parts if p.key.startswith("loop")]
    assert [b.brief for b in first if isinstance(b, Lead)] == [lead_of(x).brief for x in (named, unknown)]
    assert sum(t.name.startswith("first screen") for t in content.tables) == 2


def test_the_noise_has_one_size_and_one_name(named: Loop) -> None:
    content = compose([named])
    d = named.rounds[-1].diagnosis
    (row,) = (r for r in lead_of(named).table.rows if r[0] == "noise")
    assert row[1] == pytest.approx(1e3 * d.noise.sd)
    text = " ".join(told(content))
    for other in ("load cell's own noise", "measurement's own noise", "noise sd", "noise floor"):
        assert other not in text
    assert np.all(d.noise.each > 0)
