"""The compiled rod against PyElastica, against plain NumPy written apart from it, and against what physics conserves."""

import platform
import re
import time

import numpy as np
import pytest

from octoctrl.sim.body.layout import OCTOPUS_MUSCLES, MuscleLayout
from octoctrl.sim.body.muscles import LONGITUDINAL, TRANSVERSE
from octoctrl.sim.physics.fibre_kernels import law_constants
from octoctrl.sim.rod.elastic import RodSimulation
from octoctrl.sim.rod.elastic_kernels import rod_kernels
from octoctrl.sim.rod.layout import STRIDES, Row, new_buffer, stride_for
from octoctrl.sim.rod.rod import Rod
from octoctrl.sim.rod.section_kernels import DISSIPATION, fibre_kernels, section_kernels
from octoctrl.sim.rotations import rotation_matrix, rotation_vector

LENGTH, RADIUS, DENSITY, YOUNG = 0.2, 0.006, 1050.0, 1e5
MATERIAL = {"length": LENGTH, "radius": RADIUS, "density": DENSITY, "youngs_modulus": YOUNG, "shear_modulus": YOUNG / 1.5}
TIP_FORCE = (3e-3, 0.0, 6e-3)


def tumbling(elements):
    """Velocities of nodes and spins of elements that turn, bend, twist and stretch the rod."""
    s, k = np.linspace(0, 1, elements + 1), np.linspace(0, 1, elements)
    velocities = np.stack([0.1 * np.sin(3 * s), 0.05 * np.cos(2 * s), 0.1 * s**2], axis=1)
    return velocities, np.stack([np.full(elements, 0.3), np.sin(6 * k), 5 * np.cos(3 * k)], axis=1)


def pyelastica(elements, dt, steps, support):
    """Positions and directors after `steps`, and the seconds that they took (the first steps, which compile, left out)."""
    elastica = pytest.importorskip("elastica")

    class System(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing):
        pass

    system = System()
    rod = elastica.CosseratRod.straight_rod(
        elements, np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), LENGTH, RADIUS, DENSITY,
        youngs_modulus=YOUNG, shear_modulus=YOUNG / 1.5,
    )  # fmt: skip
    system.append(rod)
    if support == "element":
        system.constrain(rod).using(elastica.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
        system.add_forcing_to(rod).using(elastica.EndpointForces, np.zeros(3), np.array(TIP_FORCE), ramp_up_time=1e-12)
    else:
        velocities, spins = tumbling(elements)
        rod.velocity_collection[:], rod.omega_collection[:] = velocities.T, spins.T
    system.finalize()
    stepper, now = elastica.PositionVerlet(), 0.0
    for _ in range(10):
        now = stepper.step(system, now, dt)
    begin = time.perf_counter()
    for _ in range(steps - 10):
        now = stepper.step(system, now, dt)
    return rod.position_collection.T, np.moveaxis(rod.director_collection, 2, 0), time.perf_counter() - begin


@pytest.mark.parametrize("support", ["free", "element"])
def test_agrees_with_pyelastica_and_is_fifteen_times_as_fast(support):
    elements, dt, steps = 100, 2e-5, 10_000
    ours = RodSimulation(Rod.straight(elements=elements, support=support, **MATERIAL), dt=dt)
    rest = ours.points
    if support == "element":
        ours.load(tip_force=TIP_FORCE)
    else:
        ours.velocities, ours.spins = tumbling(elements)
    ours.advance(10 * dt)
    begin = time.perf_counter()
    ours.advance((steps - 10) * dt)
    spent = time.perf_counter() - begin
    points, frames, theirs = pyelastica(elements, dt, steps, support)
    assert np.abs(points - rest).max() > 0.05 * LENGTH
    assert np.abs(ours.points - points).max() < 1e-9 * LENGTH
    assert np.abs(ours.frames - frames).max() < 1e-9
    # Ours takes some 10 ms: one interruption would decide. The quickest of six equal stretches is what the kernel needs.
    for _ in range(5):
        begin = time.perf_counter()
        ours.advance((steps - 10) * dt)
        spent = min(spent, time.perf_counter() - begin)
    assert theirs / spent >= 15


# A twin of one elastic step in plain NumPy, from the equations; the logarithm is the exact one.


def elastic_step(x, v, q, w, rod, h, couple, force):
    """Positions, velocities, frames and spins one step of `h` later, without damping."""
    length = np.linalg.norm(np.diff(rod.points, axis=0), axis=1)
    area = np.pi * rod.radius**2
    second = area**2 / (4 * np.pi)
    inertia = rod.density * (length * second)[:, None] * np.array([1.0, 1.0, 2.0])
    mass = np.zeros(len(x))
    mass[:-1] += rod.density * area * length / 2
    mass[1:] += rod.density * area * length / 2
    x, q = x + h / 2 * v, rotation_matrix(h / 2 * w) @ q
    edge = np.diff(x, axis=0)
    size = np.linalg.norm(edge, axis=1)
    e, t = size / length, edge / size[:, None]
    rate = np.sum(t * np.diff(v, axis=0), axis=1) / length
    along = np.einsum("kij,kj->ki", q, t)
    shear = rod.shear_coefficient * rod.shear_modulus * area
    stiffness = np.stack([shear, shear, rod.youngs_modulus * area], axis=1)
    n = stiffness * (e[:, None] * along - np.array([0.0, 0.0, 1.0]))
    internal = np.einsum("kij,ki->kj", q, n) / e[:, None]
    joint = (length[1:] + length[:-1]) / 2
    kappa = rotation_vector(q[1:] @ np.swapaxes(q[:-1], 1, 2)) / joint[:, None]
    swell = (size[1:] + size[:-1]) / 2 / joint
    per_element = np.stack([rod.youngs_modulus * second] * 2 + [2 * rod.shear_modulus * second], axis=1)
    bending = (per_element[1:] * length[1:, None] + per_element[:-1] * length[:-1, None]) / (2 * joint[:, None])
    m = bending * kappa / swell[:, None] ** 3
    turn = np.cross(kappa, m) * joint[:, None] / 2
    torque = np.cross(along, n) * length[:, None] + np.cross(inertia * w / e[:, None], w)
    torque += inertia * w / e[:, None] * (rate / e)[:, None] + np.einsum("kij,kj->ki", q, couple)
    torque[:-1] += m + turn
    torque[1:] += -m + turn
    forces = force.copy()
    forces[:-1] += internal
    forces[1:] -= internal
    v = v + h * forces / mass[:, None]
    w = w + h * torque * e[:, None] / inertia
    return x + h / 2 * v, v, rotation_matrix(h / 2 * w) @ q, w


def random_rod(elements, random):
    """A graded, bent, twisted, stretched rod in motion: a simulation, and its state."""
    length = 0.2 / elements * random.uniform(0.7, 1.3, elements)
    points = np.concatenate([[0.0], np.cumsum(length)])[:, None] * np.array([0.0, 1.0, 0.0])
    rest = np.broadcast_to(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), (elements, 3, 3))
    radius = 0.006 * random.uniform(0.5, 1.0, elements)
    rod = Rod(points=points, frames=rest, radius=radius, density=DENSITY, youngs_modulus=YOUNG, shear_modulus=YOUNG / 1.5)
    sim = RodSimulation(rod)
    frames = [rotation_matrix(random.normal(size=3)) @ rest[0]]
    for vector in random.normal(size=(elements - 1, 3)) * 0.2:
        frames.append(rotation_matrix(vector) @ frames[-1])
    frames = np.array(frames)
    edges = np.einsum("kij,ki->kj", frames, np.array([0.0, 0.0, 1.0]) + 0.1 * random.normal(size=(elements, 3))) * length[:, None]
    x = np.concatenate([np.zeros((1, 3)), np.cumsum(edges, axis=0)])
    sim.rows[Row.X1 : Row.X3 + 1, 1 : elements + 2] = x.T
    sim.rows[Row.Q11 : Row.Q33 + 1, 1 : elements + 1] = frames.reshape(elements, 9).T
    sim.velocities, sim.spins = 0.1 * random.normal(size=(elements + 1, 3)), 5 * random.normal(size=(elements, 3))
    return sim, (x, sim.velocities, frames, sim.spins)


@pytest.mark.parametrize("seed", range(5))
def test_one_elastic_step_agrees_with_numpy(seed):
    elements = 23
    sim, state = random_rod(elements, np.random.default_rng(seed))
    sim.load(tip_force=(1e-3, 2e-3, 3e-3), tip_couple=(1e-5, -2e-5, 1e-5), gravity=(0.0, 0.0, -9.81))
    force = sim.rows[Row.FORCE1 : Row.FORCE3 + 1, 1 : elements + 2].T
    assert np.allclose(force.sum(axis=0), np.array([1e-3, 2e-3, 3e-3 - 9.81 * sim.node_mass.sum()]), rtol=1e-12)
    couple = np.zeros((elements, 3))
    couple[-1] = 1e-5, -2e-5, 1e-5
    h = sim.dt / 4
    expected = elastic_step(*state, sim.rod, h, couple, force)
    sim.dt = h
    sim.advance(h)
    for mine, twin in zip((sim.points, sim.velocities, sim.frames, sim.spins), expected, strict=True):
        assert np.abs(mine - twin).max() < 1e-12 * max(1.0, np.abs(twin).max())


def momentum_drift(dt):
    """Relative drift of linear and angular momentum of the tumbling rod over 0.2 s."""
    sim = RodSimulation(Rod.straight(elements=60, **MATERIAL), dt=dt)
    sim.velocities, sim.spins = tumbling(60)

    def momenta():
        stretch = np.linalg.norm(np.diff(sim.points, axis=0), axis=1) / (LENGTH / 60)
        inertia = sim.rows[Row.INERTIA1 : Row.INERTIA3 + 1, 1:61].T / stretch[:, None]
        spin = np.einsum("kij,ki->j", sim.frames, inertia * sim.spins)
        return sim.node_mass @ sim.velocities, np.sum(sim.node_mass[:, None] * np.cross(sim.points, sim.velocities), axis=0) + spin

    before, drifts = momenta(), []
    for _ in range(10):
        sim.advance(0.02)
        drifts.append([np.linalg.norm(now - then) / np.linalg.norm(then) for now, then in zip(momenta(), before, strict=True)])
    return np.max(drifts, axis=0)


def test_free_rod_keeps_its_momenta():
    # Linear momentum to rounding. Angular momentum, of a rod that tumbles and twists violently, to the first order of the torques that
    # depend on velocity, which are taken at the old velocity as in PyElastica; of a vibrating rod to 1e-10, see test_rod_validation.
    coarse, fine = momentum_drift(2e-5), momentum_drift(1e-5)
    assert max(coarse[0], fine[0]) < 1e-13
    assert coarse[1] < 1e-7
    assert np.log2(coarse[1] / fine[1]) > 0.95


# Muscle forces against virtual work: fibre lengths are written here once more, and differentiated numerically.

CONSTANTS = {
    "longitudinal": law_constants(LONGITUDINAL),
    "oblique": law_constants(LONGITUDINAL, 2.7),
    "transverse": law_constants(TRANSVERSE),
}
PASSIVE_FACTOR = {"longitudinal": 1.0, "oblique": 2.7, "transverse": 1.0}
NU, WINDING = 0.19, 2 * np.pi / 0.0222


def fibre_stretch(kind, strains, offset, helix, unrest, choice):
    """Length over rest length of a fibre in a section with strains (e, k1, k2, k3)."""
    e, k1, k2, k3 = strains
    lam = e**-NU
    if kind == "longitudinal":
        across, along = offset * lam * np.sin(choice), offset * lam * np.cos(choice)
        return np.hypot(e + k1 * along - k2 * across, offset * lam * k3)
    if kind == "oblique":
        return np.hypot(e, helix * lam * (choice + k3)) * unrest
    return lam


def gradient(function, point):
    """Derivative by central differences of fourth order."""
    steps = 2e-4 * np.maximum(np.abs(point), 0.5)
    result = np.empty(len(point))
    for i, step in enumerate(steps):
        shift = np.zeros(len(point))
        shift[i] = step
        near, far = function(point + shift) - function(point - shift), function(point + 2 * shift) - function(point - 2 * shift)
        result[i] = (8 * near - far) / (12 * step)
    return result


def random_sections(elements):
    """A buffer of random strains and rates, with the strains (4, n), the rates (4, n) and what else a fibre needs."""
    random = np.random.default_rng(5)
    buffer, rows = new_buffer(elements)
    inside = slice(1, elements + 1)
    strains = np.stack([random.uniform(0.85, 1.2, elements), *(random.uniform(-20, 20, elements) for _ in range(3))])
    rates = np.stack([random.uniform(-2, 2, elements), *(random.uniform(-50, 50, elements) for _ in range(3))])
    offset, helix = random.uniform(2e-3, 7e-3, elements), random.uniform(3e-3, 12e-3, elements)
    rest, area, level = np.hypot(1.0, helix * WINDING), random.uniform(1e-6, 3e-5, elements), random.uniform(0, 1, elements)
    for row, values in zip((Row.STRETCH, Row.MEAN1, Row.MEAN2, Row.MEAN3), strains, strict=True):
        rows[row, inside] = values
    for row, values in zip((Row.RATE, Row.MEANRATE1, Row.MEANRATE2, Row.MEANRATE3), rates, strict=True):
        rows[row, inside] = values
    rows[Row.RADIUS, inside], rows[Row.SHRINK, inside] = strains[0] ** -NU, -NU / strains[0]
    rows[Row.OFFSET, inside], rows[Row.HELIX, inside], rows[Row.OBLIQUE_REST, inside], rows[Row.LEVEL, inside] = offset, helix, rest, level
    rows[[Row.CORD_AREA, Row.LONGITUDINAL_AREA, Row.OBLIQUE_AREA, Row.RING_AREA], inside] = area
    return buffer, rows, strains, rates, (offset, helix, rest, area, level)


def fibre_work(kind, choice, k, strains, rates, given, *, passive, active):
    """Work (4,) of one fibre on the strains of section k, per rest length of the arm, and its scale."""
    offset, helix, rest, area, level = (values[k] for values in given)
    law = TRANSVERSE if kind == "transverse" else LONGITUDINAL

    def stretch(point):
        return point[0] if kind == "cord" else fibre_stretch(kind, point, offset, helix, 1 / rest, choice)

    slope, s = gradient(stretch, strains[:, k]), stretch(strains[:, k])
    stress = passive * law.passive_stress(s) * PASSIVE_FACTOR.get(kind, 1.0)
    if active:
        stress += level * law.maximum_stress * law.active_factor(s) * law.velocity_factor(-(slope @ rates[:, k]) / law.maximum_rate)
    # A tension A sigma / s on a fibre that is `rest` times as long as its piece of the arm.
    work = area * stress / s * slope * (rest if kind == "oblique" else 1.0)
    return work, area * law.maximum_stress * np.array([1.0, 0.01, 0.01, 0.01])


WORK = [Row.TENSION, Row.MOMENT1, Row.MOMENT2, Row.MOMENT3]


@pytest.mark.parametrize(
    "kind, choice", [("longitudinal", 0.7), ("longitudinal", 3.9), ("oblique", WINDING), ("oblique", -WINDING), ("transverse", 0.0)]
)
def test_active_fibres_do_virtual_work(kind, choice):
    elements = 40
    buffer, rows, strains, rates, given = random_sections(elements)
    longitudinal, oblique, transverse = fibre_kernels(stride_for(elements))
    count = np.uint64(elements)
    if kind == "longitudinal":
        longitudinal(buffer, count, np.sin(choice), np.cos(choice), CONSTANTS[kind])
    elif kind == "oblique":
        oblique(buffer, count, choice, CONSTANTS[kind])
    else:
        transverse(buffer, count, CONSTANTS[kind])
    found = rows[WORK, 1 : elements + 1].T
    for k in range(elements):
        work, scale = fibre_work(kind, choice, k, strains, rates, given, passive=0.0, active=True)
        assert np.all(np.abs(found[k] - work) < 1e-8 * scale), (found[k], work)


LAYOUTS = {"octopus": OCTOPUS_MUSCLES, "seven": MuscleLayout.evenly(7), "no oblique": MuscleLayout.evenly(6, oblique=False)}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_passive_fibres_do_virtual_work(layout):
    elements, elastic = 40, 2e-4
    buffer, rows, strains, rates, given = random_sections(elements)
    _, straight, wound, *_ = section_kernels(stride_for(elements), layout)
    straight(buffer, np.uint64(elements), CONSTANTS["longitudinal"], elastic)
    alone = rows[WORK, 1 : elements + 1].T.copy()
    wound(buffer, np.uint64(elements), WINDING, CONSTANTS["oblique"], CONSTANTS["transverse"], elastic)
    both = rows[WORK, 1 : elements + 1].T.copy()
    both[:, 0] -= DISSIPATION * rows[Row.STIFF, 1 : elements + 1] * rates[0]  # the brake; its bound STIFF is checked below
    fibres = {
        "straight": [("cord", 0.0), *(("longitudinal", group.azimuth) for group in layout.longitudinal)],
        "wound": [*(("oblique", group.hand * WINDING) for group in layout.oblique), ("transverse", 0.0)],
    }
    for found, kinds in ((alone, fibres["straight"]), (both - alone, fibres["wound"])):
        for k in range(elements):
            parts = [fibre_work(*fibre, k, strains, rates, given, passive=1.0, active=False) for fibre in kinds]
            work, scale = sum(part[0] for part in parts), sum(part[1] for part in parts)
            assert np.all(np.abs(found[k] - work) < 1e-8 * scale), (found[k], work)
    # The implicit step's bounds: squares of dl/d(e), and of dl/d(k) summed over the three curvatures, times the elastic tangent.
    for k in range(elements):
        bounds = np.zeros(2)
        for kind, choice in (*fibres["straight"], *fibres["wound"]):
            offset, helix, rest, area, _ = (values[k] for values in given)

            def stretch(point, kind=kind, choice=choice, offset=offset, helix=helix, rest=rest):
                return point[0] if kind == "cord" else fibre_stretch(kind, point, offset, helix, 1 / rest, choice)

            slope, s = gradient(stretch, strains[:, k]) * (rest if kind == "oblique" else 1.0), stretch(strains[:, k])
            tangent = CONSTANTS.get(kind, CONSTANTS["longitudinal"]).tangent * elastic * area / s
            tangent /= rest if kind == "oblique" else 1.0
            bounds += tangent * np.array([slope[0] ** 2, slope[1:] @ slope[1:]])
        assert rows[[Row.STIFF, Row.STIFF_TURN], 1 + k] == pytest.approx(bounds, rel=1e-8)


def test_section_means_and_their_rates():
    elements, random, h = 30, np.random.default_rng(11), 1e-6
    sim, (x, v, q, w) = random_rod(elements, random)
    stride, count = stride_for(elements), np.uint64(elements)
    _, strain, curvature, curvature_rate, *_ = rod_kernels(stride)
    measure, *_ = section_kernels(stride, OCTOPUS_MUSCLES)
    strain(sim.buffer, count)
    curvature(sim.buffer, count)
    curvature_rate(sim.buffer, count)
    rows = sim.rows
    length = rows[Row.LENGTH, 1 : elements + 1]
    joint = (length[1:] + length[:-1]) / 2

    def kappa(sign):
        turned = rotation_matrix(sign * h * w) @ q
        return rotation_vector(turned[1:] @ np.swapaxes(turned[:-1], 1, 2)) / joint[:, None]

    def stretch(sign):
        return np.linalg.norm(np.diff(x + sign * h * v, axis=0), axis=1) / length

    found = rows[Row.K1 : Row.K3 + 1, 2 : elements + 1].T
    assert np.allclose(found, kappa(0), rtol=1e-10, atol=1e-9)
    assert np.allclose(rows[Row.RATE, 1 : elements + 1], (stretch(1) - stretch(-1)) / (2 * h), rtol=1e-6, atol=1e-6)
    # The mean spin stands for the exact inverse tangent of the logarithm: second order in the joint's angle.
    measured, exact = rows[Row.KRATE1 : Row.KRATE3 + 1, 2 : elements + 1].T, (kappa(1) - kappa(-1)) / (2 * h)
    angle = np.linalg.norm(found * joint[:, None], axis=1)
    spin = np.linalg.norm(w[1:] - w[:-1], axis=1) / joint
    assert np.all(np.linalg.norm(measured - exact, axis=1) < angle**2 / 8 * spin + 1e-4 * spin)
    measure(sim.buffer, count, NU)
    assert np.allclose(rows[Row.RADIUS, 1 : elements + 1], rows[Row.STRETCH, 1 : elements + 1] ** -NU, rtol=2e-8)


PACKED = re.compile(r"\bv(?:f?n?m(?:add|sub)\w*|mul|add|sub|div|sqrt)pd\b.*%[yz]mm")
SINGLE = re.compile(r"\bv(?:f?n?m(?:add|sub)\w*|mul|add|sub|div|sqrt)sd\b")


def assembly(kernel, *arguments):
    import numba

    # Compiled anew: a kernel that comes from the cache on disk has no listing.
    fresh = numba.njit(error_model="numpy")(kernel.py_func)
    fresh(*arguments)
    return next(iter(fresh.inspect_asm().values())).splitlines()


@pytest.mark.skipif(platform.machine().lower() not in ("x86_64", "amd64"), reason="looks for x86 instructions")
@pytest.mark.parametrize(
    "name",
    [
        "drift",
        "strain",
        "curvature",
        "curvature_rate",
        "moment",
        "transport",
        "kick",
        "longitudinal",
        "oblique",
        "transverse",
        "measure",
        "straight",
        "wound",
        "apply",
    ],
)
def test_loops_over_elements_are_vector_instructions(name):
    import numba

    if not numba.core.codegen.get_host_cpu_features() or "+avx2" not in numba.core.codegen.get_host_cpu_features():
        pytest.skip("the processor has no AVX2")
    stride, elements = STRIDES[0], np.uint64(100)
    buffer, rows = new_buffer(100)
    rows[:] = 1.0
    names = ("drift", "strain", "curvature", "curvature_rate", "moment", "transport", "kick", "water")
    kernels = dict(zip(names, rod_kernels(stride), strict=True))
    kernels |= dict(zip(("longitudinal", "oblique", "transverse"), fibre_kernels(stride), strict=True))
    kernels |= dict(zip(("measure", "straight", "wound", "apply"), section_kernels(stride, OCTOPUS_MUSCLES)[:4], strict=True))
    law = CONSTANTS["longitudinal"]
    more = {
        "drift": (1e-4,),
        "longitudinal": (0.6, 0.8, law),
        "oblique": (WINDING, law),
        "transverse": (law,),
        "measure": (NU,),
        "straight": (law, 1e-4),
        "wound": (WINDING, law, CONSTANTS["transverse"], 1e-4),
    }
    lines = assembly(kernels[name], buffer, elements, *more.get(name, ()))
    packed, single = sum(bool(PACKED.search(line)) for line in lines), sum(bool(SINGLE.search(line)) for line in lines)
    # The remainder loop is scalar, once; a loop that is not vectorised has no packed arithmetic at all.
    assert packed >= 0.8 * single > 0, (packed, single)
