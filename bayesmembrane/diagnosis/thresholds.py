"""Every number by which the diagnosis decides, and why it has this value.

One frozen class for each room, and one instance of it: ``NOISE.doubt_from_dof``. Nothing of the kind stands elsewhere.
"studies" are the recorded ones in ``docs/studies``: a thousand curves with a known fault or none.
"""

from __future__ import annotations

from dataclasses import dataclass

TINY = 1e-300
"""No threshold: keeps a quotient finite where its denominator is zero."""


@dataclass(frozen=True)
class NoiseThresholds:
    """How the measurement's own noise is inferred, and when a stated one is doubted."""

    largest_rho: float = 0.97
    """Largest correlation of neighbours: noise that remembers longer is a drift, which no test tells from a misfit."""
    rho_trials: int = 25
    """Correlations that are tried before the best is refined: the likelihood has no two maxima closer than that."""
    rho_step: float = 0.02
    """Step in correlation for the curvature of its likelihood: small beside its standard error, large beside round-off.
    """
    largest_rho_sd: float = 0.3
    """A larger standard error of the correlation says no more than this one: nothing is known."""
    even_steps: float = 0.05
    """Steps that differ by less than this part of their median are even: time and number of readings are one clock."""
    doubt_from_dof: int = 30
    """Degrees of freedom that readings need to contradict what is stated: fewer scatter by chance."""
    remembers_from: float = 3.0
    """Standard errors above zero from which readings are correlated beyond doubt."""
    doubt_below: float = 1e-3
    """Probability of a scatter as large as seen: below it, the stated standard deviation is not believed."""
    smallest_sd: float = 1e-9
    """Of the largest force. A perfect curve still has a noise, or everything would be infinitely significant."""
    rank: float = 1e-9
    """Of the largest singular value: directions below it are round-off of the others."""


@dataclass(frozen=True)
class ReferenceThresholds:
    """The smooth reference that no physics could beat."""

    spline_columns: int = 20
    """Splines over the range of deflections: they follow what bends within a twentieth of it."""
    leg_columns: int = 6
    """Columns on each leg: how legs differ from each other is smoother than how the curve bends."""
    points_per_column: int = 3
    """Points for each column of the splines, at least; enough are left to tell the noise."""
    short_leg: int = 12
    """Points; a shorter leg gets a constant only."""
    reversal: float = 0.05
    """Of a leg: how fast its start relaxes after the disc turns."""
    relaxations: tuple[float, ...] = (0.01, 0.03, 0.1, 0.3, 1.0)
    """Of a hold: how fast it relaxes; half a decade apart, so that any time in between is a sum of two."""


@dataclass(frozen=True)
class DetectionThresholds:
    """When something is seen to be missing."""

    level: float = 0.01
    """A model is adequate unless the smallest p-value, times the number of tests, lies below this: one alarm in a
    hundred sound curves."""
    least_waves: float = 4.0
    """Waves over the range for it to be a periodicity; fewer are a bend."""
    fewest_points: int = 60
    """Points for waves to be looked for; a shorter curve shows none."""
    exact_peaks: int = 5
    """The periodogram's highest peaks that are judged exactly, beside what the reference has taken."""
    slowest_part: float = 0.06
    """Of the frequencies against time: slower ones belong to the reference, which is smooth on every leg."""
    shapes: tuple[float, ...] = (0.5, 0.15, 0.85)
    """Quantiles of the priors of shape parameters at which an effect's signature is taken."""
    small_size: float = 0.02
    """Of the usual size of an effect: how far the difference reaches that makes its signature."""
    visible: float = 1e-3
    """Of a signature that the material leaves over; less is round-off."""
    draws: int = 20000
    """Of the largest score if nothing is missing: p-values down to 1/20000."""
    power_level: float = 0.005
    """False alarms of the score test at which the smallest visible size is told: half of `level`."""
    power_quantile: float = 1.2816
    """Of the normal distribution at 0.9: the smallest visible size is found nine times out of ten."""
    near_degrees: float = 20.0
    """Between two signatures: below it, this protocol cannot separate the effects (studies)."""


@dataclass(frozen=True)
class SearchThresholds:
    """How candidates are fitted."""

    iterations: int = 40
    """Steps of a search, at most."""
    material_starts: int = 3
    """Draws of the material's prior that searches start from, besides the model's own fit."""
    small_share: float = 0.1
    """Of the usual size of an effect: the first start."""
    middling_share: float = 0.6
    """Of the usual size of an effect: the second start, from the best fit of the plain model only."""
    given_up: float = 4.0
    """Times the least sum of squares: a search as far behind is not waited for."""
    at_bound: float = 1e-3
    """Of the width of the bounds: an estimate as near lies at its bound."""
    least_weight: float = 0.05
    """Part of the points that count on their own, at least, however correlated what is left."""
    spare_points: int = 3
    """Points beyond the parameters, at least: fewer tell no misfit from noise."""
    better_null: float = 1.0
    """ln of the Bayes factor by which another optimum of the plain model counts as better."""


@dataclass(frozen=True)
class SuddenThresholds:
    """A change at one moment."""

    places: int = 160
    """Moments that are tried; a curve that has fewer readings is not asked."""
    margin: float = 0.04
    """Of the readings at either end where no step is looked for: a start or an end is none."""
    widths: tuple[float, ...] = (1e-6, 0.006, 0.018)
    """Of the whole test: how long the change takes, from at once to a few seconds."""
    visible: float = 1e-3
    """Of a step, that the model's own slopes leave over; less is round-off."""
    rank: float = 1e-9
    """Of the largest singular value, when the model adapts to the step."""


@dataclass(frozen=True)
class ExplanationThresholds:
    """When a candidate explains the curve, when it is a rival, and when it gets the name.

    Factors are ln of Bayes factors. An effect's law is the textbook's, a machine's is not: that is why most of them
    are larger than evidence alone would ask for.
    """

    level: float = 0.01
    """Probability of what a candidate leaves: above it, that is noise."""
    probable: float = 3.0
    """Over the plain model: what an explanation needs, since the tests may have raised a false alarm."""
    unexplained: float = 0.2
    """Part of the misfit that a candidate may leave and still explain the curve, if that is small beside the noise."""
    unexplained_large: float = 0.05
    """The same where the rest is large beside the noise: of a large misfit a fifth is a lot. And the part that chance
    may add to: of a small misfit, noise alone leaves a larger one."""
    small_chi2: float = 1.5
    """Reduced chi-square up to which the rest is small beside the noise."""
    wave_level: float = 1e-3
    """Probability of the strongest wave in what is left, below which it is there: no smooth effect takes waves away."""
    wave_share: float = 0.2
    """Of the squares that a candidate takes away: a wave that has more is what is missing."""
    decisive: float = 4.0
    """Beyond which a rival is out: odds of fifty to one."""
    alike_degrees: float = 30.0
    """Between the traces of two candidates: below it they look alike."""
    alike_decisive: float = 5.0
    """Beyond which a rival that looks alike is out."""
    very_alike_degrees: float = 15.0
    """Between the traces of two candidates: below it they can hardly be told apart."""
    very_alike_decisive: float = 6.0
    """Beyond which such a rival is out."""
    form_share: float = 0.25
    """Of the factor that the best leaves beyond noise: a rival nearer than that stays, for the best's form is farther
    off than what sets them apart."""
    energy_decisive: float = 8.0
    """By which an effect that follows the deflection alone must beat every other energy: the instrument is blamed only
    far beyond them."""
    energy_share: float = 0.05
    """The same, as a part of the effect's own factor."""
    foreign: float = 1.0
    """By which a sudden change must beat the best effect to be its rival: it is rarer than an effect."""
    foreign_share: float = 0.02
    """Of the best effect's factor by which it must beat it, and by no less than `decisive`, to put it out."""
    pair_singles: int = 4
    """Best single effects that are tried with every other one: the first of a pair is often not the best alone."""
    pair_gain: float = 15.0
    """Over the best single effect that a pair needs: one effect with another form gains less (studies)."""
    pair_share: float = 0.045
    """Of the misfit that the second effect of a pair must take away (studies)."""
    with_other_energies: int = 3
    """Explanations that are tried with the other energies."""
    single_valued: float = 0.02
    """Part of the squares of an effect's slope that deflection alone leaves over, below which it follows that alone."""


@dataclass(frozen=True)
class HeldOutThresholds:
    """Which points are set aside before looking."""

    blocks: int = 20
    """Of a curve of one cycle: long enough to need prediction, short enough to be within the range."""
    every: int = 4
    """One block of so many is set aside."""
    least_points: int = 12
    """Points that are fitted; with fewer nothing is set aside."""
    band: float = 1.6449
    """Standard deviations to either side of a 90 % band."""


@dataclass(frozen=True)
class DiscrepancyThresholds:
    """The process that is kept for what no candidate explains."""

    lengths: tuple[float, ...] = (0.001, 0.002, 0.004, 0.01, 0.03, 0.1, 0.3)
    """Of the way: where the search for its length starts; the likelihood has a maximum for each scale of structure."""
    amplitudes: tuple[float, ...] = (0.3, 1.0, 5.0)
    """Of the noise: where the search for its amplitude starts."""
    least_length: float = 5e-4
    """Of the way: shorter is noise."""
    largest_length: float = 3.0
    """Of the way: longer is a constant."""
    least_ln_amplitude: float = -12.0
    """ln of amplitude over noise: nothing at all."""
    largest_ln_amplitude: float = 6.0
    """ln of amplitude over noise: four hundred times as much."""
    first_step: float = 0.4
    """In ln of amplitude and length: the first step of the search."""
    tolerance: float = 0.02
    """In ln of amplitude and length: nearer is as good."""
    evaluations: int = 60
    """Of the likelihood in that search, at most."""
    band_points: int = 400
    """Where the standard deviation is computed; between them it is interpolated, for it changes slowly."""


@dataclass(frozen=True)
class NextTestThresholds:
    """What further measurements that are simulated must show; see `next_test`."""

    clear: float = 5.0
    """Standard deviations between the nearest two rivals: beyond it, that test settles it."""


@dataclass(frozen=True)
class LoopThresholds:
    """The closed loop."""

    most_rounds: int = 3
    """Two added effects are as many as a curve can carry; the third round says that nothing more is missing."""
    leaders: int = 3
    """Members of an ambiguous answer that are sampled."""
    band: float = 0.9
    """Part of new readings that a predictive band is to cover."""


@dataclass(frozen=True)
class WordsThresholds:
    """From where on something is worth a sentence."""

    visible_effects: int = 3
    """Smallest sizes that are told of an adequate model."""
    partial: float = 0.5
    """Part of the misfit that the nearest candidate leaves, at most, to be mentioned where nothing explains it."""
    uneven: float = 1.5
    """Times the root mean square of the rest: then a part of the residual stands out."""
    periodic: float = 0.01
    """Probability of the strongest wave, below which the residual is said to repeat."""
    trend: float = 0.5
    """Correlation with time, from which the residual is said to rise or fall."""
    plateau_points: int = 5
    """Readings that share the largest or the smallest force: more are no chance, the load cell is at its limit."""
    plateau_share: float = 0.01
    """The same, as a part of all readings."""
    near_one: float = 0.1
    """Of a stretch: as near to 1, it is told with five digits, for three would say nothing."""
    smallest_p: float = 1e-4
    """A p-value below it is told as that: its own size rests on tails that nobody knows."""
    same_reading: float = 0.01
    """Of the load cell's step: readings that differ by less are the same."""


NOISE = NoiseThresholds()
REFERENCE = ReferenceThresholds()
DETECTION = DetectionThresholds()
SEARCH = SearchThresholds()
SUDDEN = SuddenThresholds()
EXPLANATION = ExplanationThresholds()
HELD_OUT = HeldOutThresholds()
DISCREPANCY = DiscrepancyThresholds()
NEXT_TEST = NextTestThresholds()
LOOP = LoopThresholds()
WORDS = WordsThresholds()
