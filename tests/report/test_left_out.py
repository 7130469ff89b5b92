"""What cannot be read is left out with a sentence, and what was not computed is not computed for the page."""

import json
import re
import shutil
from collections.abc import Callable
from html import unescape
from pathlib import Path

import pytest

from bayesmembrane.app import analyses, door
from bayesmembrane.app.analyses import Work
from bayesmembrane.app.verbs import report as report_verb
from bayesmembrane.calibration.fit import Fit, fit
from bayesmembrane.calibration.prediction_store import FILE
from bayesmembrane.calibration.run import Run, load_run, predictions_of
from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.stored import store
from bayesmembrane.physics.hypothesis import hypothesis
from bayesmembrane.physics.mechanics import api
from bayesmembrane.report.page import PAGE, TWIN, write_report
from tests.report.conftest import measured

pytestmark = pytest.mark.usefixtures("blank_pictures")


@pytest.fixture(scope="module")
def fitted() -> Fit:
    return fit(measured(), hypothesis("neo_hookean"))


@pytest.fixture
def nothing_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    def solved(*_: object, **__: object) -> None:
        raise AssertionError("a film was solved for the page")

    monkeypatch.setattr(api, "SOLVERS", dict.fromkeys(api.SOLVERS, solved))
    monkeypatch.setattr(api, "profile", solved)
    monkeypatch.setattr("bayesmembrane.physics.forward.Forward.__call__", solved)


def older(folder: Path) -> None:
    """The answer as a version with another format wrote it."""
    path = folder / "fit.json"
    path.write_text(re.sub(r'"format": \d+', '"format": 0', path.read_text(), count=1))


def damaged(folder: Path) -> None:
    path = folder / "fit.npz"
    path.write_bytes(path.read_bytes()[:-9])


def cut_short(folder: Path) -> None:
    path = folder / "fit.json"
    path.write_text(path.read_text()[:200])


def without_draws(folder: Path) -> None:
    (folder / "posterior.nc").write_bytes(b"no posterior")


def unsealed(folder: Path) -> Path:
    """The run without checksums, as an earlier version wrote it."""
    status = json.loads((folder / "status.json").read_text())
    kept = {name: value for name, value in status.items() if "sha256" not in name}
    (folder / "status.json").write_text(json.dumps(kept))
    (folder / "run.toml").write_text((folder / "run.toml").read_text().partition("\n")[2])
    return folder


def older_run(folder: Path) -> None:
    """A run whose status had no tally yet."""
    status = json.loads((unsealed(folder) / "status.json").read_text())
    del status["tally"]
    (folder / "status.json").write_text(json.dumps(status))


def strange_run(folder: Path) -> None:
    """A run of an energy that is not installed here."""
    path = unsealed(folder) / "run.toml"
    path.write_text(path.read_text().replace('"neo_hookean"', '"isihara"'))


def without_its_question(folder: Path) -> None:
    (folder / "run.toml").unlink()


def unpredicted(folder: Path) -> None:
    (folder / FILE).unlink()


FITS = {older: "this version reads format", damaged: "is not what was written", cut_short: "no whole JSON document"}
RUNS = {
    without_draws: "the run is damaged",
    older_run: "another version wrote the run",
    strange_run: 'no material called "isihara"',
    without_its_question: "run.toml is missing",
    unpredicted: "ask for the same again",
}


def spoilt(spoil: Callable[[Path], None], place: Path, fitted: Fit, stored: Run) -> Path:
    """A folder in ``place`` with an answer that cannot be read."""
    folder = place / spoil.__name__
    if spoil in FITS:
        store(folder, "fit", fitted, {})
    else:
        assert stored.path is not None
        shutil.copytree(stored.path, folder)
    spoil(folder)
    return folder


def test_what_cannot_be_read_is_left_out_and_the_rest_is_shown(tmp_path: Path, fitted: Fit, stored: Run) -> None:
    chains, told = tmp_path / "chains", list[str]()
    store(chains / "good", "fit", fitted, {})
    why = {spoilt(spoil, chains, fitted, stored): said for spoil, said in (FITS | RUNS).items()}
    page = write_report([chains], tmp_path / "page", tell=told.append)
    text = unescape(page.read_text())
    assert len(told) == len(why)
    for folder, said in why.items():
        (sentence,) = (s for s in told if re.search(rf"{re.escape(str(folder))}[:/]", s))
        assert sentence.startswith("Left out: ")
        assert sentence.endswith(".")
        assert said in sentence
        assert ";" in sentence, "it says how to mend it"
        assert sentence in text
    twin = json.loads((page.parent / TWIN).read_text())
    assert twin["left_out"] == told
    assert [row["what"] for row in twin["tables"]["glance"]] == ["fit"]


def test_a_page_without_anything_left_out_says_nothing_of_it(tmp_path: Path, fitted: Fit) -> None:
    page = write_report([fitted], tmp_path)
    assert "Left out" not in page.read_text()
    assert json.loads((tmp_path / TWIN).read_text())["left_out"] == []


@pytest.mark.parametrize("spoil", [*FITS, *RUNS], ids=lambda spoil: spoil.__name__)
def test_where_nothing_can_be_read_that_is_the_error(
    spoil: Callable[[Path], None], tmp_path: Path, fitted: Fit, stored: Run
) -> None:
    spoilt(spoil, tmp_path / "chains", fitted, stored)
    with pytest.raises(Exception, match=re.escape((FITS | RUNS)[spoil])) as one:
        write_report([tmp_path / "chains"], tmp_path / "page")
    spoilt(damaged, tmp_path / "chains" / "more", fitted, stored)
    (tmp_path / "chains" / "more" / "damaged").rename(tmp_path / "chains" / "z")
    with pytest.raises(StorageError, match="none of the 2 stored answers can be read, the first because") as both:
        write_report([tmp_path / "chains"], tmp_path / "page")
    assert ";" in str(one.value)
    assert ";" in str(both.value)
    assert not (tmp_path / "page").exists()


def test_the_library_warns_of_what_it_leaves_out(tmp_path: Path, fitted: Fit, stored: Run) -> None:
    folder = spoilt(older, tmp_path, fitted, stored)
    with pytest.warns(UserWarning, match=f"Left out: {re.escape(str(folder))}"):
        door.report(fitted, folder, out=tmp_path / "page")


def test_the_command_says_it_on_stderr_and_in_its_answer(
    tmp_path: Path, fitted: Fit, stored: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    store(tmp_path / "chains" / "good", "fit", fitted, {})
    spoilt(damaged, tmp_path / "chains", fitted, stored)
    from bayesmembrane.app.options import OutputOptions

    report_verb.verb([tmp_path / "chains"], OutputOptions(as_json=True, seed=0), tmp_path / "page", None)
    out, err = capsys.readouterr()
    (sentence,) = json.loads(out)["left_out"]
    assert " ".join(err.split()) == sentence


def test_the_command_says_what_cannot_be_read_and_what_is_no_folder(tmp_path: Path, fitted: Fit, stored: Run) -> None:
    from bayesmembrane.app.options import OutputOptions

    garbage = store(tmp_path / "odd" / "a", "fit", fitted, {}) / "fit.json"
    garbage.write_text("garbage")
    spoilt(without_its_question, tmp_path / "old", fitted, stored)
    wrong = {
        tmp_path / "odd": rf"{re.escape(str(garbage))}: the stored fit cannot be read \(it is no whole JSON document\)",
        tmp_path / "old": r"old/without_its_question: the run cannot be read \(run.toml is missing\)",
        tmp_path / "absent": "absent: there is no such folder",
        garbage: "fit.json: this is a file and no folder",
    }
    for place, said in wrong.items():
        with pytest.raises(StorageError, match=said):
            report_verb.verb([place], OutputOptions(as_json=True, seed=0), tmp_path / "page", None)
    assert not (tmp_path / "page").exists()


# ---- nothing is solved -----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("nothing_is_solved")
def test_a_page_about_a_stored_run_solves_nothing(tmp_path: Path, stored: Run) -> None:
    assert stored.path is not None
    assert write_report([stored.path], tmp_path / "page").is_file()


@pytest.mark.usefixtures("nothing_is_solved")
def test_of_a_run_without_predictions_no_page_makes_them(tmp_path: Path, stored: Run) -> None:
    assert stored.path is not None
    shutil.copytree(stored.path, tmp_path / "run")
    (tmp_path / "run" / FILE).unlink()
    for found in (tmp_path / "run", load_run(tmp_path / "run")):
        with pytest.raises(StorageError, match="a report solves no films"):
            write_report([found], tmp_path / "page")
    assert not (tmp_path / "run" / FILE).exists()


def test_once_they_are_made_it_is_shown(tmp_path: Path, stored: Run) -> None:
    assert stored.path is not None
    shutil.copytree(stored.path, tmp_path / "run")
    (tmp_path / "run" / FILE).unlink()
    predictions_of(load_run(tmp_path / "run"))
    assert write_report([tmp_path / "run"], tmp_path / "page").is_file()


def test_an_interrupted_run_has_a_page_that_says_so(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    found = analyses.sample(measured(), hypothesis("neo_hookean"), Work(out=tmp_path / "chains", tell=stop))
    assert found.result.interrupted
    request.getfixturevalue("nothing_is_solved")
    write_report([tmp_path / "chains"], tmp_path / "page")
    text = (tmp_path / "page" / PAGE).read_text()
    assert "Not to be relied on" in text
    assert "interrupted" in text
