"""The search by trial: it finds what is known, nothing but the seed decides what it tries, and it says so when it is cut short."""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from time import sleep

import numpy as np
import pytest

from octoctrl.planners.solving.cross_entropy import Judgement, Unknowns, search
from octoctrl.sim.errors import OctoctrlError

LOWEST = np.array([0.3, -0.6, 1.0])
SPACE = Unknowns(names=("a", "b", "c"), mean=np.zeros(3), spread=np.full(3, 0.5), low=np.full(3, -2.0), high=np.array([2.0, 2.0, 0.8]))


def bowl(x, worth=np.inf):
    """Narrow across two of its axes, lowest outside the box in the third."""
    away = x - LOWEST
    return Judgement(price=float(away @ away + 5 * (away[0] + away[1]) ** 2), simulated=2.0)


def jittery(x, worth):
    sleep(0.002 * np.random.default_rng(int(1e6 * abs(x[0]))).random())
    return bowl(x)


@pytest.fixture
def one():
    with ThreadPoolExecutor(1) as pool:
        yield pool


def test_it_finds_the_lowest_point_of_the_box(one):
    found = search(bowl, SPACE, one, rounds=25, population=30)
    np.testing.assert_allclose(found.best.x, [0.3, -0.6, 0.8], atol=0.03)
    assert found.best.price == bowl(found.best.x).price
    assert found.runs == len(found.candidates) == 25 * 30 and found.simulated == 2.0 * found.runs
    assert [price for price, _ in found.rounds] == sorted((price for price, _ in found.rounds), reverse=True)


def test_what_is_tried_depends_on_the_seed_alone(one):
    def tried(executor, judge, seed):
        return np.array([item.x for item in search(judge, SPACE, executor, seed=seed, rounds=3).candidates])

    expected = tried(one, bowl, 3)
    with ThreadPoolExecutor(4) as four:
        np.testing.assert_array_equal(tried(four, jittery, 3), expected)
    assert not np.array_equal(tried(one, bowl, 4), expected)


def test_the_mean_and_what_is_given_are_tried_first_and_inside_the_box(one):
    given = np.array([5.0, 0.0, 5.0])
    found = search(bowl, SPACE, one, rounds=1, population=4, first=[given])
    tried = [item.x.tolist() for item in found.candidates]
    assert [0.0, 0.0, 0.0] in tried and [2.0, 0.0, 0.8] in tried
    assert all((item.x >= SPACE.low).all() and (item.x <= SPACE.high).all() for item in found.candidates)


def test_whoever_judges_is_told_what_is_worth_knowing(one):
    """What is beyond the worst of the elite may be judged by a guess: the same numbers are tried."""
    told = []

    def careless(x, worth):
        told.append(worth)
        found = bowl(x)
        return found if found.price <= worth else Judgement(price=found.price + 1.0)

    def tried(judge):
        return search(judge, SPACE, one, seed=5, rounds=4, population=30, elite=3)

    exact, rough = tried(bowl), tried(careless)
    assert told[:30] == [np.inf] * 30 and len(set(told)) == 4 and sorted(told, reverse=True) == told
    assert rough.best.price == exact.best.price and rough.rounds == exact.rounds


def test_a_search_goes_on_where_one_ended(one):
    first = search(bowl, SPACE, one, rounds=3, population=20)
    best, spread = first.best.price, first.spread.copy()
    on = search(bowl, SPACE, one, seed=1, rounds=12, population=20, after=first)
    assert on is first and len(on.rounds) == 15 and on.runs == len(on.candidates) == 300
    assert on.best.price < best and (on.spread < spread).all() and on.worth >= on.best.price
    np.testing.assert_allclose(on.best.x, [0.3, -0.6, 0.8], atol=0.05)


def test_a_price_that_is_enough_ends_it_after_the_round(one):
    found = search(bowl, SPACE, one, rounds=50, population=10, enough=0.2)
    assert found.ended == "good enough" and found.best.price <= 0.2 and len(found.candidates) % 10 == 0 and len(found.rounds) < 50


def test_what_meets_all_goes_first_and_ends_it(one):
    """What is met lies far from what is cheapest."""

    def judge(x, worth):
        return Judgement(price=bowl(x).price, met=bool(x[2] < -0.5))

    found = search(judge, SPACE, one, seed=2, rounds=50, population=20)
    assert found.ended == "good enough" and found.best.x[2] < -0.5 and len(found.rounds) < 50
    assert found.best.price > min(item.price for item in found.candidates)


def interrupted(calls, x, worth):
    calls.append(x)
    if len(calls) == 13:
        raise KeyboardInterrupt
    return bowl(x)


def test_an_interrupt_leaves_what_was_judged(one):
    found = search(partial(interrupted, []), SPACE, one, rounds=5, population=10)
    assert found.ended == "interrupted" and len(found.candidates) == 12 and "interrupted" in str(found)
    assert found.best.price == min(bowl(item.x).price for item in found.candidates)


def test_time_that_is_up_ends_it(one):
    calls = iter(range(100))
    found = search(bowl, SPACE, one, rounds=5, population=10, stop=lambda: next(calls) >= 14)
    assert found.ended == "the time was up" and len(found.candidates) == 14
    nothing = search(bowl, SPACE, one, stop=lambda: True)
    with pytest.raises(OctoctrlError, match="over before anything was judged"):
        _ = nothing.best


def test_candidates_that_are_kept_lie_apart(one):
    found = search(bowl, SPACE, one, rounds=6, population=20)
    kept = found.apart(4, 0.6)
    assert kept[0] is found.best and len(kept) == 4
    apart = [np.linalg.norm((a.x - b.x) / 0.5) for i, a in enumerate(kept) for b in kept[:i]]
    assert min(apart) > 0.6


def test_unknowns_that_do_not_fit_are_refused():
    with pytest.raises(OctoctrlError, match="mean has shape"):
        Unknowns(names=("a",), mean=np.zeros(2), spread=np.ones(1), low=np.zeros(1), high=np.ones(1))
    with pytest.raises(OctoctrlError, match="unknown 'a': 1 to 0 is no range"):
        Unknowns(names=("a",), mean=np.zeros(1), spread=np.ones(1), low=np.ones(1), high=np.zeros(1))
