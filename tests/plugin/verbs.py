"""Verbs one after the other in one process, as fresh ones take longer than their work: their JSON answers in a list.

python verbs.py '[["fit", "strip.csv", ...], ...]'
"""

from __future__ import annotations

import json
import sys
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

from bayesmembrane.app.cli import main
from bayesmembrane.comparison import compare
from tests.report.blank import blank
from tests.short_walks import shorten


def answer(words: list[str]) -> Any:
    """The JSON answer of one verb; what it says on stderr stays there, and a failure ends it all."""
    sys.argv, said = ["bayesmembrane", *words, "--json"], StringIO()
    try:
        with redirect_stdout(said):
            main()
    except SystemExit as end:
        if end.code:
            raise
    return json.loads(said.getvalue())


if __name__ == "__main__":
    commands = json.loads(sys.argv[1])
    shorten()
    blank()
    compare.cores = lambda: 1
    print(json.dumps([answer(words) for words in commands]))
