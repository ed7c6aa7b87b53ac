"""Memory of the kernel of inverse dynamics: SI units, except where fields are called dimensionless."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table
from cinegen.jit.memory import array, foreign, parameter, state
from cinegen.loops._kernels.memory import LoopMemory


class DynamicsMemory(LoopMemory):
    """A mechanism, its loads, and the torques of its actuated joints at many configurations."""

    # bodies: a joint's, with its payloads
    mass: Array = array("joints")
    centre: Array = array("joints", 3)  # of mass, in the joint's frame
    inertia: Array = array("joints", 3, 3)  # about it, in the joint's axes
    gravity: Array = array(3)
    armature: Array = array("n")  # inertia of rotors, seen at their joints, kg m^2 and kg
    damping: Array = array("n")  # viscous friction, N m s/rad and N s/m
    friction: Array = array("n")  # Coulomb friction, N m and N
    loads: int = parameter(0)
    load_joint: Table = array("loads", dtype=int)  # that carries the node
    load_offset: Array = array("loads", 4, 3)  # the node's frame, relative to that joint
    load_turns: Table = array("loads", dtype=int)  # not 0: in the node's axes, else in the world's
    load: Array = array("loads", 6)  # force and moment on the node, at its origin

    # what is asked
    count: int = parameter(0)
    moves: int = parameter(0)  # velocities and accelerations are given, else 0
    completes: int = parameter(0)  # ... only those of the actuated joints
    given_q: Array = foreign("count", "nq")
    given_v: Array = foreign("count", "nv")  # of a held base: its twist in its own axes, linear, then angular
    given_a: Array = foreign("count", "nv")

    # results
    torques: Array = foreign("count", "actuated")
    statuses: Table = foreign("count", dtype=int)  # HELD, OPEN, ...
    gaps: Array = foreign("count", 3)  # dimensionless: of the loops, of their velocities, of their accelerations
    now: int = state(0)  # index of the configuration

    # the reaction of one joint or loop, where one is asked for
    asked_joint: int = parameter(0)  # or 0
    asked_loop: int = parameter(-1)  # or below 0
    passed_on: Array = array("loops")  # part of each loop's wrench that the asked joint transmits: 1, 0 or -1
    reaction: Array = foreign("count", 6)  # at the joint's origin, in its axes; of a loop in those of its first end
    multipliers: Array = array("rows")  # of the loops and couplings
    loads_left: Array = array("n")  # scratch: what multipliers must balance

    # spatial vectors at the world's origin, in its axes: linear, then angular
    relative: Array = array("joints", 6)  # velocity of a joint
    velocity: Array = array("joints", 6)
    bias: Array = array("joints", 6)  # acceleration of a joint at no acceleration of its variables
    acceleration: Array = array("joints", 6)
    wrench: Array = array("joints", 6)  # force and moment that a joint transmits to its body
    v: Array = array("n")
    a: Array = array("n")
    tau: Array = array("n")  # of all joints, loops open

    # motions that keep the loops closed, dimensionless, and those of the actuated joints among them
    mobility: int = parameter(0)
    null_space: Array = array("mobility", "n")
    step: Array = array("actuated")  # size of one dimensionless step: torques and forces are compared by it
    factors: Array = array("mobility", "actuated")
    order: Table = array("mobility", dtype=int)
    left: Array = array("mobility")
    tau_of: Array = array("mobility")
    reflectors: Array = array("mobility", "actuated")
    coordinates: Array = array("mobility")
    effort: Array = array("actuated")

    # inertia seen at the actuated joints
    masses: Array = foreign("count", "actuated", "actuated")
    motions: Array = array("actuated", "n")  # of all joints, by each actuated one; m and rad
    twists: Array = array("joints", "actuated", 6)  # of all bodies
    moved: Array = array("actuated", 3)  # of one body: its centre's velocity,
    spin: Array = array("actuated", 3)  # angular velocity in its own axes,
    spun: Array = array("actuated", 3)  # and angular momentum
    inconsistent: float = state(0.0)
