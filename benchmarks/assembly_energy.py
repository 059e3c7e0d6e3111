"""Energy ledger of the full arm: what every force does, step by step, against kinetic and potential energy.

Run with ``python benchmarks/assembly_energy.py`` (R-OM at 0.3 and all longitudinal muscles at 0.3, 0.3 s each; about four minutes), or with
``twist``, ``shorten``, ``elongate`` or ``rest`` for one, and a time step. Steps the compiled parts of a step one by one; the work of a
force is force . velocity at the middle of the kick. Work of all forces must equal the change of kinetic energy (closure); forces that have
a potential must do the work that the potential loses, and what they do beyond that is made or lost by a law that has none.
"""

import sys
from dataclasses import dataclass, field

import numpy as np

from octoctrl.sim.activation import Activation, Plateau
from octoctrl.sim.assembly.constants import ring_connections, straight_connections
from octoctrl.sim.assembly.core import TONE_RAMP, compiled
from octoctrl.sim.assembly.family_kernels import ring_spin_brake
from octoctrl.sim.assembly.layout import AssemblyRow as R
from octoctrl.sim.assembly.layout import CrossingRow as C
from octoctrl.sim.assembly.layout import SpokeRow as S
from octoctrl.sim.assembly.stepping import CORD_SLIP_RATE, RING_SPIN_RATE
from octoctrl.sim.body.arm import LONGITUDINAL_GROUPS, MUSCLE_GROUPS
from octoctrl.sim.plants import make_plant
from octoctrl.sim.sources import sampled

PROGRAMMES = {
    "twist": (Plateau(groups=("R-OM",), level=0.3, window=(0.0, 0.2 * 357 / 360)),),
    "shorten": (Plateau(groups=LONGITUDINAL_GROUPS, level=0.3),),
    "elongate": (Plateau(groups=("TM",), level=0.3),),
    "rest": (),
}
POTENTIAL = ("passive stretch", "shear", "bending and twist", "cord to muscle", "muscle to muscle", "ring to muscle", "ring to oblique")


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
    law: object
    closed: bool
    nodes: dict = field(default_factory=dict)

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
        _, self.parts = compiled(plant.core.grid, geometry.inclination)
        self.brake = ring_spin_brake(rods.grid)
        self.families = (
            Family(rods.straight, geometry.straight, arm.longitudinal, False, {"nodes": True}),
            Family(rods.oblique, geometry.oblique, arm.oblique, False, {"nodes": True}),
            Family(rods.ring, geometry.rings, arm.transverse, True),
        )
        self.work, self.hill_work, self.swelling_last, self.old_spin = {}, 0.0, None, {}
        self.sides, self.ring = straight_connections(arm, geometry), ring_connections(arm, geometry)
        self.tables = {}

    def add(self, name, value):
        """Book `value` (J) of work under `name`."""
        self.work[name] = self.work.get(name, 0.0) + value

    # One step, and its works.

    def step(self, share):
        """Advance by one time step, `share` of the way between the samples' levels."""
        plant, parts, rods, flat, h = self.plant, self.parts, self.plant.core.rods, self.plant.core.rods.flat, self.plant.h
        parts["move"](flat, 0.5 * h)
        parts["measure"](flat, share, h, plant.core._laws)
        self.book_swelling()
        internal = [self.internal(family, share) for family in self.families]
        external = self.external()
        v0, w0 = self.motion()
        parts["push"](flat)
        w1 = self.motion()[1]
        before = self.spin_energy()
        self.brake(flat, 1 - np.exp(-RING_SPIN_RATE * h))
        self.add("ring spin brake", self.spin_energy() - before)
        slow = self.motion()[0]
        parts["cord_brake"](flat, 1 - np.exp(-CORD_SLIP_RATE * h), np.uint64(2), np.uint64(rods.grid.rings + 2))
        braked = [after - before for before, after in zip(slow, self.motion()[0], strict=True)]
        parts["relax"](flat)
        v1 = self.motion()[0]
        mid_v, mid_w = [(a + b) / 2 for a, b in zip(v0, v1, strict=True)], [(a + b) / 2 for a, b in zip(w0, w1, strict=True)]
        force, torque = [np.zeros_like(v) for v in v0], [np.zeros_like(w) for w in w0]
        for number, family in enumerate(self.families):
            self.add("cord brake", dot(family.rods.node_mass[..., None] * braked[number], mid_v[number]))
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
        parts["move"](flat, 0.5 * h)

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
        """Copies of what `measure` left."""
        view = family.view
        level = view(R.LEVEL_BEFORE) + share * (view(R.LEVEL_AFTER) - view(R.LEVEL_BEFORE))
        return {
            "tangent": vectors(view, R.T1),
            "stretch": view(R.STRETCH).copy(),
            "rate": view(R.RATE).copy(),
            "force": vectors(view, R.N1),
            "level": level,
        }

    def book_internal(self, family, was, mid_v, mid_w, force, torque):
        """Book what muscles, passive tissue, shear and bending do; collect the loads."""
        view, law, h = family.view, family.law, self.plant.h
        e, tangent, area, rest = was["stretch"], was["tangent"], family.rods.area, family.rods.length
        apart = family.later(mid_v)
        elongation = np.sum(tangent * apart, axis=-1)
        isometric = was["level"] * law.maximum_stress * law.active_factor(e)
        viscosity = isometric * hill(law, was["rate"])
        passive, active = area * law.passive_stress(e) / e, area * (isometric + viscosity * was["rate"]) / e
        self.add("passive stretch", -h * dot(passive, elongation))
        correction = view(R.IMPULSE)
        of_muscle = area * viscosity / (e * rest) * view(R.YIELD)
        self.add("muscles", -h * dot(active + of_muscle * correction, elongation))
        self.add("implicit passive slope", -h * dot((1 - of_muscle) * correction, elongation))
        at_middle = area * isometric * law.velocity_factor(-elongation / rest / law.maximum_rate) / e
        self.hill_work -= h * dot(at_middle, elongation)
        sheared = was["force"] - (passive + active)[..., None] * tangent
        self.add("shear", -h * dot(sheared, apart))
        # TORQUE holds shear, and the inertia terms at the old spin.
        spin = self.old_spin[id(family)]
        j = family.inertia()
        inertial = np.cross(j * spin, spin) / e[..., None] + j * spin * (was["rate"] / e)[..., None] / e[..., None]
        turned = vectors(view, R.TORQUE1) - inertial
        self.add("shear", h * dot(turned, mid_w))
        self.add("swelling sections", h * dot(inertial, mid_w))
        plus, minus = vectors(view, R.MPLUS1), vectors(view, R.MMINUS1)
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
        mass = family.rods.node_mass
        lost = (mass * (decay - 1))[..., None] * v0 + (mobility * mass - h)[..., None] * force
        self.add("linear water", dot(lost, mid_v))
        j, e = family.inertia(), view(R.STRETCH)[..., None]
        decay = np.stack([view(R.BEND_DECAY), view(R.BEND_DECAY), view(R.TWIST_DECAY)], axis=-1)
        mobility = np.stack([view(R.BEND_MOBILITY), view(R.BEND_MOBILITY), view(R.TWIST_MOBILITY)], axis=-1)
        self.add("linear water", dot(j / e * (decay - 1) * w0 + (mobility * j - h) * torque, mid_w))

    def external(self):
        """Forces and torques (three families each) by class of connection, from the parts of the spokes and the crossings."""
        plant, parts, rods, flat = self.plant, self.parts, self.plant.core.rods, self.plant.core.rods.flat
        self.old_spin = {id(f): vectors(f.view, R.W1) for f in self.families}
        for row in S:
            if S.F1 <= row < S.O1:
                rods.spokes[row] = 0.0
        parts["crossings"](flat, rods.ring_index, rods.helix_index)
        on_rings = vectors(rods.ring, R.F1)
        found = [("ring to oblique", (None, vectors(rods.oblique, R.F1, nodes=True), on_rings), (None, None, None))]
        parts["gather"](flat)
        done = self.spoke_loads()
        for name, part in (("cord to muscle", "cord"), ("muscle to muscle", "neighbours"), ("ring to muscle", "ring_muscle")):
            parts[part](flat)
            now = self.spoke_loads()
            f, t, ring_f, ring_t = (a - b for a, b in zip(now, done, strict=True))
            if part == "ring_muscle":
                found.append((name, (self.to_nodes(f), None, ring_f), (None, None, None)))
                found.append(("orientation lock", (None, None, None), (self.material(0, t), None, self.material(2, ring_t))))
            else:
                found.append((name, (self.to_nodes(f), None, ring_f), (self.material(0, t), None, None)))
            done = now
        parts["ring_ring"](flat)
        ring_f = self.spoke_loads()[2] - done[2]
        found.append(("ring to ring", (None, None, ring_f), (None, None, None)))
        ring_before = vectors(rods.ring, R.F1)
        parts["beside"](flat)
        f = self.spoke_loads()[0] - done[0]
        found.append(("ring to muscle", (self.to_nodes(f), None, vectors(rods.ring, R.F1) - ring_before), (None, None, None)))
        of_connections = self.to_nodes(self.spoke_loads()[0])
        tension = vectors(rods.straight, R.N1)
        parts["scatter"](flat, *plant.core._drag[:2])
        load = vectors(rods.straight, R.N1) - tension
        pressed = np.pad(load, ((0, 0), (0, 1), (0, 0))) - np.pad(load, ((0, 0), (1, 0), (0, 0)))
        found.append(("pressure", (pressed, None, None), (None, None, None)))
        water = vectors(rods.straight, R.F1, nodes=True) - of_connections
        found.append(("quadratic water", (water, None, None), (None, None, None)))
        return found

    def spoke_loads(self):
        """Forces and couples on the straight rods' elements (9, N, 3), and on the rings' nodes and elements (N, nodes, 3), so far."""
        rods = self.plant.core.rods
        lanes, n = rods.grid.lanes, rods.grid.rings

        def of(name, suffix="", later=0):
            rows = [rods.spokes[S[f"{name}{i}{suffix}"], (2 + later) * lanes : (10 + later) * lanes] for i in (1, 2, 3)]
            return np.stack([row.reshape(8, lanes)[:, 1 : n + 1] for row in rows], axis=-1)

        loads = [
            np.concatenate([of(name, "_C").sum(axis=0)[None], of(name) + np.roll(of(name, "_N", 1), 1, axis=0)]) for name in ("F", "T")
        ]
        force, couple = (np.zeros((n, rods.ring(R.X1).shape[1], 3)) for _ in range(2))
        onward = np.swapaxes(of("F", "_X"), 0, 1)[:-1]
        at_spokes = slice(None, None, force.shape[1] // 8)
        force[:, at_spokes] = np.swapaxes(of("F", "_R"), 0, 1)
        force[1:, at_spokes] += onward
        force[:-1, at_spokes] -= onward
        couple[:, at_spokes] = np.swapaxes(of("T", "_R"), 0, 1)
        return *loads, force, couple

    def to_nodes(self, force):
        """Forces on elements, half on either node."""
        return (np.pad(force, ((0, 0), (0, 1), (0, 0))) + np.pad(force, ((0, 0), (1, 0), (0, 0)))) / 2

    def material(self, number, couple):
        """Couples in the frames of the elements."""
        view = self.families[number].view
        frames = np.stack([view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*view(R.Q11).shape, 3, 3)
        return np.einsum("rnij,rnj->rni", frames, couple)

    # Energies, after `measure`.

    def kinetic(self):
        """Kinetic energy of translation, J."""
        return sum(0.5 * np.sum(f.rods.node_mass[..., None] * vectors(f.view, R.V1, **f.nodes) ** 2) for f in self.families)

    def potentials(self):
        """Energies of what has a potential, J."""
        stretch = shear = bend = 0.0
        for f in self.families:
            view, rest, e = f.view, f.rods.length, f.view(R.STRETCH)
            stretch += np.sum(f.rods.area * rest * self.passive_energy(f.law, e))
            frames = np.stack([view(R.Q11 + i) for i in range(9)], axis=-1).reshape(*e.shape, 3, 3)
            along = np.einsum("rnij,rnj->rni", frames, vectors(view, R.T1)) * e[..., None]
            shear += 0.5 * np.sum(view(R.SHEAR) * rest * (along[..., 0] ** 2 + along[..., 1] ** 2))
            moment = (vectors(view, R.MPLUS1) + vectors(view, R.MMINUS1)) / 2
            length = e * view(R.LENGTH)
            before = np.roll(length, 1, axis=1)
            joint = view(R.JOINT_LENGTH)
            swell = (length + before) / 2 / joint
            stiff = np.stack([view(R.BEND), view(R.BEND), view(R.TWIST)], axis=-1)
            inside = slice(None) if f.closed else slice(1, None)
            bend += 0.5 * np.sum((joint * swell**6)[:, inside, None] * moment[:, inside] ** 2 / stiff[:, inside])
        return dict(zip(POTENTIAL, (stretch, shear, bend, *self.connection_energies()), strict=True))

    def passive_energy(self, law, stretch):
        """Integral of the passive stress over e from rest, Pa: the force is A sigma / e."""
        if id(law) not in self.tables:
            grid = np.linspace(0.2, 3.0, 56001)
            slope = law.passive_stress(grid) / grid
            total = np.concatenate([[0.0], np.cumsum((slope[1:] + slope[:-1]) / 2) * (grid[1] - grid[0])])
            self.tables[id(law)] = grid, total - np.interp(1.0, grid, total)
        return np.interp(stretch, *self.tables[id(law)])

    def connection_energies(self):
        """Of cord to muscle, muscle to muscle, ring to muscle with its nine nodes, ring to oblique with its five pairs."""
        rods, sides = self.plant.core.rods, self.sides
        nodes = vectors(rods.straight, R.X1, nodes=True)
        centre, radius = (nodes[:, 1:] + nodes[:, :-1]) / 2, rods.straight(R.RADIUS)
        frames = np.stack([rods.straight(R.Q11 + i) for i in range(9)], axis=-1).reshape(9, -1, 3, 3)
        root = 1 / np.sqrt(rods.straight(R.STRETCH))
        reach1 = radius[sides.first] + sides.gap / 2 * root[sides.first]
        reach2 = radius[sides.second] + sides.gap / 2 * root[sides.second]
        arm1 = reach1[..., None] * np.einsum("pnji,pnj->pni", frames[sides.first], sides.direction1)
        arm2 = reach2[..., None] * np.einsum("pnji,pnj->pni", frames[sides.second], sides.direction2)
        between = centre[sides.second] - centre[sides.first]
        energy = 0.5 * sides.spring * np.sum((between + arm2 - arm1) ** 2, axis=-1)
        energy += hertz(sides.contact, reach1 + reach2 - np.linalg.norm(between, axis=-1), 0.0)
        ring, thick = vectors(rods.ring, R.X1), rods.ring(R.RADIUS)
        per_ring = ring.shape[1]
        outward = ring - np.roll(ring, per_ring // 2, axis=1)
        outward /= np.linalg.norm(outward, axis=2)[..., None]
        of_muscle = 0.0
        for m in range(8):
            q = per_ring // 8 * m
            gap = centre[m + 1] - ring[:, q] + (thick[:, q] + radius[m + 1])[:, None] * outward[:, q]
            of_muscle += np.sum(0.5 * self.ring.muscle_spring[:, None] * gap**2)
            for away in range(-4, 5):
                node = (q + away) % per_ring
                overlap = thick[:, node] + radius[m + 1] - np.linalg.norm(ring[:, node] - centre[m + 1], axis=1)
                of_muscle += np.sum(hertz(self.ring.muscle_contact, overlap, rods.spoke(S.R_EFFECTIVE)[m]))
        helix, fibre = vectors(rods.oblique, R.X1, nodes=True), rods.oblique(R.RADIUS)
        fibre = np.concatenate([fibre, fibre[:, -1:]], axis=1)
        every, of_oblique = np.arange(rods.grid.rings), 0.0
        for j in range(8):
            side, q, node = (1 if j < 4 else -1), self.plant.core.geometry.oblique_nodes[j], 2 * every
            gap = ring[every, q] + (thick[every, q] + fibre[j, node])[:, None] * outward[every, q] - helix[j, node]
            of_oblique += np.sum(0.5 * self.ring.oblique_spring[:, None] * gap**2)
            for dh, dq in ((0, 0), (side, 1), (side, 2), (-side, -1), (-side, -2)):
                there = (node + dh >= 0) & (node + dh <= fibre.shape[1] - 2)
                h, d = np.where(there, node + dh, 0), (q + dq) % per_ring
                overlap = thick[every, d] + fibre[j, h] - np.linalg.norm(ring[every, d] - helix[j, h], axis=1)
                of_oblique += np.sum(there * hertz(self.ring.oblique_contact, overlap, rods.crossing(C.EFFECTIVE)[j]))
        return energy[:8].sum(), energy[8:].sum(), of_muscle, of_oblique


def hertz(stiffness, overlap, effective):
    """Energy of a softened contact, k p^1.5 / (1 + c p^0.5) integrated over the overlap, by Gauss's rule in the root of p."""
    point, weight = np.polynomial.legendre.leggauss(6)
    root = np.sqrt(np.maximum(overlap, 0.0))[..., None] * (point + 1) / 2
    inside = 2 * root**4 / (1 + np.asarray(effective)[..., None] * root)
    return stiffness * np.sum(inside * weight, axis=-1) * np.sqrt(np.maximum(overlap, 0.0)) / 2


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
                ledger.parts["measure"](rods.flat, 0.0, plant.h, plant.core._laws)
                first = ledger.kinetic() + ledger.spin_energy(), ledger.potentials()
            ledger.step((step + 0.5) / plant.steps)
            ledger.swelling_last = ledger.spin_energy()
    ledger.parts["measure"](rods.flat, 1.0, plant.h, plant.core._laws)
    ledger.book_swelling()
    return ledger, first, (ledger.kinetic() + ledger.spin_energy(), ledger.potentials())


def report(name, duration=0.3, dt="auto"):
    """Print the ledger of a programme."""
    ledger, (kinetic0, stored0), (kinetic1, stored1) = run(name, duration, dt)
    work, plant = ledger.work, ledger.plant
    length = np.linalg.norm(np.diff(plant.observe().points, axis=0), axis=1).sum() * 1e3
    print(
        f"\n{name}, {duration} s at step {plant.h:.2g} s: length {length:.3f} mm, volume inside the rings "
        f"{plant.core.volume() * 1e6:.3f} ml; uJ"
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
