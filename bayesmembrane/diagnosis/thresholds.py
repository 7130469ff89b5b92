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
    growing_from: int = 60
    """Readings from which noise may be seen to grow with the force."""
    growing_below: float = 1e-3
    """Probability of a rank correlation as large as seen between noise and force: below it, noise grows with the force.
    """
    growth: tuple[float, float] = (0.3, 30.0)
    """Between how many times the noise at rest what the largest force adds to it may be."""
    least_left: float = 0.1
    """Part of its noise that a reading has left beside the reference, at least, to tell how large that is."""
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
class OutlierThresholds:
    """When a reading is set aside."""

    reach: float = 6.0
    """Robust standard deviations off the reference, and off what comes before and after: noise does so never."""
    share: float = 0.05
    """Of the readings, at most: more are no outliers but something to be explained, and nothing is set aside. (With 2 %
    four strays of 156 readings made the noise four times as large, and a rate of ratio 6 nothing.)"""
    neighbours: int = 4
    """Readings on either side whose median counts: up to two outliers in a row do not hide each other."""
    window: int = 31
    """Readings around each whose scatter counts, for noise may grow with the force."""
    least_spare: float = 0.05
    """Of a reading, what the reference leaves free: one that it follows anyway cannot be seen to be off."""


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
    fewest_moving: int = 24
    """Points between holds for waves of the deflection."""
    wave_step: float = 0.5
    """Of a wave over the range, between two that are looked at: a quarter of one off, a wave loses a fifth of its
    squares, half of one off three fifths."""
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
    draws: int = 512
    """Of the material's prior, that the first searches' starts are chosen from."""
    readings: int = 24
    """By which they are chosen: a film without effects needs no more."""
    material_starts: int = 3
    """Draws of the material's prior that searches start from, besides the model's own fit."""
    small_share: float = 0.1
    """Of the usual size of an effect: the first start."""
    middling_share: float = 0.6
    """Of the usual size of an effect: the second start, from the best fit of the plain model only."""
    last_iterations: int = 8
    """Steps from the best end, once its own form error is known."""
    polishings: int = 3
    """Times that these are made at most, where a law turns out to be off by another error than they knew."""
    poor_law: float = 0.08
    """A law's error from which on it may carry what its effect is to explain: a third of the prior lies above."""
    law_matters: float = 0.01
    """A law's error below which its size is no matter."""
    slow_by: float = 0.05
    """Of the sum of squares, in variances: searches whose steps gain less are near enough, for the linear model knows
    the rest."""
    last_falls: int = 4
    """Points of a search, each better than the one before, that say how far the rest of it will lead."""
    idle: int = 8
    """Steps in a row that won nothing: a search that damps itself may have won nothing by three, and go on."""
    behind: float = 120.0
    """In variances: a search that will not come as near the best one's sum of squares is not waited for."""
    times_behind: float = 1.3
    """The same, times that sum: where much is missing, factors count less."""
    settled: float = 3e-7
    """Of the sum of squares: a search to which a whole step, undamped, promises less is at its end. With 3e-5 ln Z of
    Ogden's energy, in its bent valleys, once changed by nine."""
    least_form: float = 1e-2
    """Of the noise: what the form error does below it is nothing."""
    given_up: float = 1.03
    """Times the least sum of squares: a search as far behind is not waited for."""
    at_bound: float = 1e-3
    """Of the width of the bounds: an estimate as near lies at its bound."""
    rank: float = 1e-7
    """Of the largest singular value: coordinates along directions below it stay where they are."""
    spare_points: int = 3
    """Points beyond the parameters, at least: fewer tell no misfit from noise."""


@dataclass(frozen=True)
class Sizes:
    """What effects are expected to be, in parts of what the test reached."""

    part: float = 0.01
    """Of the largest deflection: lengths, as slack, a set, the frame's yielding at the largest force. Of the largest
    force: forces, as friction, an offset, a drift until the end."""
    largest: float = 20.0
    """Times the expected size: nothing larger is looked for."""
    largest_force: float = 50.0
    """The same of forces, for a load cell may not have been tared, or warm up: half of what it reads at most. Of a
    drift, which may slow down, until the first leg ends."""
    first_legs: float = 10.0
    """A test counts for that as no longer than so many of its first leg: a preload is none."""


@dataclass(frozen=True)
class FormThresholds:
    """How noise and form error are integrated out; their priors stand in `physics.form_error`."""

    scale_sd: float = 0.25
    """Of ln of the noise over its reference, where it is inferred: the reference may have followed a little, or not."""
    stated_scale_sd: float = 0.05
    """The same where it is stated and believed."""
    reach: float = 5.0
    """Standard deviations of the prior to either side within which the most probable size is looked for."""
    iterations: int = 60
    """Of that search."""
    tolerance: float = 1e-5
    """In ln p: it ends where a step promises less."""
    largest_step: float = 2.0
    """In ln of a size: of that search."""
    halvings: int = 20
    """Of a step that gains nothing, at most."""
    rival: float = 5.0
    """ln p: a start that is no farther below a top that was found from another one is climbed from, too."""
    far_off: float = 2.0
    """Standard deviations of the prior above its centre: where an energy that is far off is looked for. With no such
    start one of eleven weighings of four films, of which each has two or three things wrong, ended lower, by up to 98:
    without an error of the energy, where a set takes but a part of the misfit. Laws that are far off are not looked
    for: what holds by such a law alone is another one, and a loop of acrylic tape, which relaxes, was `unknown`, for
    beside relaxation hysteresis with a law 37 % off had more than relaxation alone."""
    least_curvature: float = 0.25
    """Of that of the prior: a flatter place is one where Laplace's approximation does not hold."""
    far_bound: float = 6.0
    """Standard deviations: a bound beyond cuts nothing off."""
    joint_bounds: int = 6
    """Bounds that are taken together; further ones count one by one."""
    deep_tail: float = -25.0
    """ln of a probability: a tail as deep is computed on its own, where integration would find nothing."""


@dataclass(frozen=True)
class Drawing:
    """When importance sampling ends.

    enough : draws that count, with which it does, in the first ``early`` rounds
    enough_later : and from then on
    most_rounds : at most; what is not found by then is not found
    share : of the sum, from which on a hypothesis is checked so: effort, not belief
    """

    enough: float
    early: int
    enough_later: float
    most_rounds: int
    share: float


@dataclass(frozen=True)
class SampledThresholds:
    """How linear evidence is checked by importance sampling, where it decides."""

    draws: int = 128
    """Of a round."""
    first: Drawing = Drawing(enough=60.0, early=2, enough_later=8.0, most_rounds=8, share=0.003)
    """Of all that may decide."""
    last: Drawing = Drawing(enough=100.0, early=0, enough_later=100.0, most_rounds=40, share=0.03)
    """Of what then leads: two runs of one hypothesis of which few draws count are 0.4 apart in ln Z in the mean, and
    0.9 by the first ones; docs/studies/few_draws.md."""
    vague: Drawing = Drawing(enough=60.0, early=2, enough_later=8.0, most_rounds=8, share=0.03)
    """Instead of both, where what leads leaves more than noise."""
    may_change: float = 8.0
    """ln of a share by which draws bring one forward: linear evidences are 7 to 11 off; docs/studies/few_draws.md."""
    freedom: float = 6.0
    """Of the t-distribution: tails that no posterior of this kind has more of."""
    kept: float = 0.1
    """Of the covariance that draws came from, added to theirs: few draws know no direction well."""
    to_fit: float = 3.0
    """Draws a coordinate that must count for a covariance to be fitted to them."""
    flatter: float = 0.7
    """By which the power of their weights falls until as many do."""
    flattest: float = 0.02
    """Of that power, at least."""
    round_off: float = 1e-9
    """Of a variance."""
    least: float = 1.5
    """Draws that count, with fewer of which the linear ln Z stands."""
    all_seen: float = 0.4
    """Part of the draws that count, with which no tail is missed."""
    unseen: float = 0.6
    """Times ln(`all_seen` / e) is what draws miss of ln Z, if a part e of them counts; docs/studies/few_draws.md."""
    most: int = 60
    """Hypotheses that are checked: effort, not belief."""


@dataclass(frozen=True)
class GrowthThresholds:
    """How far the sets of effects are followed: effort, not belief."""

    beam: int = 4
    """Sets that a further effect is added to: the first of a pair is often not the best alone."""
    beam_reach: float = 60.0
    """ln of the Bayes factor, as far as factors count, behind the best set of its size, beyond which one is left."""
    beam_by_squares: int = 2
    """Sets that a further effect is added to besides, for leaving the least squares."""
    singles_reach: float = 15.0
    """ln of the Bayes factor behind the best single effect, up to which every one is tried with every energy."""
    refits: int = 6
    """Effects that are fitted beside each of these sets, by what their traces promise."""
    refit_reach: float = 40.0
    """ln of the Bayes factor that a trace may promise less than the best one, and still be fitted."""
    promise: float = 0.0
    """ln of the Bayes factor that a trace must promise for a fit, and an effect must bring for further energies."""
    least_refits: int = 2
    """Effects that are fitted beside each of these sets none the less, for a trace is that of a little effect."""
    second_events: int = 2
    """Places of a second event that are searched from, those that promise most."""
    no_event: float = 0.03
    """Part of what came at once, below which there was no second event yet."""
    second_part: float = 0.3
    """Part of what came at once that a second event begins with, which is its expected size."""
    with_other_energies: int = 3
    """Sets of each size that are tried with every energy."""
    untried: int = 6
    """Sets beside which further effects that nobody fitted are weighed by their traces."""
    further_starts: int = 1
    """Draws of the material's prior that searches for a first effect start from, besides the plain fit."""
    polished: int = 12
    """Sets of each size that are searched on with their own form error, at most."""
    polish_reach: float = 25.0
    """ln of the Bayes factor behind the best set of its size, beyond which one is left as it is: that gains less."""
    energy_reach: float = 30.0
    """ln of the Bayes factor behind the best energy, beyond which one is not tried with further sets of a size."""
    lessened: int = 12
    """Hypotheses of each size that are tried without each of their effects, at most."""
    less_reach: float = 20.0
    """ln of the Bayes factor behind the best of all, beyond which they are not, nor searched on."""
    less_gain: float = 3.0
    """ln of the Bayes factor that such a start may be behind what was found of it before, and be searched on."""
    exchanges: int = 2
    """Times that effects of the most probable set are exchanged for others, at most."""
    exchanged: int = 2
    """Effects that each of them is exchanged for."""
    pairs: int = 10
    """Sets that two effects promise to complete together, and that nobody fitted, at most."""
    pairs_beside: int = 4
    """Sets of one effect beside which two more are looked at together."""
    pairs_reach: float = 6.0
    """ln of the Bayes factor that two effects may promise less than the best two."""
    searched_again: int = 4
    """Sets of each size that are searched for from all of their parts."""
    again_reach: float = 12.0
    """ln of the Bayes factor, as far as factors count, behind the best of all, beyond which they are not."""
    crossed: float = 0.005
    """Share in the sum from which on a hypothesis is searched for from the materials of others of its energy."""
    most_crossed: int = 16
    """Hypotheses of which that is done, at most."""
    crossed_with: int = 3
    """Others whose materials are taken for each, at most."""
    with_best_effects: int = 2
    """Sets that every energy is searched with once more, from the effects that the best one has."""
    to_the_end: int = 24
    """Hypotheses that are searched for to the end before they are checked, at most."""
    share_reach: float = 40.0
    """ln of the odds against the most probable hypothesis, beyond which one has no share in the sum."""
    worth: float = 1e-3
    """Of the probability of all smaller sets: below it, larger sets are not looked at."""
    round_off: float = 3e-6
    """Of the squares of a slope: what is left of it below that, freed of what the base follows, is round-off. With a
    noise of a millionth of the force it was -8e-7 to 9e-7."""


@dataclass(frozen=True)
class TwinsThresholds:
    """When two effects cannot be told apart by a test, beside `DETECTION.near_degrees`."""

    speeds: float = 1.5
    """Times by which the fastest part of a leg is faster than the slowest: below it the disc moved at one speed."""
    readings: int = 5
    """Of a leg, or a part of it, at least, for its speed to count."""
    parts: int = 3
    """Of a leg, whose speeds count each for itself: a drive may change its speed on the way. By the medians of thirds
    a drive that speeds up and brakes over a sixth of a leg each has one speed."""
    alike: float = 0.05
    """Of the misfit beyond noise: a set that leaves more than this beyond its twin does not fit as it does. It is the
    square of a law that is 22 % off."""
    behind: float = 12.0
    """ln of the Bayes factor: a set that is further behind its twin is told apart all the same, whatever it leaves, for
    laws of the deflection alone are nearly exact. On the calibration half of `make study-reliability` (cases 60 to 123)
    sets that were levelled at a gap of 10 to 60 were the wrong ones, each of three times; on seed 36 of
    `make study-third` a frame that yields was 9 behind an offset of the zero, which was named."""
    far_behind: float = 20.0
    """The same of effects whose laws have many shapes, whatever they leave. Loops of one width in newtons at any
    deflection, which others call hysteresis, were named friction in three of three films of ratio 8 to 23; hysteresis
    was 11, 16 and 19 behind. In five films that were named friction rightly it was 15, 21, 24, 25 and 45 behind."""
    alike_in_time: float = 0.25
    """The same where only another speed or a hold could tell: there no shape of a law counts for much."""
    back: float = 0.5
    """Of a deflection, to which the disc comes back, at least, for the way back to tell apart what only that does."""
    usual: float = 5.0
    """Times the expected size: a twin as large is told apart by being implausible."""
    least: float = 1e-3
    """Times the expected size: as small, a twin is nothing beside what it stands with."""
    added: int = 3
    """Twins of the most probable set that are fitted where they were not, at most."""


@dataclass(frozen=True)
class ForeignThresholds:
    """What no effect of the library describes, and how it is looked for."""

    least_points: int = 60
    """Readings that are needed to tell it."""
    size: float = 0.03
    """Of the largest force: the expected size of a change, a gain or what is met; a wave has a third of it."""
    sizes: tuple[float, ...] = (0.25, 1.0, 4.0)
    """Times that or what else is expected of a kind, each as probable: what goes wrong is a thousandth or a tenth."""
    places: int = 160
    """Moments of a step that are tried, at most."""
    margin: float = 0.04
    """Of the readings at either end where no step is looked for: a start or an end is none."""
    widths: tuple[float, ...] = (1e-6, 0.006, 0.018)
    """Of the whole test: how long a step takes, from at once to a few seconds."""
    rests: tuple[float, ...] = (0.01, 0.03, 0.1)
    """Of the whole test: in which what has begun comes to rest, as a temperature does."""
    passes: tuple[float, ...] = (0.03, 0.1)
    """Of the whole test: after which what comes and goes is largest."""
    lost: float = 0.02
    """Of the largest deflection: the expected loss of a drive, at once."""
    within: tuple[float, float] = (0.08, 0.92)
    """Of the largest force: where a range of an amplifier may begin."""
    met_at: tuple[float, float] = (0.6, 0.95)
    """Of the largest deflection: where a disc may meet something; before that it would hardly be lifted on."""
    levels: int = 48
    """Of either that are tried."""
    waves: int = 800
    """Waves that are tried over time, and as many over deflection, at most."""
    wave_step: float = 0.35
    """Of a wave over the range, between two that are tried: half of it off, a wave loses a tenth of its squares."""
    promise: float = 0.0
    """ln of the Bayes factor of the most probable member, its chance left out, from which on the noise is estimated
    beside it, too."""
    least_waves: float = 4.0
    """Over the range: fewer are a bend."""
    plays: tuple[float, ...] = (0.002, 0.006, 0.02)
    """Of the largest deflection: over which a play of the drive is taken up after a reversal."""
    play: float = 0.01
    """Of the largest deflection: the expected play."""
    plateau: int = 5
    """Readings that share the largest force: as many are no chance."""
    spare: int = 6
    """Readings beyond the parameters that must be left beside those at the limit."""
    settled: float = 15.0
    """ln of the Bayes factor by which a limit that leaves noise alone must be ahead of all single effects for sets of
    several not to be grown."""
    settled_sd: float = 3.0
    """Standard deviations of the squares of noise within which what it leaves is noise."""
    met: int = 3
    """Readings of a steady motion that yield to a limit, at the least."""
    beyond: float = 4.0
    """Standard deviations of the noise by which a reading may be above a limit of the load cell."""
    ln_unnamed: tuple[float, float] = (-4.6, 1.0)
    """Mean and sd of ln of what is smooth and has no name, in parts of the force: 1 % within a factor of three."""
    bases: int = 3
    """Of the most probable sets, and the plain model, beside which it is looked for."""


@dataclass(frozen=True)
class SaturationThresholds:
    """A load cell that yields before its limit: what is expected of it, and how it is looked for."""

    ln_width: tuple[float, float] = (-5.3, 1.2)
    """Mean and sd of ln(1 / p): half of the prior yields within 0.5 % of the limit, 95 % within 0.05 to 5 %."""
    sharpness: float = 100.0
    """Of the first step: what yields within one per cent is seen to be softer or harder."""
    lower: tuple[float, ...] = (0.97, 0.9, 0.75)
    """Of the largest reading: films are fitted to the readings below, for one that sees the others is bent."""
    highest: int = 5
    """Readings whose mean is the first guess of a limit."""
    promise: float = 8.0
    """Squares, in those of the noise, that a limit must promise to take away, to first order, to be looked for."""
    tried: tuple[float, ...] = (0.95, 0.98, 1.0, 1.02, 1.05)
    """Of the largest reading: limits for that."""
    sharpnesses: tuple[float, ...] = (30.0, 100.0, 300.0)
    """And how sharp they are."""
    spare: int = 6
    """Readings beyond the parameters that must be left below."""
    steps: int = 12
    """Of a search, at most."""
    halvings: int = 5
    """Of a step that gains nothing, at most."""
    farthest_width: float = 8.0
    """Standard deviations of ln(1 / p), at most: a step so long is none, as where a noise of nothing is stated."""
    largest_step: float = 0.2
    """In ln of the limit."""
    tolerance: float = 0.05
    """In ln p: a search ends where a step gains less."""


@dataclass(frozen=True)
class VerdictThresholds:
    """How probable an answer must be."""

    sure: float = 0.95
    """From which an answer is given; sets of an ambiguous one hold as much together."""
    least_member: float = 0.01
    """Of a set that stands beside one which has next to all by the laws of the library, and is not told to be sure."""
    nearly_certain: float = 0.88
    """Of an effect, whatever else is at work, from which it is in all that is probable, as far as can be said beside
    what is told of other sets (`Beliefs.elsewhere`, `Effect.mistaken`). Reckoned from stored answers of 403 films of
    three generators by other hands, effects that have as much were there in 214 of 229, from 0.88 to 0.9 in 16 of 17,
    from 0.8 to 0.88 in 39 of 51. Before `Effect.mistaken` those that had 0.9 were there in 291 of 351."""
    doubted: float = 0.8
    """Of no effect, and of nothing foreign, where no test sees a misfit: if both are more probable, the answer is that
    nothing is missing; if one is less by traces to first order, all are weighed. It was 0.85 while none had four in ten
    before the data, and not three, which means nearly the same. By that, of 104 plain films (`make study-loop`, seeds
    300000 to 300159) 2 had less, and 12 less than 0.95; of five films with effects of ratios 3 to 8 that no test saw,
    on both generators, three."""
    alike: float = 3.0
    """Times by which an energy is more probable than another one with the same effects, up to which the one with fewer
    parameters stands for the set: what is sampled, and told. Probabilities are those of all."""
    most_members: int = 6
    """Of an ambiguous answer; if more are needed and nothing `leads`, nothing can be told. Only so many are held
    against each other when further tests are looked for."""
    looked_again: int = 2
    """Times that sets which nobody fitted are fitted for the answer's sake."""
    leads: float = 1 / 3
    """Probability of an effect, whatever else is at work, or of none, from which on a test that decides on it is worth
    making. Of seven films of seeds 993000 and 36 of `make study-second` and `study-third` whose first effect has a
    third to a half it is there in five; in the two whose first one has less there is none."""
    few: tuple[int, float] = (3, 0.6)
    """So many sets that hold so much together are worth telling as well: a strip and a sheet whose thicknesses or gains
    do not agree have four effects that no test of them parts (62 % in three, as they are told)."""
    carried: float = 0.05
    """Relative error of an energy from which on none of those known is said to hold."""
    law_carried: float = 0.35
    """Relative error of a law from which on the effect is no longer the one that the library means."""
    foreign_told: float = 0.02
    """Probability of something foreign from which on it is told beside what is more probable."""
    foreign_carries: float = 0.1
    """Of the misfit beyond noise: if something foreign takes more of it than that, effects are not named beside it."""
    noise_chi2: float = 1.2
    """Reduced chi-square up to which what is left is noise, if it is little of what was there too."""
    noise_share: float = 0.1
    """Share of the misfit up to which that holds."""
    form_carries: float = 0.5
    """Of what is left beyond noise: then the form error is said to carry it."""
    at_a_turn: float = 0.02
    """Of the time of a test about a turn: what begins there, beside what makes loops or at the last turn, is not named.
    A cycle of acrylic tape was named hysteresis and a tear at its turn (97 %, one energy declared), and it relaxes."""
    loads_again: float = 0.5
    """Of the deflection of a turn: the last one is that after which no loading comes back so far."""
    law_small: float = 0.1
    """Relative error of a law, twice what is expected, up to which it may carry what a name leaves."""
    chance: float = 3.0
    """Standard deviations of reduced chi-square above 1 from which what a name leaves is no chance. Of 53 names on 260
    synthetic cases, 2 left more than that and `noise_chi2`; both were wrong, and 3 of the others."""
    firm: float = 1.5
    """Times what a model leaves beyond noise, that an effect must explain by itself to be more than what other laws
    leave. On two strips of silicone, each stretched twice to the double, whose load cell had an offset and whose first
    millimetres were slack, set and offsets have 2.1 to 5 where no more than three effects are told, and a drift that
    is not there has 1.0."""
    least_coverage: float = 0.45
    """Of held-out points inside the 90 % band: a model that covers fewer predicts nothing, and is not named."""


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
    """Standard deviations between rivals: beyond it, that test settles it: a twentieth of the doubt stays."""
    helps: float = 2.0
    """Beyond it, the test is worth making: of the doubt that there is, two fifths at least go."""


@dataclass(frozen=True)
class OtherTestsThresholds:
    """What is predicted of tests that no fit saw."""

    band: float = 0.90
    """Probability of the band."""
    members: int = 12
    """Hypotheses that predict, the most probable first."""
    draws: int = 4000
    """Of all of them together."""


@dataclass(frozen=True)
class LoopThresholds:
    """The closed loop."""

    most_steps: int = 1600
    """Of each ensemble of walkers: where a curve leaves shapes of a law open, they would walk for a quarter of an hour
    (Ogden with Mullins on the synthetic film). The run says that it ended there, and its effective sample size: Yeoh
    with Mullins there is worth 1460 draws by then. A mixture that proposes all of it is no way out: with 150 to
    350 components its weights have tails (k-hat 0.3 to 0.8), and single states hold a chain for hundreds of steps."""
    most_rounds: int = 3
    """Two added effects are as many as a curve can carry; the third round says that nothing more is missing."""
    leaders: int = 0
    """Members of an ambiguous answer that are sampled unless more is asked for. Each is a calibration of its own: of
    the paper's curve up to 91.5 mm the first takes minutes, for its parameters go together; the next test decides."""
    band: float = 0.9
    """Part of new readings that a predictive band is to cover."""
    sure: float = 0.1
    """Error of ln Z up to which the weights of a run's own proposals do for it."""


@dataclass(frozen=True)
class WordsThresholds:
    """From where on something is worth a sentence."""

    likely: float = 0.5
    """Probability of an effect, summed over sets, from which on an ambiguous answer says so."""
    nearly_all: float = 0.9
    """The same from which on it is told first, and the sets by what they add to it."""
    rounded: float = 0.25
    """Part of the variance of the noise that is rounding, from which on it is told."""
    listed_sets: int = 4
    """Sets of an ambiguous answer that are told with their sizes; of more the rest are counted."""
    listed_readings: int = 6
    """Of those set aside, the numbers that are told."""
    visible_effects: int = 3
    """Smallest sizes that are told of an adequate model."""
    probable: float = 0.01
    """Probability from which an explanation is told first."""
    nearly: float = 1e-3
    """A probability as near to 0 or 1 is told as that."""
    digits_from: float = 0.1
    """Probability from which a third digit is told."""
    all_of_it: float = 0.995
    """Share of the misfit: nothing was taken away."""
    law_error: float = 0.03
    """Relative error of a law from which on it is told."""
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
    soft_limit: float = 0.01
    """Of a limit, over what part of it the reading yields: from there on it is told to be soft."""
    same_reading: float = 0.01
    """Of the load cell's step: readings that differ by less are the same."""


NOISE = NoiseThresholds()
REFERENCE = ReferenceThresholds()
OUTLIERS = OutlierThresholds()
DETECTION = DetectionThresholds()
SEARCH = SearchThresholds()
SIZES = Sizes()
FORM = FormThresholds()
OTHER_TESTS = OtherTestsThresholds()
SAMPLED = SampledThresholds()
GROWTH = GrowthThresholds()
TWINS = TwinsThresholds()
FOREIGN = ForeignThresholds()
SATURATION = SaturationThresholds()
VERDICT = VerdictThresholds()
HELD_OUT = HeldOutThresholds()
DISCREPANCY = DiscrepancyThresholds()
NEXT_TEST = NextTestThresholds()
LOOP = LoopThresholds()
WORDS = WordsThresholds()
