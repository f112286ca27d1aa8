"""A collision in its plane of motion, integrated by our law or by that of LIGGGHTS.

Forces are Hertz' and Mindlin's of overlap d and tangential displacement s,

    F_n = 4/3 E* sqrt(R* d) d + z sqrt(5 m* k) d^(1/4) d'

and likewise along the surface, see `reference`; what the laws differ in stands in `DIFFERENCES`.
Nothing here uses the package.
"""

from dataclasses import dataclass

import numpy as np

from . import reference

DIFFERENCES = """\
1. In LIGGGHTS the damped normal force becomes attractive at the end of a contact. In mrjax the
   contact ends before that.
2. LIGGGHTS limits friction by the magnitude of the normal force, so friction continues while the
   force is attractive. A sphere that slides throughout loses more than mu (1 + e) v of its
   tangential speed.
3. LIGGGHTS omits the tangential dashpot while the spring slides, and adds it without a limit while
   the spring sticks. An impact therefore begins with a peak of friction above mu F_n.
"""


@dataclass(frozen=True)
class Motion:
    """The first sphere of a collision along time; SI."""

    time: np.ndarray
    velocity: np.ndarray  # x, z, (T, 2)
    spin: np.ndarray  # y, (T,)
    force: np.ndarray  # x, z, (T, 2)


def integrated(case: dict, *, as_liggghts: bool) -> Motion:
    """The same collision by either law, integrated in the plane of motion.

    Velocity Verlet of one sphere; its partner is its mirror image, or the wall.
    """
    radius, wall, step = case["diameter"] / 2, case["wall"], case["time_step"]
    mass = 4 / 3 * np.pi * radius**3 * case["density"]
    nu, friction = case["poisson_ratio"], case["friction"]
    modulus = case["elastic_modulus"] / (2 * (1 - nu**2))  # E*: both surfaces of one material
    shear = case["elastic_modulus"] / (4 * (2 - nu) * (1 + nu))  # G*
    pair_radius, pair_mass = (radius, mass) if wall else (radius / 2, mass / 2)
    log = np.log(case["restitution"])
    damping = (
        -log / np.hypot(np.pi, log) if as_liggghts else reference.damping_ratio(case["restitution"])
    )
    x, z = case["positions"][0][0], case["positions"][0][2]
    vx, vz = case["velocities"][0][0], case["velocities"][0][2]
    spin = stretch = ax = az = turning = 0.0
    record = [(0.0, vx, vz, 0.0, 0.0, 0.0)]
    for number in range(1, case["steps"] + 1):
        vx, vz, spin = vx + 0.5 * step * ax, vz + 0.5 * step * az, spin + 0.5 * step * turning
        x, z = x + step * vx, z + step * vz
        distance = z if wall else 2 * np.hypot(x, z)
        overlap = (radius if wall else 2 * radius) - distance
        nx, nz = (0.0, 1.0) if wall else (2 * x / distance, 2 * z / distance)
        tx, tz = nz, -nx
        fn = ft = 0.0
        if overlap > 0:
            share = 1 if wall else 2  # the mirror image moves as much the other way
            arm = radius - overlap / 2
            closing = -share * (vx * nx + vz * nz)
            slip = share * (vx * tx + vz * tz - arm * spin)
            root = np.sqrt(pair_radius * overlap)
            normal, tangential = 2 * modulus * root, 8 * shear * root
            fn = 2 / 3 * normal * overlap + damping * np.sqrt(10 / 3 * pair_mass * normal) * closing
            dashpot = damping * np.sqrt(10 / 3 * pair_mass * tangential)
            if not as_liggghts:
                fn = max(fn, 0.0)
            limit = friction * abs(fn)
            stretch += step * slip
            slides = abs(tangential * stretch) > limit
            if slides:
                stretch = np.sign(stretch) * limit / tangential
            ft = -tangential * stretch
            if not (as_liggghts and slides):
                ft -= dashpot * slip
            if not as_liggghts:
                ft = np.clip(ft, -limit, limit)
            torque = -arm * ft  # about y: (-arm n) x (ft t), with n x t = -y
        else:
            stretch = torque = 0.0
        fx, fz = fn * nx + ft * tx, fn * nz + ft * tz
        ax, az, turning = fx / mass, fz / mass, torque / (0.4 * mass * radius**2)
        vx, vz, spin = vx + 0.5 * step * ax, vz + 0.5 * step * az, spin + 0.5 * step * turning
        record.append((number * step, vx, vz, spin, fx, fz))
    time, vx, vz, spin, fx, fz = np.array(record).T
    return Motion(time, np.stack([vx, vz], 1), spin, np.stack([fx, fz], 1))
