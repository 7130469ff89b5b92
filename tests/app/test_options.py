"""Options said once: groups become options of every verb that takes them."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from bayesmembrane.app import verbs
from bayesmembrane.app.cli import assembled
from bayesmembrane.app.options import OptionGroup, RangeOption, RangesOption, spread
from bayesmembrane.ground.errors import SettingsError

NAMES = [m.name for m in pkgutil.iter_modules(verbs.__path__)]


@dataclass(frozen=True)
class Pair(OptionGroup):
    first: Annotated[int, typer.Option("--first", help="One.")]
    second: Annotated[float, typer.Option("--second", help="Two.")] = 2.5


def told(
    where: Annotated[Path, typer.Argument()], pair: Pair, loud: Annotated[bool, typer.Option("--loud")] = False
) -> None:
    """Say what came."""
    typer.echo(f"{where} {pair.first} {pair.second} {loud}")


def test_the_fields_of_a_group_are_options_and_come_as_one_value() -> None:
    app = typer.Typer()
    app.command()(spread(told))
    assert CliRunner().invoke(app, ["here", "--first", "1"]).stdout == "here 1 2.5 False\n"
    assert CliRunner().invoke(app, ["here", "--first", "1", "--second", "3", "--loud"]).stdout == "here 1 3.0 True\n"
    assert CliRunner().invoke(app, ["here"]).exit_code == 2
    assert list(inspect.signature(spread(told)).parameters) == ["where", "first", "second", "loud"]


@pytest.mark.parametrize("name", NAMES)
def test_every_verb_takes_json_seed_and_out(name: str) -> None:
    verb = importlib.import_module(f"{verbs.__name__}.{name}").verb
    hints = [p.annotation for p in inspect.signature(spread(verb)).parameters.values()]
    options = {text for hint in hints for part in hint.__metadata__ for text in (part.param_decls or (part.default,))}
    assert {"--json", "--seed", "--out"} <= options


def test_the_program_has_a_command_for_every_file() -> None:
    found = {command.name for command in assembled().registered_commands}
    assert found == {name.rstrip("_") for name in NAMES}
    assert {"force", "import", "fit", "sample", "compare", "report", "demo"} <= found


def test_ranges_are_metres_and_faults_name_the_option() -> None:
    assert RangesOption("35.1,91.5").ends == pytest.approx([0.0351, 0.0915])
    assert RangesOption().ends == []
    assert RangeOption().max_deflection_mm is None
    with pytest.raises(SettingsError, match="--ranges-mm"):
        _ = RangesOption("35.1;91.5").ends
