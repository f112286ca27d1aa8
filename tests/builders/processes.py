"""Processes that compute together: a free port, and a recipe that is soon done."""

import socket
import textwrap

SMALL = textwrap.dedent(
    """
    name = "small"
    [particle]
    density = 7470.0
    diameter = 4e-6
    elastic_modulus = 211e9
    poisson_ratio = 0.31
    [fluid]
    density = 950.0
    viscosity = 0.01
    [composition]
    particle = 0.80
    fluid = 0.20
    [box]
    size = [10e-6, 10e-6, 12e-6]
    """
)


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
