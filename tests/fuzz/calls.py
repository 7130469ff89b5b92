"""Calls of the command line in this process, and the judgement of what came out."""

from __future__ import annotations

import io
import json
import re
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fuzz.cases import Case
from tests.fuzz.package import main

LIMIT = {"fit": 60.0, "sample": 120.0, "diagnose": 120.0}
"""Seconds of the process after which a call is given up: what takes minutes is no answer to a small curve."""
GOOD = ("answered", "refused")
SOLVER = " problem"
"""The function that checks what a solver is given: what it refuses came from inside, for a user gives it nothing."""
VERDICTS = ("adequate", "named", "ambiguous", "material", "unknown")
_NO_NUMBER = re.compile(r"(?<![\w-])(nan|inf|None|-inf)(?![\w-])")


class TimeUpError(BaseException):
    """The time of a call is over; not an `Exception`, so that no handler takes it for a fault of the data."""


@dataclass(frozen=True)
class Row:
    """What came of one call.

    outcome : one of `GOOD`; "traceback", "timeout"; "no sentence" for a refusal that is not one sentence with a remedy;
    "inner refusal" for one that blames the user for what came from inside; "wrong answer" for a document
    that is not JSON or contradicts itself; "warned" for a warning that reached the user
    sentence : the refusal, or what is wrong
    """

    seed: int
    verb: str
    arguments: str
    exit: int
    seconds: float
    outcome: str
    sentence: str


def call(case: Case, folder: Path, limit: float | None = None) -> Row:
    """The call of ``case`` with its files in ``folder``, judged."""
    out, err = io.StringIO(), io.StringIO()
    arguments = case.arguments(folder)
    begun, code, refused, fault = time.process_time(), 0, None, ("", "")
    with warnings.catch_warnings(record=True) as told, redirect_stdout(out), redirect_stderr(err):
        # Rather than as a default, so that a place that warned in an earlier call is heard in this one too.
        warnings.simplefilter("always", RuntimeWarning)
        try:
            with _limited(limit or LIMIT[case.verb]):
                code, refused = _exit_status(arguments)
        except (TimeUpError, Exception) as error:
            fault = "traceback", f"{type(error).__name__}: {_one_line(str(error))} at {_place(error)}"
            if _is_time_up(error):
                fault = "timeout", f"no answer in {limit or LIMIT[case.verb]:g} s, at {_place(error)}"
    seconds = time.process_time() - begun
    if refused is not None and (place := _place(refused)).endswith(SOLVER):
        fault = "inner refusal", f"{_one_line(str(refused))} At {place}"
    outcome, sentence = fault if fault[0] else judged(case, code, out.getvalue(), err.getvalue())
    heard = [w for w in told if issubclass(w.category, RuntimeWarning)]
    if outcome in GOOD and heard:
        first = heard[0]
        outcome, sentence = "warned", f"{first.message} at {Path(first.filename).name}:{first.lineno}"
    sentence = sentence.replace(f"{folder}/", "")
    return Row(case.seed, case.verb, case.short, code, round(seconds, 1), outcome, sentence)


def _exit_status(arguments: list[str]) -> tuple[int, BaseException | None]:
    """The exit status, and the error behind it."""
    before = sys.argv
    sys.argv = ["bayesmembrane", *arguments]
    try:
        main()
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None), stop.__context__
    finally:
        sys.argv = before
    return 0, None


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise `TimeUpError` after so many seconds of this process, however busy the machine is."""

    def stop(*_: object) -> None:
        raise TimeUpError

    before = signal.signal(signal.SIGPROF, stop)
    # Again and again: where compiled code calls back, what is raised once is lost.
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _is_time_up(error: BaseException | None) -> bool:
    """Also where compiled code was interrupted: Python then complains of a result with an exception set."""
    return isinstance(error, TimeUpError) or (error is not None and _is_time_up(error.__cause__))


def _place(error: BaseException | None) -> str:
    """The innermost line of the package that an error went through."""
    frames = traceback.extract_tb(error.__traceback__ if error else None)
    ours = [f for f in frames if "/bayesmembrane/" in f.filename] or frames
    last = ours[-1]
    return f"{last.filename.rpartition('/bayesmembrane/')[2]}:{last.lineno} {last.name}"


def _one_line(text: str) -> str:
    return " ".join(text.split())[:300]


# ---- judgement -------------------------------------------------------------------------------------------------------


def judged(case: Case, code: int, out: str, err: str) -> tuple[str, str]:
    """(outcome, sentence) of an exit status and both streams."""
    if "Traceback" in err:
        return "traceback", _one_line(err.rpartition("Traceback")[2])
    if code == 2:  # wrong usage: typer's own words, in a frame
        words = _one_line(re.sub(r"[│╭╮╰╯─]+", " ", err))
        return ("refused", words) if "Error" in words and not out else ("no sentence", words)
    if code != 0:
        return _refusal(case, code, out, err)
    try:
        document = json.loads(out, parse_constant=_refuse_constant)
    except ValueError as error:
        return "wrong answer", f"not JSON: {_one_line(str(error))}"
    wrong = contradiction(case.verb, document)
    return ("wrong answer", wrong) if wrong else ("answered", _told(case.verb, document))


def _refuse_constant(name: str) -> Any:
    raise ValueError(f"the document holds {name}")


def _refusal(case: Case, code: int, out: str, err: str) -> tuple[str, str]:
    """Progress may stand above; the last line is the sentence: what is wrong; how to mend it."""
    last = (err.strip().splitlines() or [""])[-1].strip()
    lost = {m[0] for m in _NO_NUMBER.finditer(last)} - set(case.options)  # what was asked for may be quoted
    whole = last.endswith(".") and ";" in last and len(last.split()) >= 5 and not lost
    return ("refused" if code == 1 and whole and not out else "no sentence"), last


def contradiction(verb: str, document: dict[str, Any]) -> str:
    """What a document says against itself, in words; "" if nothing."""
    texts = [t for t in _texts(document) if _NO_NUMBER.search(t)]
    if texts:
        return f"a number is missing in words: {texts[0]}"
    return {"fit": _fit, "sample": _sample, "diagnose": _diagnose}[verb](document)


def _fit(document: dict[str, Any]) -> str:
    numbers = [document[k] for k in ("rmse_N", "loss_N", "max_N")]
    values = {k: v["value"] for k, v in document["parameters"].items()}
    lost = [k for k, v in values.items() if v is None]
    if document["status"] == "converged" and (None in numbers or lost):
        return f"converged, with numbers {numbers} and without a value of {', '.join(lost) or 'nothing'}"
    if not document["status"]:
        return "no status"
    wrong = [k for k, v in document["parameters"].items() if v["sd"] is not None and v["sd"] < 0]
    if wrong:
        return f"negative standard deviation of {', '.join(wrong)}"
    return _fit(document["constrained"]) if "constrained" in document else ""


def _sample(document: dict[str, Any]) -> str:
    lost = [k for k, v in document["posterior"].items() if None in (v["mean"], v["sd"], *v["hdi_94"])]
    if lost:
        return f"no posterior of {', '.join(lost)}"
    crossed = [k for k, v in document["posterior"].items() if v["hdi_94"][0] > v["hdi_94"][1]]
    if crossed:
        return f"the interval of {', '.join(crossed)} is upside down"
    empty = [k for k in ("ess_bulk", "r_hat", "acceptance", "evaluations", "seconds") if document[k] is None]
    return f"no {', '.join(empty)}" if empty else ""


def _diagnose(document: dict[str, Any]) -> str:
    verdict, effects, material = (document[k] for k in ("verdict", "effects", "material"))
    if verdict not in VERDICTS or not document["sentence"]:
        return f"verdict {verdict!r} with the sentence {document['sentence']!r}"
    if bool(effects) and verdict in ("adequate", "unknown"):
        return f"{verdict}, and yet {', '.join(effects)}"
    if (verdict == "material") != bool(material) or (verdict == "named" and not effects):
        return f"{verdict}, with the material {material!r} and the effects {effects}"
    if document["p_value"] is None or not 0 <= document["p_value"] <= 1:
        return f"p-value {document['p_value']}"
    before = document["error"]["before"]
    lost = [k for k, v in before.items() if v is None]
    return f"no {', '.join(lost)} before" if lost else ""


def _told(verb: str, document: dict[str, Any]) -> str:
    if verb == "fit":
        return f"{document['status']}; at a bound: {', '.join(document['at_bound']) or 'none'}"
    if verb == "sample":
        return f"{document['status']}; R-hat {document['r_hat']:.3f}, ESS {document['ess_bulk']:.0f}"
    return f"{document['verdict']} {', '.join(document['effects'])}{document['material']}".strip()


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for v in value.values():
            yield from _texts(v)
    elif isinstance(value, list):
        for v in value:
            yield from _texts(v)
    elif isinstance(value, str):
        yield value
