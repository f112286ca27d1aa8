"""Fits that are interrupted: `python interrupted_fits.py CALL TIMES` prints how long each took.

Ctrl-C comes at a random moment after compilation, as a signal to the process: within two seconds,
a run of the model or more.
"""

import os
import random
import signal
import sys
import threading
import time
from collections import OrderedDict

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402 - precision comes before anything is computed
import numpy as np  # noqa: E402

import calibrate  # noqa: E402
from calibrate.inference.chains import Sampler  # noqa: E402
from calibrate.inference.posterior import posterior  # noqa: E402
from calibrate.inference.profile import profiles  # noqa: E402

SIZE, TURNS = 120, 200_000


def heavy(theta):
    """A model that takes a second or more, as a column of many layers does."""
    turned = jnp.full((SIZE,), 0.5 * theta["a"])

    def turn(_, now):
        return now + 1e-9 * jnp.roll(now, 1) * jnp.sin(now)

    turned = jax.lax.fori_loop(0, TURNS, turn, turned)
    return jnp.stack([jnp.mean(turned) - 1.0, theta["b"] - 3.0]) / jnp.array([0.1, 0.2])


def bent(theta):
    """A model that takes no time, in a valley that takes many steps."""
    x, y = jnp.log(theta["a"]), jnp.log(theta["b"])
    return jnp.stack([10.0 * (y - x**2), 1.0 - x])


START = OrderedDict(a=1.0, b=1.0)


def fit() -> None:
    while True:
        calibrate.fit(heavy, START)


def profile_of() -> None:
    while True:
        profiles(FITTED)


def sample() -> None:
    while True:
        posterior(BENT, samples=10**6, method="NUTS")


COMPILED = threading.Event()


def told_when_compiled(pieces):
    """A posterior is compiled anew in every call: its first piece says when that is done."""

    def telling(self, *arguments):
        for found in pieces(self, *arguments):
            COMPILED.set()
            yield found

    return telling


def interrupted(call, after: float) -> float:
    """Seconds from the signal to the end of the call."""
    sent = []

    def send() -> None:
        if call is sample:
            COMPILED.wait()
            time.sleep(after)
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    COMPILED.clear()
    threading.Timer(after, send).start()
    try:
        call()
    except KeyboardInterrupt:
        return time.perf_counter() - sent[0]
    raise AssertionError("it ended by itself")


if __name__ == "__main__":
    Sampler.pieces = told_when_compiled(Sampler.pieces)
    call = {"fit": fit, "profiles": profile_of, "posterior": sample}[sys.argv[1]]
    FITTED, BENT = calibrate.fit(heavy, START), calibrate.fit(bent, START)
    began = time.perf_counter()
    np.asarray(FITTED.linearised(np.zeros(2), FITTED.given)[0])
    print(f"a run of the model takes {time.perf_counter() - began:.2g} s", file=sys.stderr)
    if call is not sample:
        interrupted(call, 20.0)  # what it needs is compiled by then
    chance = random.Random(0)
    for _ in range(int(sys.argv[2])):
        print(interrupted(call, chance.uniform(0.5, 2.5)), flush=True)
