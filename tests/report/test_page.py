"""The page stands alone, shows names as they are, and says at the top what must not be overlooked."""

import json
import pickle
import re
import shutil
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bayesmembrane as bm
from bayesmembrane.calibration.beside_paper import Compared
from bayesmembrane.calibration.prediction_store import FILE
from bayesmembrane.calibration.run import Run, predictions_of
from bayesmembrane.ground.errors import SettingsError, StorageError
from bayesmembrane.ground.jobs import silent
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.cache import Tally
from bayesmembrane.reconstruction.result import Influence, LossCheck, RangeResult, Reconstruction
from bayesmembrane.reconstruction.rows import Correction, PredictedLoss, Suspect
from bayesmembrane.report.page import PAGE, TWIN, write_report
from bayesmembrane.report.runs import Shown, read
from tests.report.pages import without_pictures

COMPARED = (
    Compared("yeoh", "OP1", 0.035, 0.01, 0.01, 0.1, 0.09, 0.09, {"c1": 8.8}, {"c1": 8.8}, {"c1": 8.9}, ("c3_c1",)),
    Compared("neo_hookean", "OP1", 0.035, 0.23, None, None, None, None, {"c1": 7.6}, {}, {}),
)
VOID = {"meta", "img", "link", "br", "hr", "input"}


class Page(HTMLParser):
    """Tags with their attributes, text as it was before it was set in type, and whether all that opens closes."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.text = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data: str) -> None:
        for typed, plain in (("\u00b1", "+-"), ("\u2212", "-"), ("\u00b5", "u")):
            data = data.replace(typed, plain)
        self.text += data

    def all(self, tag: str) -> list[dict[str, Any]]:
        return [a for t, a in self.tags if t == tag]


def reconstruction() -> Reconstruction:
    x, f, sd = np.linspace(0.001, 0.035, 5), np.linspace(0.01, 2.2, 5), np.full(5, 5e-3)
    losses = (PredictedLoss("<OP1>", "0.1", 0.2, 0.01),)
    suspect = Suspect("yeoh", "INI", losses, 0.99, (Correction("c1", "7.0", 7.5, 7.5, 0.01),), ())
    return Reconstruction(
        (RangeResult("OP1", {5: 0.9, 6: 0.1}, {5: (0.0, 0.001)}, 0.001, 1e-5, x, f, sd),),
        np.diag(sd**2),
        tuple(LossCheck("yeoh", c, "OP1", 0.2, 0.2 + d, 0.2, 1e-3, 0.1) for c, d in (("INI", 0.06), ("OP1", 1e-3))),
        (suspect,),
        (Influence("curve twice as rough", f + 0.01, 0.1),),
        {},
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, yeoh: Shown, neo_hookean: Shown) -> Path:
    """A page about two runs with everything on it."""
    out = tmp_path_factory.mktemp("report")
    return write_report([yeoh, neo_hookean, reconstruction(), *COMPARED, Tally(hits=2, misses=1)], out)


@pytest.fixture(scope="module")
def page(whole: Path) -> Page:
    return Page(whole.read_text(encoding="utf-8"))


def test_the_page_needs_nothing_else(whole: Path, page: Page) -> None:
    for tag, attributes in page.tags:
        for name in ("src", "href", "srcset", "action", "data", "poster"):
            value = attributes.get(name) or ""
            assert value.startswith(("data:image/", "#")) or not value, f"<{tag} {name}={value[:40]}>"
    style = re.search(r"<style>(.*?)</style>", whole.read_text(encoding="utf-8"), re.DOTALL)
    assert style is not None
    assert not re.search(r"url\(|@import|//", style[1])
    assert not page.all("script")
    assert whole.stat().st_size < 8e6 / 5


def test_the_page_is_well_formed_and_its_contents_lead_somewhere(page: Page) -> None:
    assert page.open == []
    anchors = [a["id"] for _, a in page.tags if a.get("id")]
    assert len(anchors) == len(set(anchors))
    links = [a["href"] for a in page.all("a")]
    assert len(links) >= 8
    assert {link.lstrip("#") for link in links} <= set(anchors)


def test_every_figure_has_alt_text_and_a_caption_with_units(whole: Path, page: Page) -> None:
    figures = re.findall(r"<figure>(.*?)</figure>", whole.read_text(encoding="utf-8"), re.DOTALL)
    assert len(figures) == len(page.all("img")) >= 14
    for figure in figures:
        alt, caption = re.search(r'alt="([^"]{20,})"', figure), re.search(r"<figcaption>(.{60,}?)</figcaption>", figure)
        assert alt is not None
        assert caption is not None
        assert re.search(r"\((mm|N|mN|N/m|-|sd|ln\(N/m\))\)", caption[1]), caption[1]


def test_names_are_shown_as_they_are(whole: Path, page: Page) -> None:
    assert '<b>&"film' in page.text
    assert "bench <2> & 3" in page.text
    assert "over <OP1> printed 0.1 N, predicted 0.2 +- 0.01 N" in page.text
    assert "<b>" not in whole.read_text(encoding="utf-8")


def test_the_answer_comes_first_and_the_warning_before_it(page: Page) -> None:
    text = page.text
    box, answer, contents = (
        text.index("Not to be relied on"),
        text.index("Up to 35 mm (8 points), Yeoh"),
        text.index("Contents"),
    )
    assert box < answer < contents < text.index("How it was made")
    assert "neo-Hookean up to 35 mm: sampling stopped early (step limit)" in text[box:answer]
    assert "neo-Hookean (rms residual" in text[answer:contents]


@pytest.mark.usefixtures("blank_pictures")
def test_a_converged_run_has_no_warning(tmp_path: Path, yeoh: Shown) -> None:
    page = Page(write_report([yeoh], tmp_path).read_text(encoding="utf-8"))
    assert "Not to be relied on" not in page.text
    assert not [a for _, a in page.tags if a.get("role") == "alert"]
    assert "Sampling converged" in page.text


@pytest.mark.usefixtures("blank_pictures")
def test_numerical_failures_and_solvers_that_disagree_are_in_the_box(tmp_path: Path, yeoh: Shown) -> None:
    poor = replace(yeoh, outcomes={"ok": 900, "unresolved": 100}, crosscheck={**yeoh.crosscheck, "largest": 2e-4})
    text = Page(write_report([poor], tmp_path).read_text(encoding="utf-8")).text
    box = text[text.index("Not to be relied on") : text.index("Up to 35 mm (8 points), Yeoh")]
    assert "10 % of the films could not be computed" in box
    assert "disagree by up to 2.0e-04" in box


@pytest.mark.usefixtures("blank_pictures")
def test_a_run_without_prior_draws_or_states_is_still_shown(tmp_path: Path, yeoh: Shown) -> None:
    d = yeoh.digest
    lost = replace(
        d,
        curve=np.where(d.beyond, np.nan, d.curve),
        lost=d.beyond.astype(float)[None],
        reasons=("locked",),
        state_1=np.full_like(d.state_1, np.nan),
        state_2=np.full_like(d.state_2, np.nan),
        break_predicted=np.full_like(d.break_predicted, np.nan),
        break_lost=np.ones_like(d.break_lost),
    )
    bare = replace(yeoh, prior=np.empty((0, yeoh.x.shape[1])), digest=lost)
    text = Page(write_report([bare], tmp_path).read_text(encoding="utf-8")).text
    assert "nothing can be said by Yeoh (locked for 100 % of the draws)" in text
    assert "nan" not in text.lower().replace("nano", "")


def test_what_others_draw_is_what_is_drawn_here(tmp_path: Path, yeoh: Shown, neo_hookean: Shown) -> None:
    sent = []

    def submit(work: Callable[..., Any], *given: Any) -> Future[Any]:
        sent.append(pickle.dumps((work, given)))
        work, given = pickle.loads(sent[-1])
        done: Future[Any] = Future()
        done.set_result(pickle.loads(pickle.dumps(work(*given, silent))))
        return done

    results = [yeoh, neo_hookean, reconstruction()]
    by_others = write_report(results, tmp_path / "by others", submit=submit)
    assert len(sent) == 2
    here = write_report(results, tmp_path / "here")
    for name in (here.name, TWIN):
        assert (by_others.parent / name).read_bytes() == (here.parent / name).read_bytes()


def test_the_twin_holds_the_tables_as_numbers(whole: Path) -> None:
    twin = json.loads((whole.parent / TWIN).read_text(encoding="utf-8"))
    fits = {row["run"]: row for row in twin["tables"]["fits"]}
    assert fits["Yeoh"]["verdict"] == "describes the curve"
    assert fits["neo-Hookean"]["rmse_mN"] > 20
    losses = twin["tables"]["losses"]
    assert [row["material"] for row in losses] == ["neo-Hookean", "Yeoh"]
    assert losses[1]["ratio"] == pytest.approx(0.01 / 0.09)
    assert losses[0]["paper_evaluated_N"] is None
    names = list(twin["tables"])
    assert len(names) == len(set(names))
    assert any(s.startswith("Up to 35 mm") for s in twin["answer"])


def test_the_cache_is_told(whole: Path, page: Page) -> None:
    yeoh, _, total = json.loads((whole.parent / TWIN).read_text(encoding="utf-8"))["tables"]["cache"]
    assert (yeoh["hits"], yeoh["misses"], yeoh["bypassed"]) == (3, 1, 70)
    assert (total["hits"], total["misses"]) == (2, 1)
    assert "solved directly" in page.text


def test_a_stored_run_is_reported_twice_into_the_same_folder(tmp_path: Path, stored: Run) -> None:
    assert stored.path is not None
    first = write_report([stored.path], tmp_path / "report").read_bytes()
    second = write_report([stored], tmp_path / "report", "again & again").read_bytes()
    assert b"<title>again &amp; again</title>" in second
    assert len(first) > 100_000
    assert sorted(p.name for p in (tmp_path / "report").iterdir()) == [PAGE, TWIN]


def test_what_is_read_is_what_was_stored(stored: Run) -> None:
    shown = read(stored)
    assert shown.x.shape == (len(stored.draws()), 2)
    assert shown.case.status == stored.status["status"]
    assert shown.sampling.means.shape[0] == 2
    assert shown.facts["seed"] == 0
    assert shown.film.name == '<b>&"film'


def test_predictions_are_read_back_unless_something_else_is_asked(stored: Run) -> None:
    assert stored.path is not None
    before = (stored.path / FILE).read_bytes()
    again = predictions_of(stored)
    assert (stored.path / FILE).read_bytes() == before
    assert again.specimens == ("1", "2")


def test_folders_with_nothing_to_show_are_named(tmp_path: Path, stored: Run) -> None:
    with pytest.raises(StorageError, match="nothing: there is no such folder"):
        write_report([tmp_path / "nothing"], tmp_path / "report")
    (tmp_path / "empty").mkdir()
    with pytest.raises(StorageError, match=r"empty: nothing that a report can show"):
        write_report([tmp_path / "empty"], tmp_path / "report")
    with pytest.raises(SettingsError, match="needs something to show"):
        write_report([], tmp_path / "report")
    with pytest.raises(SettingsError, match="no section of the report shows a float"):
        write_report([1.0], tmp_path / "report")
    assert not (tmp_path / "report").exists()


@pytest.mark.usefixtures("blank_pictures")
def test_a_run_that_is_not_stored_has_a_page_all_the_same(tmp_path: Path, stored: Run) -> None:
    free = replace(stored, path=None)
    assert free.name in repr(free)
    page = bm.report(free, out=tmp_path / "report").read_text()
    assert "<figure>" in page
    assert "Curves and residuals" in page


def test_a_damaged_run_is_named_and_not_passed_over(tmp_path: Path, stored: Run) -> None:
    assert stored.path is not None
    copy = tmp_path / "chains" / "run"
    shutil.copytree(stored.path, copy)
    (copy / "posterior.nc").write_bytes(b"no posterior")
    with pytest.raises(StorageError, match="run"):
        write_report([tmp_path / "chains"], tmp_path / "report")


@pytest.mark.usefixtures("blank_pictures")
def test_a_folder_of_runs_shows_each_once(tmp_path: Path, stored: Run) -> None:
    assert stored.path is not None
    for name in ("a", "b"):
        shutil.copytree(stored.path, tmp_path / "chains" / name)
    write_report([tmp_path / "chains"], tmp_path / "report")
    twin = json.loads((tmp_path / "report" / TWIN).read_text(encoding="utf-8"))
    assert [row["what"] for row in twin["tables"]["glance"]] == ["calibration"] * 2
    assert len(twin["tables"]["fits"]) == 2
    # Two runs of one hypothesis have tables of the same name: neither hides the other.
    assert sum(name.startswith("parameters neo_hookean-35mm") for name in twin["tables"]) == 2
    anchors = re.findall(r'<section id="([^"]*)"', (tmp_path / "report" / PAGE).read_text(encoding="utf-8"))
    assert len(anchors) == len(set(anchors))


def test_the_general_table_comes_first_and_has_a_row_for_every_answer(whole: Path, page: Page) -> None:
    rows = json.loads((whole.parent / TWIN).read_text(encoding="utf-8"))["tables"]["glance"]
    assert sorted(r["what"] for r in rows) == ["calibration", "calibration", "reconstruction"]
    assert next(r["found"] for r in rows if "neo-Hookean" in r["about"]).endswith("misses something; step limit")
    assert (
        page.text.index("Contents") < page.text.index("one row for each answer") < page.text.index("Force (N) against")
    )


@pytest.mark.usefixtures("blank_pictures")
def test_a_reconstruction_stands_alone(tmp_path: Path) -> None:
    page = Page(write_report([reconstruction()], tmp_path).read_text(encoding="utf-8"))
    assert page.text.count("The curve is not raw data") == 2  # at the top, and in its section
    assert [a["id"] for t, a in page.tags if t == "section"] == ["answer", "glance", "reconstruction"]


@pytest.mark.parametrize("name", [PAGE, TWIN])
def test_a_foreign_file_is_never_overwritten(tmp_path: Path, stored: Run, name: str) -> None:
    (tmp_path / name).write_text("<html>mine</html>")
    with pytest.raises(StorageError, match="nothing is overwritten"):
        write_report([stored], tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "<html>mine</html>"


@pytest.mark.usefixtures("blank_pictures")
def test_a_folder_that_cannot_be_written_is_one_sentence(tmp_path: Path, yeoh: Shown) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(StorageError, match="cannot be written"):
        write_report([yeoh], tmp_path / "file" / "report")


@pytest.mark.usefixtures("blank_pictures")
def test_a_stored_reconstruction_gives_the_same_page(tmp_path: Path) -> None:
    store(tmp_path / "answer", "reconstruction", reconstruction(), {})
    stored, held = (
        write_report([found], tmp_path / "page").read_text() for found in (tmp_path / "answer", reconstruction())
    )
    assert without_pictures(stored) == without_pictures(held)
