"""A group that does nothing is found and named, and nothing else is taken for that."""

import numpy as np
import pytest

import octoctrl as oc
from octoctrl import tasks
from octoctrl.planners.fitting.identified import load_identified
from octoctrl.planners.following.watch import AFTER_WORK, DOUBT, DRAG_DOUBT, EVIDENCE, KINSHIP, GroupWatch
from octoctrl.planners.solving import planner
from octoctrl.sim.running.sensors import Sensors

GROUPS = ("LM1", "LM2", "R-OM")


def prior():
    kin = np.array([[1, KINSHIP, 0, 0], [KINSHIP, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, (DRAG_DOUBT / DOUBT) ** 2]], dtype=float)
    return DOUBT**2 * kin


def test_evidence_is_the_ratio_of_two_normal_densities():
    """Against scipy's densities of all surprises at once, none of them forgotten."""
    from scipy.stats import multivariate_normal

    draw = np.random.default_rng(2)
    effect, surprise = draw.normal(size=(7, 4)), draw.normal(size=7)
    watch = GroupWatch(GROUPS)
    watch.add(effect, surprise)
    alive = multivariate_normal(cov=np.eye(7) + effect @ prior() @ effect.T).logpdf(surprise)
    for index, group in enumerate(GROUPS):
        others = np.delete(np.arange(4), index)
        covariance = np.eye(7) + effect[:, others] @ prior()[np.ix_(others, others)] @ effect[:, others].T
        dead = multivariate_normal(mean=-effect[:, index], cov=covariance).logpdf(surprise)
        assert watch.evidence()[group] == pytest.approx(dead - alive, abs=1e-9)


def test_no_evidence_without_effect():
    watch = GroupWatch(GROUPS)
    watch.add(np.zeros((5, 4)), np.full(5, 10.0))
    assert max(map(abs, watch.evidence().values())) < 1e-9 and watch.dead == ()


def test_what_no_hypothesis_explains_counts_as_noise():
    """The same ratio of densities, of wider noise: what the best hypothesis leaves, over the number of surprises."""
    from scipy.stats import multivariate_normal

    draw = np.random.default_rng(3)
    effect, surprise = draw.normal(size=(40, 4)), 9.0 * draw.normal(size=40)
    watch = GroupWatch(GROUPS)
    watch.add(effect, surprise)
    unit = [(surprise, np.eye(40) + effect @ prior() @ effect.T)]
    for index in range(3):
        others = np.delete(np.arange(4), index)
        unit.append((surprise + effect[:, index], np.eye(40) + effect[:, others] @ prior()[np.ix_(others, others)] @ effect[:, others].T))
    noise = min(rest @ np.linalg.solve(covariance, rest) for rest, covariance in unit) / 40
    assert noise > 10
    (_, spread), *rivals = unit
    alive = multivariate_normal(cov=spread + (noise - 1) * np.eye(40)).logpdf(surprise)
    for group, (rest, covariance) in zip(GROUPS, rivals, strict=True):
        dead = multivariate_normal(cov=covariance + (noise - 1) * np.eye(40)).logpdf(rest)
        assert watch.evidence()[group] == pytest.approx(dead - alive, abs=1e-9)


def test_a_group_that_was_seen_to_work_is_not_called_dead_so_soon():
    """The same evidence against two groups, of which one has worked before."""
    doubtful = np.zeros((1, 4))
    doubtful[0, 0] = 4.1  # dead: a surprise of -4.1; within the prior of the living by no more than a quarter of it
    fresh, seasoned = GroupWatch(GROUPS), GroupWatch(GROUPS)
    works = np.zeros((1, 4))
    works[0, 0] = 12.0
    for _ in range(3):
        seasoned.add(works, np.zeros(1))
    for _ in range(40):
        seasoned.add(np.zeros((1, 4)), np.zeros(1))
    for _ in range(3):
        fresh.add(doubtful, -doubtful[:, 0])
        seasoned.add(doubtful, -doubtful[:, 0])
    assert seasoned.working == {"LM1"} and fresh.working == frozenset()
    assert EVIDENCE < seasoned.evidence()["LM1"] < AFTER_WORK and seasoned.dead == ()
    assert fresh.dead == ("LM1",)
    # More of the same says no more: a lone group may be as weak as that. That its kin works meanwhile does.
    for _ in range(40):
        seasoned.add(3 * doubtful, -3 * doubtful[:, 0])
    assert EVIDENCE < seasoned.evidence()["LM1"] < AFTER_WORK and seasoned.dead == ()
    kin = np.zeros((1, 4))
    kin[0, GROUPS.index("LM2")] = 12.0
    for _ in range(12):
        seasoned.add(np.vstack((3 * doubtful, kin)), np.append(-3 * doubtful[:, 0], 0.0))
    assert seasoned.evidence()["LM1"] > AFTER_WORK and seasoned.dead == ("LM1",)


def test_a_group_that_dies_on_the_way_is_found_and_stays_named():
    draw, watch, found = np.random.default_rng(4), GroupWatch(GROUPS), []
    for period in range(60):
        effect, errors = 2 * draw.normal(size=(8, 4)), np.array([0.1, 0.0 if period < 30 else -1.0, 0.05, 0.3])
        watch.add(effect, effect @ errors + draw.normal(size=8))
        found.append(watch.dead)
    assert found[29] == () and found[45] == ("LM2",) == found[-1]


def test_a_state_is_all_that_is_remembered():
    draw = np.random.default_rng(5)
    one, other = GroupWatch(GROUPS), GroupWatch(GROUPS)
    one.add(draw.normal(size=(8, 4)), draw.normal(size=8))
    other.restore(one.state())
    effect, surprise = draw.normal(size=(8, 4)), draw.normal(size=8)
    one.add(effect, surprise)
    other.add(effect, surprise)
    assert one.evidence() == other.evidence() and one.dead == other.dead


@pytest.fixture(scope="module")
def plan():
    configuration = tasks.load("coil")
    return planner.plan(configuration.task, load_identified(configuration.arm, configuration.scene), time_limit=600.0)


@pytest.mark.parametrize("group", ["LM1", "LM2", "LM8"])
def test_a_dead_muscle_of_the_coil_is_named_soon_after_it_should_have_acted(plan, group):
    """Half a second after its level would have passed a twentieth."""
    run = oc.execute(plan, plant=oc.make_plant("rod", plan.arm, plan.scene, gains={group: 0.0}))
    named = run.report.controller.dead_groups
    assert list(named) == [group]
    times = np.arange(0.0, plan.schedule.duration, 0.01)
    levels = plan.schedule.activation().levels(times, plan.arm.edges)[:, plan.arm.layout.names.index(group)].max(axis=1)
    assert named[group] <= times[np.argmax(levels > 0.05)] + 0.5
    assert group in str(run) and EVIDENCE > 0


def weaker(arm, factor):
    from dataclasses import replace

    return replace(
        arm,
        oblique=replace(arm.oblique, maximum_stress=factor * arm.oblique.maximum_stress),
        longitudinal=replace(arm.longitudinal, maximum_stress=factor * arm.longitudinal.maximum_stress),
    )


def test_no_group_is_called_dead_that_is_not(plan):
    """Exact, much weaker muscles with heavy water, one muscle at half its strength, and noise with a delay."""
    plants = [
        (oc.make_plant("rod", plan.arm, plan.scene), None),
        (oc.make_plant("rod", weaker(plan.arm, 0.75), oc.Scene.free(factor=2.0)), None),
        (oc.make_plant("rod", plan.arm, plan.scene, gains={"LM2": 0.6}), None),
        (oc.make_plant("rod", plan.arm, plan.scene), Sensors(delay=0.05, position_noise=5e-4, angle_noise=np.radians(1.0))),
    ]
    for plant, sensors in plants:
        run = oc.execute(plan, plant=plant, sensors=sensors)
        assert dict(run.report.controller.dead_groups) == {}
