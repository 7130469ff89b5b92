"""``campaign``: many hypotheses on many measurements, overnight, on one machine or a cluster."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bayesmembrane.app.options import OptionGroup
from bayesmembrane.app.terminal import INTERRUPTED, answer, live, note, say
from bayesmembrane.ground.errors import SettingsError

if TYPE_CHECKING:
    from bayesmembrane.campaign.plan import Plan
    from bayesmembrane.campaign.status import Standing

place = 11.5

AGAIN = 2.0  # s between two looks of --follow


class Action(StrEnum):
    """What is asked of a campaign."""

    RUN = "run"
    STATUS = "status"
    RESUME = "resume"
    REPORT = "report"


@dataclass(frozen=True)
class CampaignOptions(OptionGroup):
    """How a campaign is run."""

    cluster: Annotated[
        str | None, typer.Option("--cluster", help="Run on the Dask scheduler at this address, or of this file.")
    ] = None
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes on this machine; one for each core without.")
    ] = None
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would run, and for how long.")] = False
    follow: Annotated[bool, typer.Option("--follow", help="status: look again until all is done.")] = False
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="Instead of the seed in the file.")] = None
    as_json: Annotated[bool, typer.Option("--json", help="One JSON document on stdout; logs go to stderr.")] = False


def verb(
    action: Annotated[Action, typer.Argument(help="run FILE, status DIR, resume DIR or report DIR.", metavar="ACTION")],
    target: Annotated[
        Path, typer.Argument(help="The campaign file (run), or the campaign's folder.", metavar="TARGET")
    ],
    how: CampaignOptions,
    out: Annotated[
        Path | None, typer.Option("--out", help="run: folder of the campaign. report: folder of the page.")
    ] = None,
) -> None:
    """Many hypotheses on many measurements: run FILE, status DIR, resume DIR, report DIR."""
    _refuse_idle(action, how, out)
    ACTIONS[action](target, how, out)


def _refuse_idle(action: Action, how: CampaignOptions, out: Path | None) -> None:
    """Raise `SettingsError` for an option that says nothing to this action."""
    works = {Action.RUN, Action.RESUME}
    idle = {
        "--cluster": how.cluster is not None and action not in works,
        "--workers": how.workers is not None and action not in works,
        "--dry-run": how.dry_run and action not in works,
        "--follow": how.follow and action is not Action.STATUS,
        "--seed": how.seed is not None and action is not Action.RUN,
        "--out": out is not None and action not in (Action.RUN, Action.REPORT),
    }
    for option, given in idle.items():
        if given:
            raise SettingsError(f"campaign {action.value} does nothing with it", option, "leave it out")
    if how.cluster is not None and how.workers is not None:
        raise SettingsError("workers are those of the cluster or of this machine", "--cluster, --workers", "give one")


# ---- run and resume --------------------------------------------------------------------------------------------------


def run(file: Path, how: CampaignOptions, out: Path | None) -> None:
    """Plan the campaign of a file and do it; what is done stays done."""
    from bayesmembrane.campaign.file import read_campaign
    from bayesmembrane.campaign.plan import write_plan
    from bayesmembrane.campaign.planning import campaign_folder, plan

    asked = read_campaign(file)
    folder = campaign_folder(asked, file) if out is None else out
    made = plan(asked, file, how.seed)
    if how.dry_run:
        _dry_run(folder, made, how)
        return
    write_plan(folder, made)
    _work(folder, made, how)


def resume(folder: Path, how: CampaignOptions, _: Path | None) -> None:
    """Go on with the campaign in a folder."""
    from bayesmembrane.campaign.plan import read_plan

    made = read_plan(folder)
    if how.dry_run:
        _dry_run(folder, made, how)
    else:
        _work(folder, made, how)


def _work(folder: Path, made: Plan, how: CampaignOptions) -> None:
    from bayesmembrane.campaign.drive import INTERRUPTED as STOPPED
    from bayesmembrane.campaign.drive import drive
    from bayesmembrane.campaign.page import write_morning_page

    note(f"{len(made.tasks)} tasks in {folder}; to see how far they are: bayesmembrane campaign status {folder}")
    with live() as shown:
        ended = drive(folder, made, lambda: _executor(how), _session(folder, made, shown))
    if ended.how == STOPPED:
        note(f"Interrupted; what is done is stored in {folder}. To go on: {_again(folder, how)}")
        raise typer.Exit(INTERRUPTED)
    page = write_morning_page(folder)
    found = _standing(folder)
    document = {**found.document(), "ended": ended.how, "seconds": ended.seconds, "report": str(page)}
    answer(document, how.as_json, lambda: _say_end(found, page, how))


def _session(folder: Path, made: Plan, shown: Callable[[Any], None]) -> Any:
    from bayesmembrane.app.standing import tables
    from bayesmembrane.app.tasks import perform
    from bayesmembrane.campaign.drive import Session
    from bayesmembrane.campaign.status import standing_of

    return Session(perform, made.deadline, lambda index: shown(tables(standing_of(folder, index))))


def _executor(how: CampaignOptions) -> Any:
    from bayesmembrane.campaign.cluster import DaskCluster
    from bayesmembrane.campaign.pool import LocalPool

    return LocalPool(how.workers) if how.cluster is None else DaskCluster(how.cluster)


def _again(folder: Path, how: CampaignOptions) -> str:
    """The command that goes on."""
    words = ["bayesmembrane", "campaign", "resume", str(folder)]
    words += [] if how.cluster is None else ["--cluster", how.cluster]
    words += [] if how.workers is None else ["--workers", str(how.workers)]
    return shlex.join(words)


def _say_end(found: Standing, page: Path, how: CampaignOptions) -> None:
    from bayesmembrane.app.standing import tables
    from bayesmembrane.app.terminal import show

    show(tables(found))
    if not found.finished:
        say(f"To go on: {_again(found.folder, how)}")
    say(f"The report lies in {page}")


def _dry_run(folder: Path, made: Plan, how: CampaignOptions) -> None:
    from bayesmembrane.app.estimates import estimated, show_estimate
    from bayesmembrane.app.terminal import status as line

    executor = _executor(how)
    workers = executor.workers()
    executor.close()
    with line("Timing a run of each kind") as tell:
        found = estimated(folder, made, workers, tell)
    answer(found.document(), how.as_json, lambda: show_estimate(found))


# ---- status and report -----------------------------------------------------------------------------------------------


def status(folder: Path, how: CampaignOptions, _: Path | None) -> None:
    """Where the campaign in a folder stands; with --follow until nobody works on it any more."""
    from bayesmembrane.app.standing import tables
    from bayesmembrane.app.terminal import show

    found = _standing(folder)
    if how.follow and not how.as_json:
        with live() as shown:
            while found.active:
                shown(tables(found))
                time.sleep(AGAIN)
                found = _standing(folder)
    answer(found.document(), how.as_json, lambda: show(tables(found)))


def report(folder: Path, how: CampaignOptions, out: Path | None) -> None:
    """The page about the campaign in a folder."""
    from bayesmembrane.campaign.page import write_morning_page

    page = write_morning_page(folder, out)
    document = {"report": str(page), **_standing(folder).document()}
    answer(document, how.as_json, lambda: say(f"The report lies in {page}"))


def _standing(folder: Path) -> Standing:
    from bayesmembrane.campaign.status import standing

    return standing(folder)


ACTIONS = {Action.RUN: run, Action.RESUME: resume, Action.STATUS: status, Action.REPORT: report}
