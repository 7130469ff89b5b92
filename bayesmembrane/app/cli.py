"""The command line: assembles the verbs that it finds in `app.verbs`, and turns errors into sentences and statuses."""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys

import typer
from typer.main import get_command

from bayesmembrane.app import verbs
from bayesmembrane.app.options import spread
from bayesmembrane.app.terminal import INTERRUPTED, note, ready
from bayesmembrane.ground.errors import BayesmembraneError
from bayesmembrane.ground.interrupts import raised

# The matrices are small: threads inside BLAS only get into each other's way. Set before NumPy is imported.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


def assembled() -> typer.Typer:
    """The program: a command for every file in `app.verbs`, in the order that their ``place`` says."""
    app = typer.Typer(
        add_completion=False,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        help="From a measured force curve to a calibrated film, with its uncertainty.",
    )
    names = [m.name for m in pkgutil.iter_modules(verbs.__path__)]
    found = {name: importlib.import_module(f"{verbs.__name__}.{name}") for name in names}
    for name, module in sorted(found.items(), key=lambda item: item[1].place):
        # A file cannot be called as a word of the language: import_.py is the verb import.
        app.command(name.rstrip("_"))(spread(module.verb))
    return app


def main() -> None:
    """Run a verb. Exit status: 0 done; 1 wrong data or settings, in one sentence; 2 wrong usage; 130 interrupted."""
    ready()
    try:
        with raised():  # the signal by which clusters and shutdowns end programs, as Ctrl-C
            # Not by calling it: that sets a hook of its own for what nobody catches (`insistent`).
            get_command(assembled())(standalone_mode=True)
    except BayesmembraneError as error:
        note(str(error))
        sys.exit(1)
    except KeyboardInterrupt:
        note("Interrupted.")
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
