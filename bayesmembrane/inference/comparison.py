"""Which hypothesis the data support, by how much, and whether two estimators and prediction say the same."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Empty
from threading import Thread
from typing import Any

import numpy as np

from bayesmembrane.errors import SettingsError
from bayesmembrane.hypothesis import Hypothesis
from bayesmembrane.inference.comparison_jobs import Climbed, Job, Sampled, Tell, climb, walk
from bayesmembrane.inference.evidence import BRIDGE, NESTED, WIDEST, Evidence, together
from bayesmembrane.inference.evidence_sensitivity import ByMode, Widened
from bayesmembrane.inference.predictive_comparison import LeaveOneOut, LeaveRangeOut
from bayesmembrane.inference.prior import Mass
from bayesmembrane.measurement import Measurement

# By what their films cost: the slow ones first, so that the others fill the gaps of the second core.
SLOW = ("ogden", "yeoh", "mooney_rivlin", "gent", "neo_hookean")
DECIDED = 2.0  # standard errors of a difference, below which it is none


@dataclass(frozen=True, eq=False)
class Row:
    """One hypothesis.

    Attributes
    ----------
    label, hypothesis : which
    evidence : ln Z by both estimators, None if there is none
    loo, rest : leave-one-out; prediction of the rest of the range, None if that was not asked for
    prior_mass : part of the prior that its convexity mode leaves, None if it is not known
    posterior_probability : among the hypotheses that could be fitted, equally probable before; None without a ranking
    widths, modes : ln Z under other prior widths, and under the other convexity modes
    run : folder of the posterior draws, if it is stored
    evaluations, seconds : in all
    notes : sentences on the quality of the draws
    reason : "" or why the hypothesis has no evidence, as a sentence
    """

    label: str
    hypothesis: Hypothesis
    evidence: Evidence | None
    loo: LeaveOneOut | None
    rest: LeaveRangeOut | None
    prior_mass: Mass | None
    posterior_probability: float | None
    widths: tuple[Widened, ...]
    modes: tuple[ByMode, ...]
    run: Path | None
    evaluations: int
    seconds: float
    notes: tuple[str, ...]
    reason: str

    @property
    def fitted(self) -> bool:
        """Whether it has an evidence."""
        return self.evidence is not None

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``compare``."""
        e, loo = self.evidence, self.loo
        return {
            "hypothesis": self.label,
            "log_evidence": dict(e.log_evidence) if e else {},
            "log_evidence_sd": dict(e.log_evidence_sd) if e else {},
            "agreed": bool(e and e.agreed),
            "elpd_loo": loo.elpd if loo else None,
            "loo_se": loo.se if loo else None,
            "loo_refits": len(loo.refitted) if loo else None,
            "prior_mass": self.prior_mass.value if self.prior_mass else None,
            "prior_mass_sd": self.prior_mass.sd if self.prior_mass else None,
            "posterior_probability": self.posterior_probability,
            "held_out": _held_out(self.rest) if self.rest else None,
            "prior_widths": [_plain(vars(w)) for w in self.widths],
            "convexity_modes": [_plain(vars(m)) for m in self.modes],
            "run": str(self.run) if self.run else None,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "notes": list(self.notes),
            "reason": self.reason or (e.reason if e else ""),
        }


@dataclass(frozen=True, eq=False)
class Comparison:
    """Hypotheses side by side.

    Attributes
    ----------
    rows : in the order asked for
    agreed : both estimators agree on every hypothesis that could be fitted, and there is one
    reason : "" or why there is no ranking, as a sentence
    sentence : what evidence and prediction prefer, and whether they disagree
    """

    rows: tuple[Row, ...]
    agreed: bool
    reason: str
    sentence: str

    @property
    def ranking(self) -> tuple[Row, ...]:
        """Fitted rows, the largest evidence first; empty without agreement."""
        fitted = [r for r in self.rows if r.evidence is not None]
        if not self.agreed:
            return ()
        return tuple(sorted(fitted, key=lambda r: -r.evidence.best[0] if r.evidence else 0.0))

    def summary(self) -> dict[str, Any]:
        """Plain values for the JSON answer of ``compare``."""
        return {
            "table": [r.summary() for r in self.rows],
            "agreed": self.agreed,
            "reason": self.reason,
            "ranking": [r.label for r in self.ranking],
            "sentence": self.sentence,
        }


def compare(
    measurement: Measurement,
    hypotheses: Sequence[Hypothesis],
    seed: int = 0,
    *,
    out: str | Path | None = "chains",
    ess: float = 1000.0,
    whole: Measurement | None = None,
    modes: bool = True,
    workers: int | None = None,
    progress: Tell | None = None,
) -> Comparison:
    """ln Z of every hypothesis by nested and bridge sampling, with prior sensitivity and prediction beside it.

    Parameters
    ----------
    out : folder of the runs; what is stored there with the same data, settings and code is used again. None: no storage
    ess : effective sample size of the posterior draws
    whole : the measurement that this one is the first part of; the rest is then predicted
    modes : also the evidence under every convexity mode, from a second sampling without one
    workers : processes, None: one for each core; 1 stays in this one
    progress : is told (label of a hypothesis, what is being done)

    A hypothesis that cannot be fitted has a row that says why. Ctrl-C stores what there is and raises
    KeyboardInterrupt; the same call goes on from there. Raises `SettingsError` for no hypothesis or the same one twice,
    `StorageError` if ``out`` cannot be written. Scripts that use more than one process need the usual
    ``if __name__ == "__main__"``.
    """
    labels = _labels(hypotheses)
    folder = None if out is None else Path(out)
    jobs = {
        label: Job(label, measurement, h, seed, ess, folder, whole, modes)
        for label, h in zip(labels, hypotheses, strict=True)
    }
    climbed, walked = _all(jobs, _cores() if workers is None else workers, progress or _silent)
    rows = [_row(jobs[n], climbed[n], walked[n]) for n in labels]
    return ranked(rows)


def ranked(rows: Sequence[Row]) -> Comparison:
    """The comparison of rows whose probabilities are not known yet."""
    agreed, reason = _agreement(rows)
    if agreed:
        z = np.array([r.evidence.best[0] if r.evidence else -np.inf for r in rows])
        p = np.exp(z - np.max(z)) / np.sum(np.exp(z - np.max(z)))
        rows = [
            Row(**{**vars(r), "posterior_probability": float(q) if r.fitted else None})
            for r, q in zip(rows, p, strict=True)
        ]
    return Comparison(tuple(rows), agreed, reason, _sentence(rows, agreed))


def _labels(hypotheses: Sequence[Hypothesis]) -> list[str]:
    """Material and effects; noise and convexity where that does not tell two of them apart."""
    short = [h.label() for h in hypotheses]
    full = [f"{h.label()} ({h.noise.name}, {h.convexity})" for h in hypotheses]
    labels = [s if short.count(s) == 1 else f for s, f in zip(short, full, strict=True)]
    twice = {n for n in labels if labels.count(n) > 1}
    if not labels or twice:
        fault = f'"{min(twice)}" is there twice' if twice else "there is no hypothesis to compare"
        raise SettingsError(fault, remedy="name each material once" if twice else "name some materials")
    return labels


def _row(job: Job, climbed: Climbed, walked: Sampled) -> Row:
    evidence = None
    if climbed.nested is not None and walked.bridge is not None:
        evidence = together({NESTED: climbed.nested, BRIDGE: walked.bridge}, climbed.mass)
    spent = [e for e in (climbed.nested, walked.bridge) if e is not None]
    return Row(
        label=job.label,
        hypothesis=job.hypothesis,
        evidence=evidence,
        loo=walked.loo,
        rest=walked.rest,
        prior_mass=climbed.mass,
        posterior_probability=None,
        widths=walked.widths,
        modes=walked.modes,
        run=walked.run,
        evaluations=walked.evaluations + sum(e.evaluations for e in spent),
        seconds=walked.seconds + sum(e.seconds for e in spent),
        notes=walked.notes,
        reason=climbed.reason or walked.reason,
    )


def _agreement(rows: Sequence[Row]) -> tuple[bool, str]:
    fitted = [r for r in rows if r.evidence is not None]
    if not fitted:
        return False, "None of the hypotheses could be fitted."
    doubtful = [r for r in fitted if r.evidence is not None and not r.evidence.agreed]
    if doubtful:
        told = " ".join(f"{r.label}: {r.evidence.reason}" for r in doubtful if r.evidence)
        return False, f"There is no ranking, because ln Z is not known well enough of {len(doubtful)} of them. {told}"
    return True, ""


# ---- in words --------------------------------------------------------------------------------------------------------


def _sentence(rows: Sequence[Row], agreed: bool) -> str:
    """What evidence and leave-one-out prefer, by how much, and whether they disagree."""
    both = [r for r in rows if r.evidence is not None and r.loo is not None]
    if len(both) < 2:
        return "There are not two hypotheses to choose between."
    by_loo = sorted(both, key=lambda r: -r.loo.elpd if r.loo else 0.0)
    predicts, next_best = by_loo[0], by_loo[1]
    if not agreed:
        gap, se = _elpd_gap(predicts, next_best)
        return (
            f"The evidence gives no ranking; leave-one-out prefers {predicts.label} to {next_best.label} by {gap:.1f} "
            f"+- {se:.1f}{_weak(gap, se)}."
        )
    by_z = sorted(both, key=lambda r: -_best(r)[0])
    gap = _best(by_z[0])[0] - _best(by_z[1])[0]
    sd = float(np.hypot(_best(by_z[0])[1], _best(by_z[1])[1]))
    start = f"The evidence prefers {by_z[0].label} to {by_z[1].label} by {gap:.1f} +- {sd:.1f} in ln Z{_bayes(gap)}"
    if predicts is by_z[0]:
        d, se = _elpd_gap(predicts, next_best)
        return f"{start}, and leave-one-out prefers it too, to {next_best.label} by {d:.1f} +- {se:.1f}{_weak(d, se)}."
    d, se = _elpd_gap(predicts, by_z[0])
    if d > DECIDED * se:
        return (
            f"{start}, but leave-one-out prefers {predicts.label} to it by {d:.1f} +- {se:.1f}: evidence and "
            "prediction disagree, and of the two the evidence is the one that depends on the width of the priors."
        )
    return (
        f"{start}, and leave-one-out puts {predicts.label} before it by {d:.1f} +- {se:.1f}{_weak(d, se)}: prediction "
        "does not contradict the evidence."
    )


def _best(row: Row) -> tuple[float, float]:
    assert row.evidence is not None
    return row.evidence.best


def _elpd_gap(a: Row, b: Row) -> tuple[float, float]:
    """elpd_a - elpd_b and its standard error, from the differences point by point."""
    assert a.loo is not None
    assert b.loo is not None
    d = a.loo.pointwise - b.loo.pointwise
    return float(np.sum(d)), float(np.sqrt(d.size * np.var(d)))


def _weak(gap: float, se: float) -> str:
    return "" if gap > DECIDED * se else ", which is no difference"


def _bayes(gap: float) -> str:
    return ", which decides little" if gap < 1.0 + WIDEST else ""


def _held_out(rest: LeaveRangeOut) -> dict[str, Any]:
    names = ("elpd", "se", "monte_carlo_sd", "effective", "lost", "rmse_N", "max_N", "points")
    return _plain({n: getattr(rest, n) for n in names})


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """nan as None."""
    return {k: None if isinstance(v, float) and not np.isfinite(v) else v for k, v in values.items()}


# ---- on the cores there are ------------------------------------------------------------------------------------------


def _all(jobs: Mapping[str, Job], workers: int, tell: Tell) -> tuple[dict[str, Climbed], dict[str, Sampled]]:
    """Both parts of every job; they know nothing of each other and run wherever a core is free."""
    order = sorted(jobs, key=lambda n: _place(jobs[n].hypothesis))
    climbed: dict[str, Climbed] = {}
    walked: dict[str, Sampled] = {}
    if workers == 1:
        for name in order:
            climbed[name], walked[name] = climb(jobs[name], tell), walk(jobs[name], tell)
        return climbed, walked
    with _pool(min(workers, 2 * len(jobs)), tell) as (pool, queue):
        waiting: dict[Any, tuple[dict[str, Any], str]] = {}
        for name in order:
            waiting[pool.submit(_in_worker, walk, jobs[name], queue)] = walked, name
            waiting[pool.submit(_in_worker, climb, jobs[name], queue)] = climbed, name
        for done in as_completed(waiting):
            into, name = waiting[done]
            into[name] = done.result()
    return climbed, walked


def _place(hypothesis: Hypothesis) -> int:
    """Where a hypothesis stands in the queue: what is not known to be fast comes first."""
    return SLOW.index(hypothesis.material.name) if hypothesis.material.name in SLOW else -1


def _in_worker(work: Callable[[Job, Tell], Any], job: Job, queue: Any) -> Any:
    return work(job, lambda label, text: queue.put((label, text)))


@contextmanager
def _pool(workers: int, tell: Tell) -> Iterator[tuple[ProcessPoolExecutor, Any]]:
    """Fresh processes, and a queue on which they tell how far they are."""
    context = multiprocessing.get_context("spawn")
    with context.Manager() as manager, ProcessPoolExecutor(workers, mp_context=context) as pool:
        queue, stop = manager.Queue(), list[bool]()
        listener = Thread(target=_listen, args=(queue, tell, stop), daemon=True)
        listener.start()
        try:
            yield pool, queue
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
        finally:
            stop.append(True)
            listener.join(timeout=2)


def _listen(queue: Any, tell: Tell, stop: list[bool]) -> None:
    while not stop:
        try:
            tell(*queue.get(timeout=0.2))
        except Empty:
            continue
        except (EOFError, OSError):
            return


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _silent(label: str, text: str) -> None:
    """Tells nobody."""
