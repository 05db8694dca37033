"""From answers to a Weber fraction, beside other integrals, other programs' numbers and drawn observers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, stats

from palpate.exam import contrast_at, estimate, proportion_correct
from palpate.exam.staircase import Staircase


@pytest.mark.parametrize("alternatives", [2, 3, 4, 8])
def test_without_a_contrast_there_is_chance(alternatives):
    assert proportion_correct(np.array(0.0), 0.1, alternatives) == pytest.approx(1 / alternatives, abs=1e-9)


def test_two_places_are_the_difference_of_two_normal_variables():
    # Right where (1 + x)(1 + w n) > 1 + w n': the difference has the mean x and the deviation w sqrt(1 + (1 + x)^2).
    for x, w in ((0.02, 0.05), (0.1, 0.1), (0.4, 0.15)):
        expected = stats.norm.cdf(x / (w * np.hypot(1.0, 1.0 + x)))
        assert proportion_correct(np.array(x), w, 2) == pytest.approx(expected, abs=1e-8)
    # At the Weber fraction two places are told apart in 76 % of trials, and 75 % are reached at 0.954 of it.
    assert proportion_correct(np.array(1e-6), 1e-6, 2) == pytest.approx(stats.norm.cdf(1 / np.sqrt(2)), abs=1e-5)
    assert contrast_at(0.75, 1e-6, 2) == pytest.approx(0.954e-6, rel=1e-3)


@pytest.mark.parametrize(("x", "w", "m"), [(1e-7, 1e-7, 3), (1.7e-7, 1e-7, 4), (0.17, 0.09, 5), (0.5, 0.3, 8)])
def test_many_places_as_an_integral(x, w, m):
    whole, _ = integrate.quad(
        lambda t: stats.norm.pdf(t) * stats.norm.cdf(x / w + (1 + x) * t) ** (m - 1), -8, 8, epsabs=1e-12
    )
    assert proportion_correct(np.array(x), w, m) == pytest.approx(whole, abs=1e-8)


def test_a_probability_that_is_never_reached_has_no_contrast():
    # Noise in proportion to a hard nodule itself: P comes no nearer to one than Phi(1/w) = 0.84.
    assert contrast_at(0.9, 1.0, 4) == np.inf
    assert np.isfinite(contrast_at(0.8, 1.0, 4))


def test_the_estimate_is_that_of_drawn_observers_and_the_interval_holds_them():
    draw, w, m = np.random.default_rng(1), 0.11, 4
    contrasts = np.tile([0.06, 0.12, 0.2, 0.3], 25)
    found = []
    for _ in range(150):
        others = 1 + w * draw.standard_normal((len(contrasts), m - 1))
        nodule = (1 + contrasts) * (1 + w * draw.standard_normal(len(contrasts)))
        found.append(estimate(contrasts, (nodule > others.max(axis=1)).astype(float), m))
    fractions = np.array([one.weber_fraction for one in found])
    # The lapses that are allowed for are a little too many for hands that have none, and w that much too small.
    assert np.median(fractions) == pytest.approx(w, rel=0.1)
    # Of 150 intervals of 95 %, 135 or fewer would hold the truth once in some hundred times.
    assert sum(one.low <= w <= one.high for one in found) > 135


def test_answers_that_bound_nothing_say_so():
    contrasts = np.full(20, 0.2)
    assert estimate(contrasts, np.ones(20), 4).low == 0.0
    chance = np.tile([1.0, 0.0, 0.0, 0.0], 5)
    assert estimate(contrasts, chance, 4).high == np.inf


@pytest.mark.parametrize("target", [0.6, 0.75, 0.85])
def test_the_staircase_hovers_where_answers_are_right_so_often(target):
    # Kaernbach: right with the probability p(x) = 1/4 + 3/4 (1 - exp(-x/0.1)); it seeks p = target.
    draw, staircase = np.random.default_rng(2), Staircase(1e-3, 10.0, target)
    seen = []
    for _ in range(6000):
        right = 0.25 + 0.75 * (1 - np.exp(-staircase.contrast / 0.1))
        seen.append(right)
        staircase.answered(float(draw.random() < right))
    assert np.mean(seen[100:]) == pytest.approx(target, abs=0.02)


def test_none_moves_the_staircase_as_guesses_do_in_the_mean():
    one, guesses = Staircase(1e-6, 1.0, 0.75), [Staircase(1e-6, 1.0, 0.75) for _ in range(4)]
    for staircase in (one, *guesses):  # off the bound at which it starts
        for _ in range(8):
            staircase.answered(1.0)
    one.answered(0.25)
    for rank, staircase in enumerate(guesses):
        staircase.answered(float(rank == 0))
    # A first reversal is no small step yet.
    assert np.log(one.contrast) == pytest.approx(np.mean([np.log(each.contrast) for each in guesses]), rel=1e-12)
