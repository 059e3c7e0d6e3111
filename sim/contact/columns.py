"""One row of numbers for each body, and one for each pair of a body and a point of the arm: where each number stands."""

from enum import IntEnum


class Shape(IntEnum):
    """Shapes whose distance is known; sizes in the order in which a body's row holds them."""

    SPHERE = 0  # radius
    CAPSULE = 1  # radius, half the length between the middles of its caps
    CYLINDER = 2  # radius, half length
    BOX = 3  # half lengths along d1, d2, d3
    PLANE = 4  # its outside is towards d3
    MESH = 5  # farthest from the centre along d1, d2, d3; its distances follow the body's columns, see `Grid`


class Body(IntEnum):
    """Columns of a body; vectors are in the laboratory frame unless said."""

    SHAPE = 0
    SIZE = 1  # 3
    POSITION = 4  # 3, of the centre
    FRAME = 7  # 9, rows d1, d2, d3
    VELOCITY = 16  # 3
    MOMENTUM = 19  # 3, angular, about the centre
    SPIN = 22  # 3, of a body that is moved; a free one spins with its momentum
    INVERSE_MASS = 25  # 0: it goes where it is told to
    INVERSE_INERTIA = 26  # 3, about d1, d2, d3
    DAMPING = 29  # 2, rates of velocity and of angular momentum
    SPRING = 31  # 2, stiffness and turning stiffness of its support
    HOME = 33  # 3, where the springs pull it to
    HOME_AXIS = 36  # 3, where they turn d3 to
    STATIC, KINETIC = 39, 40  # coefficients of friction
    STIFFNESS = 41  # Pa, of the contact: times the length of arm that a point stands for
    BOUND = 42  # radius of a ball around the centre that holds the body
    PUSH = 43  # 3, force
    IMPULSE, COUPLE = 46, 49  # 3 and 3, received from the arm since they were cleared
    NORMAL, DEEPEST, LOADED = 52, 53, 54  # sum of normal impulses, deepest overlap (m) and points loaded since they were cleared
    SLIPPED = 55  # longest path slid by a point since it first touched, m
    MOVING = 56  # whether it can go anywhere at all
    SUNK = 57  # deepest overlap less what its spring explains, m, since it was cleared
    WIDTH = 58


class Grid(IntEnum):
    """Columns that follow those of a body that is a mesh."""

    SPACING = 0
    COUNT = 1  # 3
    ORIGIN = 4  # 3, in the body's own frame
    VALUES = 7  # signed distances, the third axis the fastest


class Note(IntEnum):
    """Columns of what is kept of a body at the end of a sample."""

    POSITION = 0  # 3
    FRAME = 3  # 9
    VELOCITY = 12  # 3
    FORCE, COUPLE = 15, 18  # 3 and 3, from the arm, means of the sample
    NORMAL, DEEPEST, LOADED = 21, 22, 23  # mean sum of normal forces, deepest overlap, mean number of points
    SLIPPED = 24
    SHAPE, SIZE, HOME_AXIS = 25, 26, 29  # 1, 3 and 3, by which a recording alone tells how the body is held
    WIDTH = 32


class Anchor(IntEnum):
    """Columns of a pair."""

    STRETCH = 0  # 3, of the tangential spring
    SLIDING = 3
    SLIP = 4  # path slid since first touch, m
    NORMAL = 5  # normal impulse of the last step over its duration: a force; 0: apart
    WIDTH = 6
