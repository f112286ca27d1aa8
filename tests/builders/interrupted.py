"""Calls that are interrupted: `python interrupted.py CALL TIMES` prints how long each took to end.

Ctrl-C comes at a random moment after compilation, as a signal to the process: within a second,
in which there are several pieces.
"""

import os
import random
import signal
import sys
import threading
import time

import jax

jax.config.update("jax_enable_x64", True)

import mrjax  # noqa: E402 - precision comes before anything is computed
from mrjax.simulation import pieces  # noqa: E402

case2 = mrjax.Recipe.load("case2")
state = mrjax.disperse(case2, seed=0)
parameters = mrjax.softened(case2.parameters(), case2.box, state.particles, 0.05)
hindrance = case2.hindrance
long = dict(duration=1e6, time_step=0.003, hindrance=hindrance)


def simulate() -> None:
    mrjax.simulate(state, parameters, case2.box, **long)


def follow() -> None:
    mrjax.follow(state, parameters, case2.box, **long)


def settle() -> None:
    # A rest that is never met.
    mrjax.settle(state, parameters, case2.box, rest=1e-30, longest=1e9, hindrance=hindrance)


def ensemble() -> None:
    states = [state, mrjax.disperse(case2, seed=1)]
    mrjax.settle(states, parameters, case2.box, rest=1e-30, longest=1e9, hindrance=hindrance)


def sedimentation() -> None:
    mrjax.sedimentation(case2, seeds=[0, 1], overlap=1e-4)


CALLS = {call.__name__: call for call in (simulate, follow, settle, ensemble, sedimentation)}


def interrupted(call, after: float, when: threading.Event) -> float:
    """Seconds from Ctrl-C, so long after an event, to the end of the call."""
    sent = []

    def send() -> None:
        when.wait()
        time.sleep(after)
        sent.append(time.perf_counter())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=send, daemon=True).start()
    try:
        call()
    except KeyboardInterrupt:
        return time.perf_counter() - sent[0]
    raise AssertionError("it ended by itself")


if __name__ == "__main__":
    call, times = CALLS[sys.argv[1]], int(sys.argv[2])
    at_once, compiled, piece = threading.Event(), threading.Event(), pieces.PiecewiseRun._piece
    at_once.set()
    interrupted(call, 0.5, at_once)  # while JAX compiles: at the end of that

    def told(self, *arguments):
        piece(self, *arguments)
        compiled.set()

    pieces.PiecewiseRun._piece = told
    chance = random.Random(0)
    for _ in range(times):
        print(interrupted(call, chance.uniform(0.5, 1.5), compiled), flush=True)
