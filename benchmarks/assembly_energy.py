"""Energy ledger of the full arm: what every force does, step by step, against kinetic and potential energy.

Run with ``python benchmarks/assembly_energy.py`` (R-OM at 0.3 and all longitudinal muscles at 0.3, 0.3 s each; about four minutes), or with
``twist``, ``shorten``, ``elongate`` or ``rest`` for one, and a time step. Steps the compiled parts of a step one by one; the work of a
force is force . velocity at the middle of the kick. Work of all forces must equal the change of kinetic energy (closure); forces that have
a potential must do the work that the potential loses, and what they do beyond that is made or lost by a law that has none.
"""

import sys
from dataclasses import dataclass, field

import numpy as np

from octoctrl.sim.activation import Activation
from octoctrl.sim.assembly.account import CONNECTIONS, energies
from octoctrl.sim.assembly.constants import fibre_laws, oblique_mass, ring_smoothing, straight_mass
from octoctrl.sim.assembly.core import TONE_RAMP
from octoctrl.sim.assembly.family_kernels import cord_brake, ring_spin_brake
from octoctrl.sim.assembly.hydrostat_terms import CORD_SLIP_RATE, RING_SPIN_RATE, hydrostat_terms
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import SpokeRow as S
from octoctrl.sim.assembly.parts import whole
from octoctrl.sim.assembly.stepping import mover
from octoctrl.sim.assembly.terms import Step, by_name
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS
from octoctrl.sim.body.muscles import MuscleLaw
from octoctrl.sim.plants import make_plant
from octoctrl.sim.sources import sampled
from octoctrl.sim.templates import Plateau

PROGRAMMES = {
    "twist": (Plateau(groups=("R-OM",), level=0.3, window=(0.0, 0.2 * 357 / 360)),),
    "shorten": (Plateau(groups=LONGITUDINAL_GROUPS, level=0.3),),
    "elongate": (Plateau(groups=("TM",), level=0.3),),
    "rest": (),
}
POTENTIAL = ("passive stretch", "shear", "bending and twist", "selective mass", *(name.replace("_", " ") for name in CONNECTIONS))


def vectors(view, row, **nodes):
    """Three rows of a family as vectors (rods, n, 3)."""
    return np.stack([view(R(row + i), **nodes) for i in range(3)], axis=-1)


def dot(a, b):
    """Sum of products over everything; not `numpy.vdot`, whose threads wait for each other on a busy machine."""
    return float(np.sum(a * b))


def hill(law, rate):
    """Hill's secant (f_v - 1) / rate at stretch rates, s, which is finite at rest."""
    safe = np.where(np.abs(rate) < 1e-9, 1e-9, rate)
    return (law.velocity_factor(-safe / law.maximum_rate) - 1) / safe


@dataclass(slots=True)
class Family:
    """A rod family during a step: views, constants and what the kernels left."""

    view: object
    rods: object
    laws: tuple
    mass: np.ndarray
    closed: bool
    nodes: dict = field(default_factory=dict)

    def of_law(self, function, *values):
        """A function of a law and rows (rods, n), each rod by its own law: of several the first is the first rod's."""
        if len(self.laws) == 1:
            return function(self.laws[0], *values)
        rods = [function(self.laws[min(rod, 1)], *(row[rod] for row in values)) for rod in range(len(values[0]))]
        return np.stack(rods)

    def later(self, values):
        """Differences (rods, n, 3) along the elements of values at the nodes."""
        return np.roll(values, -1, axis=1) - values if self.closed else np.diff(values, axis=1)

    def laboratory(self, vector):
        """Material vectors of the elements in the laboratory frame."""
        frames = np.stack([self.view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*self.view(R.Q11).shape, 3, 3)
        return np.einsum("rnij,rni->rnj", frames, vector)

    def inertia(self):
        """Rotary inertia (rods, n, 3)."""
        return np.stack([self.view(R.BEND_INERTIA), self.view(R.BEND_INERTIA), self.view(R.TWIST_INERTIA)], axis=-1)


class Ledger:
    """Steps a plant and keeps the work of every class of force, J."""

    def __init__(self, plant):
        self.plant, rods, arm, geometry = plant, plant.core.rods, plant.arm, plant.core.geometry
        step = Step(plant.h, plant.core._laws, plant.core._drag, rods.ring_index, rods.helix_index)
        dry = step._replace(drag=(0.0, 0.0, 0.0, 0.0))
        terms, everything = by_name(hydrostat_terms(plant.core.grid, arm.anatomy.traits)), whole(rods.grid)
        move, steady, hold = mover(plant.core.grid), ring_spin_brake(rods.grid), cord_brake(rods.grid)

        def term(name, share=0.5, wet=True):
            for stage in terms:
                if stage.split(", ")[0] == name:
                    terms[stage](rods.flat, share, step if wet else dry, everything)

        self.term, self.move = term, lambda flat, h: move(flat, everything, h)
        self.steady, self.hold = (lambda flat, part, brake=brake: brake(flat, everything, part) for brake in (steady, hold))
        muscle, oblique, ring, cord = fibre_laws(arm)
        self.families = (
            Family(rods.straight, geometry.straight, (cord, muscle), straight_mass(arm, geometry, plant.h), False, {"nodes": True}),
            Family(rods.oblique, geometry.oblique, (oblique,), oblique_mass(arm, geometry, plant.h), False, {"nodes": True}),
            Family(rods.ring, geometry.rings, (ring,), geometry.rings.node_mass, True),
        )
        self.smoothing = ring_smoothing(arm, geometry, plant.h)[:, None, None]
        self.work, self.hill_work, self.swelling_last, self.old_spin = {}, 0.0, None, {}

    def add(self, name, value):
        """Book `value` (J) of work under `name`."""
        self.work[name] = self.work.get(name, 0.0) + value

    # One step, and its works.

    def step(self, share):
        """Advance by one time step, `share` of the way between the samples' levels."""
        flat, h = self.plant.core.rods.flat, self.plant.h
        self.move(flat, 0.5 * h)
        self.term("strains", share)
        self.book_swelling()
        self.old_spin = {id(f): vectors(f.view, R.W1) for f in self.families}
        internal = [self.internal(family, share) for family in self.families]
        external = self.external()
        v0, w0 = self.motion()
        for name in ("ring spin", "kick"):
            self.term(name)
        spun = self.motion()[1]
        self.steady(flat, 1 - np.exp(-RING_SPIN_RATE * h))
        slow, w1 = self.motion()
        self.hold(flat, 1 - np.exp(-CORD_SLIP_RATE * h))
        braked = self.motion()[0]
        self.term("axial")
        tensions, relaxed = [family.view(R.IMPULSE).copy() for family in self.families], self.motion()[0]
        self.term("smooth")
        smoothed = self.motion()[0]
        self.term("hold")
        tensions[2] += self.families[2].view(R.IMPULSE)
        held = self.motion()[0]
        self.term("project")
        v1 = self.motion()[0]
        mid_v, mid_w = [(a + b) / 2 for a, b in zip(v0, v1, strict=True)], [(a + b) / 2 for a, b in zip(w0, w1, strict=True)]
        force, torque = [np.zeros_like(v) for v in v0], [np.zeros_like(w) for w in w0]
        for number, family in enumerate(self.families):
            for label, first, then in (("cord brake", slow, braked), ("selective mass", relaxed, smoothed), ("pressure", held, v1)):
                self.add(label, dot(family.mass[..., None] * (then[number] - first[number]), mid_v[number]))
            # Elements drift with the spin that the brake has left, and moments work over that way.
            self.add(
                "ring spin brake", dot(family.inertia() / family.view(R.STRETCH)[..., None] * (w1[number] - spun[number]), mid_w[number])
            )
            internal[number]["tension"] = tensions[number]
            self.book_internal(family, internal[number], mid_v[number], mid_w[number], force[number], torque[number])
        for name, f, t in external:
            self.add(name, h * sum(dot(a, b) for a, b in zip(f, mid_v, strict=True) if a is not None))
            self.add(name, h * sum(dot(a, b) for a, b in zip(t, mid_w, strict=True) if a is not None))
            for number in range(3):
                if f[number] is not None:
                    force[number] += f[number]
                if t[number] is not None:
                    torque[number] += t[number]
        for number, family in enumerate(self.families):
            self.book_damping(family, v0[number], mid_v[number], w0[number], mid_w[number], force[number], torque[number])
        self.move(flat, 0.5 * h)

    def motion(self):
        """Velocities of nodes and spins of elements of the three families."""
        return [vectors(f.view, R.V1, **f.nodes) for f in self.families], [vectors(f.view, R.W1) for f in self.families]

    def spin_energy(self):
        """Kinetic energy of the spins, J; rotary inertia falls with the stretch."""
        return sum(0.5 * np.sum(f.inertia() * vectors(f.view, R.W1) ** 2 / f.view(R.STRETCH)[..., None]) for f in self.families)

    def book_swelling(self):
        """Book the spin energy that changes because the sections swell while they drift."""
        now = self.spin_energy()
        if self.swelling_last is not None:
            self.add("swelling sections", now - self.swelling_last)
        self.swelling_last = None

    def internal(self, family, share):
        """Copies of what the strains left."""
        view = family.view
        level = view(R.LEVEL_BEFORE) + share * (view(R.LEVEL_AFTER) - view(R.LEVEL_BEFORE))
        return {
            "tangent": vectors(view, R.T1),
            "stretch": view(R.STRETCH).copy(),
            "rate": view(R.RATE).copy(),
            "force": vectors(view, R.N1),
            "plus": vectors(view, R.MPLUS1),
            "minus": vectors(view, R.MMINUS1),
            "level": level,
        }

    def book_internal(self, family, was, mid_v, mid_w, force, torque):
        """Book what muscles, passive tissue, shear and bending do; collect the loads."""
        view, h = family.view, self.plant.h
        e, tangent, area, rest = was["stretch"], was["tangent"], family.rods.area, family.rods.length
        apart = family.later(mid_v)
        elongation = np.sum(tangent * apart, axis=-1)
        isometric = was["level"] * family.of_law(lambda law, e: law.maximum_stress * law.active_factor(e), e)
        viscosity = isometric * family.of_law(hill, was["rate"])
        passive, active = area * family.of_law(MuscleLaw.passive_stress, e) / e, area * (isometric + viscosity * was["rate"]) / e
        self.add("passive stretch", -h * dot(passive, elongation))
        correction, passively = was["tension"], area * self.plant.arm.anatomy.viscosity / e
        of_muscle = area * viscosity / (e * rest) / view(R.VISCOSITY)
        of_viscosity = passively / rest / view(R.VISCOSITY)
        self.add("passive viscosity", -h * dot(passively * was["rate"] + of_viscosity * correction, elongation))
        self.add("muscles", -h * dot(active + of_muscle * correction, elongation))
        self.add("implicit passive slope", -h * dot((1 - of_muscle - of_viscosity) * correction, elongation))
        slowed = family.of_law(lambda law, rate: law.velocity_factor(-rate / law.maximum_rate), elongation / rest)
        at_middle = area * isometric * slowed / e
        self.hill_work -= h * dot(at_middle, elongation)
        sheared = was["force"] - (passive + active + passively * was["rate"])[..., None] * tangent
        self.add("shear", -h * dot(sheared, apart))
        # TORQUE holds shear, and the inertia terms at the old spin.
        spin = self.old_spin[id(family)]
        j = family.inertia()
        inertial = np.cross(j * spin, spin) / e[..., None] + j * spin * (was["rate"] / e)[..., None] / e[..., None]
        turned = vectors(view, R.TORQUE1) - inertial
        self.add("shear", h * dot(turned, mid_w))
        self.add("swelling sections", h * dot(inertial, mid_w))
        plus, minus = was["plus"], was["minus"]
        bending = -minus
        if family.closed:
            bending += np.roll(plus, -1, axis=1)
        else:
            bending[:, :-1] += plus[:, 1:]
        self.add("bending and twist", h * dot(bending, mid_w))
        torque += turned + inertial + bending
        total = was["force"] + correction[..., None] * tangent
        if family.closed:
            force += total - np.roll(total, 1, axis=1)
        else:
            force[:, :-1] += total
            force[:, 1:] -= total

    def book_damping(self, family, v0, mid_v, w0, mid_w, force, torque):
        """Book the linear drag, which the kernels integrate exactly."""
        view, h = family.view, self.plant.h
        decay, mobility = view(R.NODE_DECAY, **family.nodes), view(R.NODE_MOBILITY, **family.nodes)
        mass = family.mass
        lost = (mass * (decay - 1))[..., None] * v0 + (mobility * mass - h)[..., None] * force
        self.add("linear water", dot(lost, mid_v))
        j, e = family.inertia(), view(R.STRETCH)[..., None]
        decay = np.stack([view(R.BEND_DECAY), view(R.BEND_DECAY), view(R.TWIST_DECAY)], axis=-1)
        mobility = np.stack([view(R.BEND_MOBILITY), view(R.BEND_MOBILITY), view(R.TWIST_MOBILITY)], axis=-1)
        self.add("linear water", dot(j / e * (decay - 1) * w0 + (mobility * j - h) * torque, mid_w))

    def external(self):
        """Forces and couples (three families each) by class of connection, from the terms one after the other, all left in the buffer."""
        found = []
        for row in (R.C1, R.C2, R.C3):
            self.plant.core.rods.open_rods[row] = self.plant.core.rods.rings[row] = 0.0
        self.term("crossings")
        for row in (R.F1, R.F2, R.F3):
            self.plant.core.rods.straight(row, nodes=True)[:] = 0.0
        done = self.loads()
        found.append(self.named("crossings", [np.zeros_like(done[0]), *done[1:3], np.zeros_like(done[3])]))
        clean = self.plant.core.rods.flat.copy()
        self.plant.core.rods.spokes[S.F1 :] = 0.0
        names = ("sides", "ring connections", "contacts")
        for wet in (False, True):
            for count in range(1, len(names) + 1) if not wet else (len(names),):
                # Sums are taken of what the rods had before.
                self.plant.core.rods.flat[:] = clean
                self.plant.core.rods.spokes[S.F1 :] = 0.0
                for name in names[:count]:
                    self.term(name)
                self.term("sums", wet=wet)
                now = self.loads()
                label = "quadratic water" if wet else names[count - 1]
                found.append(self.named(label, [a - b for a, b in zip(now, done, strict=True)]))
                done = now
        self.term("pressure")
        found.append(self.named("pressure", [a - b for a, b in zip(self.loads(), done, strict=True)]))
        return found

    def named(self, name, loads):
        """Loads as forces on the nodes of three families and couples in the frames of the straight rods' elements."""
        straight, oblique, ring, couple = loads
        view = self.families[0].view
        frames = np.stack([view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*view(R.Q11).shape, 3, 3)
        return name, (straight, oblique, ring), (np.einsum("rnij,rnj->rni", frames, couple), None, None)

    def loads(self):
        """Forces on nodes, with those of the axes' tension, and couples on the straight rods' elements."""
        rods = self.plant.core.rods
        axis, straight = vectors(rods.straight, R.N1), vectors(rods.straight, R.F1, nodes=True)
        straight[:, :-1] += axis
        straight[:, 1:] -= axis
        return straight, vectors(rods.oblique, R.F1, nodes=True), vectors(rods.ring, R.F1), vectors(rods.straight, R.C1)

    # Energies, after the strains.

    def kinetic(self):
        """Kinetic energy of translation, J."""
        return sum(0.5 * np.sum(f.mass[..., None] * vectors(f.view, R.V1, **f.nodes) ** 2) for f in self.families)

    def potentials(self):
        """Energies of what has a potential, J."""
        stored = energies(self.plant.core, self.plant.h)
        velocity = vectors(self.families[2].view, R.V1)
        apart = np.roll(velocity, -1, axis=1) - velocity
        found = {name: stored[name.replace(" and ", "_").replace(" ", "_")] for name in POTENTIAL if name != "selective mass"}
        return found | {"selective mass": 0.5 * dot(self.smoothing * self.families[2].mass[..., None], apart**2)}


def run(name, duration=0.3, dt="auto"):
    """Step a plant through a programme; returns the ledger, kinetic energies and potentials at begin and end."""
    plant, activation = make_plant("assembly", dt=dt), Activation(templates=PROGRAMMES[name])
    ledger, rods = Ledger(plant), plant.core.rods
    transverse = MUSCLE_GROUPS.index("TM")
    for sample in range(round(duration / plant.sample_interval)):
        found = sampled(activation, plant.clock.instants(sample, 1), plant.core.partitions, plant.arm.layout)
        levels, oblique = found["arm"], found["oblique"]
        for row, instant in ((R.LEVEL_BEFORE, 0), (R.LEVEL_AFTER, 1)):
            tone = plant.core.resting_tone * min(1.0, (sample + instant) * plant.sample_interval / TONE_RAMP)
            rods.straight(row)[:] = tone
            rods.straight(row)[1:] = np.maximum(levels[instant, :8], tone)
            rods.oblique(row)[:4], rods.oblique(row)[4:] = oblique[instant, 9], oblique[instant, 8]
            rods.ring(row)[:] = np.maximum(levels[instant, transverse], tone)[:, None]
        for step in range(plant.steps):
            if sample == step == 0:
                ledger.term("strains", 0.0)
                first = ledger.kinetic() + ledger.spin_energy(), ledger.potentials()
            ledger.step((step + 0.5) / plant.steps)
            ledger.swelling_last = ledger.spin_energy()
    ledger.term("strains", 1.0)
    ledger.book_swelling()
    return ledger, first, (ledger.kinetic() + ledger.spin_energy(), ledger.potentials())


def report(name, duration=0.3, dt="auto"):
    """Print the ledger of a programme."""
    ledger, (kinetic0, stored0), (kinetic1, stored1) = run(name, duration, dt)
    work, plant = ledger.work, ledger.plant
    length = np.linalg.norm(np.diff(plant.observe().points, axis=0), axis=1).sum() * 1e3
    print(
        f"\n{name}, {duration} s at step {plant.h:.2g} s: length {length:.3f} mm, inside the rings {plant.core.volume() * 1e6:.3f} ml; uJ"
    )
    print(f"  {'':24s} {'work':>10s} {'stored':>10s} {'neither':>10s}")
    for label, value in sorted(work.items(), key=lambda entry: -abs(entry[1])):
        line = f"  {label:24s} {value * 1e6:10.2f}"
        if label in POTENTIAL:
            stored = stored1[label] - stored0[label]
            line += f" {stored * 1e6:10.2f} {(value + stored) * 1e6:10.2f}"
        print(line)
    total, kinetic = sum(work.values()), kinetic1 - kinetic0
    print(f"  {'all works':24s} {total * 1e6:10.2f}   change of kinetic energy {kinetic * 1e6:.2f}")
    print(f"  closure: {abs(total - kinetic) / abs(work['muscles'] or 1.0) * 100:.2e} % of the muscles' work;", end=" ")
    print(f"muscles by Hill's law at the middle of the step: {ledger.hill_work * 1e6:.2f} uJ", flush=True)


def main():
    names = [argument for argument in sys.argv[1:] if argument in PROGRAMMES] or ["twist", "shorten"]
    steps = [float(argument) for argument in sys.argv[1:] if argument not in PROGRAMMES] or ["auto"]
    for name in names:
        for dt in steps:
            report(name, 0.05 if name == "rest" else 0.3, dt)


if __name__ == "__main__":
    main()
