"""What goals read, on the reduced model: CasADi expressions of the strains and the outputs of one instant, and their derivatives."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from octoctrl.sim.body.arm import Arm
from octoctrl.sim.errors import OctoctrlError, brief

from ..contracts import Expression, Floats, Goal, Outputs
from .kinematics import BASE_FRAME, element_stations, hat_means, section_bounds
from .output_kernels import OUTPUTS
from .outputs import exponential


class ModelOutputs:
    """`octoctrl.planners.contracts.Outputs` of the reduced model at one instant.

    Parameters
    ----------
    arm : Arm
    outputs : (len(OUTPUTS), 1) casadi.SX
        Symbols, whose values and derivatives come from the model's own code.
    strains : (4, S) casadi.SX
    """

    math: Any = ca

    def __init__(self, arm: Arm, outputs: ca.SX, strains: ca.SX) -> None:
        self.arm, self._outputs, self._strains = arm, outputs, strains

    def _output(self, *names: str) -> Expression:
        return ca.horzcat(*(self._outputs[OUTPUTS.index(name)] for name in names))

    @property
    def twist(self) -> Expression:
        """Turns."""
        return self._output("twist")

    @property
    def lifted_writhe(self) -> Expression:
        """Turns."""
        return self._output("lifted_writhe")

    @property
    def lifted_link(self) -> Expression:
        """Turns."""
        return self._output("lifted_link")

    @property
    def length(self) -> Expression:
        """Metres."""
        return self._output("length")

    @property
    def uturn(self) -> Expression:
        """1 + tip tangent . base tangent."""
        return self._output("uturn")

    @property
    def tip(self) -> Expression:
        """(1, 3), m."""
        return self._output("tip1", "tip2", "tip3")

    @property
    def tip_tangent(self) -> Expression:
        """(1, 3)."""
        return self._output("tangent1", "tangent2", "tangent3")

    @cached_property
    def stations(self) -> Floats:
        """(n + 2,), m."""
        return element_stations(self.arm.edges)

    @cached_property
    def curvatures(self) -> tuple[Expression, Expression, Expression]:
        """k1, k2, k3, each (1, n + 1), 1/m."""
        means = ca.DM(hat_means(self.stations, section_bounds(self.arm, self._strains.shape[1])).T)
        k1, k2, k3 = (self._strains[axis, :] @ means for axis in range(3))
        return k1, k2, k3

    @cached_property
    def points(self) -> tuple[Expression, Expression, Expression]:
        """x, y, z of the nodes, each (1, n + 1), m."""
        edges, turns = self.arm.edges, ca.vertcat(*self.curvatures) @ ca.diag(ca.DM(np.diff(self.stations)))
        stretch = self._strains[3, :] @ ca.DM(hat_means(edges, section_bounds(self.arm, self._strains.shape[1])).T)
        frame, place, places = ca.SX(ca.DM(BASE_FRAME.T)), ca.SX.zeros(3), [ca.SX.zeros(3)]
        for index, length in enumerate(np.diff(edges)):
            vector = turns[:, index]
            frame = frame @ exponential(vector, ca.sqrt(ca.sumsqr(vector) + 1e-14))
            place = place + frame[:, 2] * stretch[index] * length
            places.append(place)
        nodes = ca.horzcat(*places)
        return nodes[0, :], nodes[1, :], nodes[2, :]


def rows_function(read: Callable[[ModelOutputs], Sequence[Expression]], arm: Arm, sections: int) -> ca.Function:
    """What is read of one instant, and its derivatives.

    Parameters
    ----------
    read : callable
        From what can be read of the model to expressions, one by one.
    arm : Arm
    sections : int

    Returns
    -------
    casadi.Function
        ``(outputs (len(OUTPUTS),), strains (4, S)) -> rows (R,), derivatives by outputs (R, len(OUTPUTS)) and by strains (R, 4 S)``;
        the total derivative by the strains is the last plus the one before times the outputs' own.
    """
    outputs, strains = ca.SX.sym("outputs", len(OUTPUTS)), ca.SX.sym("strains", 4, sections)
    rows = ca.vertcat(*read(ModelOutputs(arm, outputs, strains)))
    slopes = [ca.densify(ca.jacobian(rows, inputs)) for inputs in (outputs, ca.vec(strains))]
    return ca.Function("rows", [outputs, strains], [ca.densify(rows), *slopes])


def residual_function(goals: Sequence[Goal], arm: Arm, sections: int) -> ca.Function:
    """Residuals of goals at one instant, and their derivatives, as `rows_function` gives them.

    Parameters
    ----------
    goals : sequence of Goal
    arm : Arm
    sections : int

    Returns
    -------
    casadi.Function
    """
    return rows_function(lambda outputs: [residual for goal in goals for residual in _residuals(goal, outputs)], arm, sections)


def _residuals(goal: Goal, outputs: Outputs) -> list[ca.SX]:
    """What a goal, which may be anybody's, has to say of the model's `outputs`, each one number."""
    told = f"goal {goal}: its formula must serve arrays and CasADi expressions alike, with `outputs.math` and without branches"
    try:
        found = [ca.SX(residual) for residual in goal.residuals(outputs)]
    except OctoctrlError:
        raise
    except Exception as error:
        raise OctoctrlError(f"{told}; it ended with: {brief(error)}") from error
    for residual in found:
        if residual.shape != (1, 1):
            count = residual.numel()
            raise OctoctrlError(f"{told}; it gives {count} numbers for an instant where one is needed: take a column by row[:, index]")
    return found


class Rows:
    """A function of `rows_function` for many instants, on memory that NumPy and CasADi share: to convert would take most of the time.

    One object serves one thread, for it keeps the memory in which the function works.

    Parameters
    ----------
    function : casadi.Function
    """

    def __init__(self, function: ca.Function) -> None:
        self.function, self.count = function, int(function.size1_out(0))
        given = np.zeros(len(OUTPUTS)), np.zeros(function.size_in(1)[::-1])
        # CasADi goes down the columns.
        made = np.zeros(self.count), np.zeros((len(OUTPUTS), self.count)), np.zeros((given[1].size, self.count))
        self._given, self._made = given, made
        buffer: Any
        buffer, self._evaluate = function.buffer()
        self._buffer = buffer
        for index, array in enumerate(given):
            buffer.set_arg(index, array.data)
        for index, array in enumerate(made):
            buffer.set_res(index, array.data)

    def __reduce__(self) -> tuple[type["Rows"], tuple[ca.Function]]:
        return Rows, (self.function,)

    def __call__(self, outputs: Floats, strains: Floats) -> tuple[Floats, Floats, Floats]:
        """Rows (T, R) of outputs (T, len(OUTPUTS)) and strains (T, S, 4), with derivatives (T, R, len(OUTPUTS)) and (T, R, 4 S)."""
        count = len(outputs)
        values, by_outputs, by_strains = (np.empty((count, *part.T.shape)) for part in self._made)
        for t in range(count):
            self._given[0][:], self._given[1][:] = outputs[t], strains[t]
            self._evaluate()
            values[t], by_outputs[t], by_strains[t] = self._made[0], self._made[1].T, self._made[2].T
        return values, by_outputs, by_strains
