"""Where a campaign stands, as tables on the terminal."""

from __future__ import annotations

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from bayesmembrane.campaign.record import FAILED, REFUSED, STATES
from bayesmembrane.campaign.status import Running, Standing

MOST_REASONS = 8


def tables(found: Standing) -> RenderableType:
    """Tasks by analysis and state; what is running, and how far; why tasks are not done; time left."""
    parts: list[RenderableType] = [_counts(found)]
    if found.running:
        parts.append(_running(found.running))
    if found.reasons:
        parts.append(_reasons(found))
    parts += [Text(sentence) for sentence in sentences(found)]
    return Group(*parts)


def _counts(found: Standing) -> Table:
    shown = Table(title=Text(f"Campaign {found.name}"), title_justify="left")
    shown.add_column("analysis")
    for state in STATES:
        shown.add_column(state, justify="right", style="red" if state in (FAILED, REFUSED) else "")
    for analysis, of in found.counts.items():
        shown.add_row(analysis, *(str(of.get(state, 0) or "") for state in STATES))
    if len(found.counts) > 1:
        shown.add_row("all", *(str(count or "") for count in found.total.values()), end_section=True)
    return shown


def _running(tasks: tuple[Running, ...]) -> Table:
    shown = Table(title=Text("Running"), title_justify="left")
    for name in ("measurement", "hypothesis", "doing"):
        shown.add_column(name, overflow="fold")
    for name in ("ESS", "tau", "acceptance", "left"):
        shown.add_column(name, justify="right")
    for task in tasks:
        ess = "" if task.ess is None else f"{task.ess:.0f} of {task.wanted or 0:.0f}"
        texts = [task.film, task.label or task.analysis, f"{task.analysis}: {task.doing}", ess]
        numbers = [_number(task.tau, ".1f"), _number(task.acceptance, ".2f"), duration(task.seconds_left)]
        shown.add_row(*(Text(text) for text in (*texts, *numbers)))
    return shown


def _reasons(found: Standing) -> Table:
    shown = Table(title=Text("Not done, by reason"), title_justify="left")
    shown.add_column("tasks", justify="right")
    shown.add_column("state")
    shown.add_column("reason", overflow="fold")
    for state, reason, count in found.reasons[:MOST_REASONS]:
        shown.add_row(str(count), state, Text(reason))
    return shown


def sentences(found: Standing) -> list[str]:
    """How the sampled runs are, and how long the rest takes."""
    said, of = [], found.sampled
    if of["least_ess"] is not None:
        least, mean = (_number(of[name], ".0f") for name in ("least_ess", "mean_ess"))
        said.append(
            f"Sampled runs: ESS {least} at least and {mean} in the mean, "
            f"tau {_number(of['largest_tau'], '.1f')} at most, acceptance {_number(of['mean_acceptance'], '.2f')}; "
            f"unsolved {100 * (of['most_failed'] or 0.0):.2g} % of the proposals at most."
        )
    if found.seconds_left and found.active:
        said.append(f"About {duration(found.seconds_left)} left.")
    if not found.active and not found.finished:
        said.append(f"Nobody works on it. To go on: bayesmembrane campaign resume {found.folder}")
    return said


def _number(value: float | None, form: str) -> str:
    return "" if value is None else f"{value:{form}}"


def duration(seconds: float | None) -> str:
    """``45 s``, ``12 min``, ``3.5 h``; "" if it is not known."""
    if seconds is None:
        return ""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
