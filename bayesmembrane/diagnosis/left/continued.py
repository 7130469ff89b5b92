"""What a fit to some readings says of others: of the same test, or of another one of the same material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from bayesmembrane.diagnosis.candidates.candidate import Candidate
from bayesmembrane.diagnosis.candidates.search import Search
from bayesmembrane.ground.parameters import Array
from bayesmembrane.physics.form_error import FormFactors, form_columns, traces, unseen_columns
from bayesmembrane.physics.forward import Forward


@dataclass(frozen=True, eq=False)
class Continued:
    """A fit at readings that it may not have seen; noise is left out.

    force : (N,) N, at its coordinates
    moved : (N,) N, what its linear model adds
    columns, covariance : (N, m) N of all that is not known of it, and (m, m) of their coefficients
    complete : False if the film has no force or no slope at some reading; there they count as zero
    """

    force: Array
    moved: Array
    columns: Array
    covariance: Array
    complete: bool


def continued(
    part: Search, fit: Candidate, forward: Forward, factors: FormFactors, further: Array | None = None
) -> Continued:
    """What a ``fit`` to ``part`` says of the readings of ``forward``, which have the ``factors``.

    Its form errors go on as far as they are smooth; those without factors there are left out.
    ``further`` : (N,) relative error of every law there that nothing here tells of, `unseen_columns`
    """
    new = forward(fit.x[None, :], sensitivities=True, reached=False)
    assert new.sensitivity is not None
    complete = bool(np.all(np.isfinite(new.force)) and np.all(np.isfinite(new.sensitivity)))
    force, slopes = np.nan_to_num(new.force[0]), np.nan_to_num(new.sensitivity[0])
    trace = traces(forward, fit.x[None, :], force[None, :], changing=True)[0]
    forms = form_columns(factors, force, fit.hypothesis.effects, trace)
    columns = np.column_stack([slopes * part.steepness(fit), *(c for _, c in forms)])
    mean, covariance = part.linear(fit).coefficients(fit.theta)
    # The curve is that at the fit; the linear model knows the last bit of the way.
    mean[: fit.x.size] -= part.coefficients_at(fit)
    # What is not steady in one test is another thing in another: its columns are the last, and are not there.
    m = columns.shape[1]
    moved, covariance = columns @ mean[:m], covariance[:m, :m]
    if further is not None and np.any(further):
        unseen = unseen_columns(factors, force, fit.hypothesis.effects, trace)
        columns = np.column_stack([columns, *(further[:, None] * c for c in unseen)])
        covariance = block_diag(covariance, np.eye(columns.shape[1] - m))
    return Continued(force, moved, columns, covariance, complete)
