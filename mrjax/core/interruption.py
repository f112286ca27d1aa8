"""Ctrl-C during a long call: the call ends at the next place where it is safe to.

Python would raise `KeyboardInterrupt` wherever it happens to be. In the middle of a compilation
that leaves jaxlib 0.10.1 so that it crashes when the interpreter ends; in a callback of the garbage
collector it is lost.
"""

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")

LOOK = 0.05
"""Time between two looks at whether a call in a thread is to be waited for, s."""


class StoppedError(BaseException):
    """A run that was asked to end, by Ctrl-C or by the failure of another.

    As `KeyboardInterrupt`, it is no `Exception`: nothing takes it for a fault of the run.
    """


class Stop:
    """A request to end runs, made from any thread or signal, looked at after every piece."""

    asked = False

    def look(self) -> None:
        """Passes where they are not.

        Raises:
          StoppedError: they are.
        """
        if self.asked:
            raise StoppedError


@contextmanager
def interruptible() -> Iterator[Stop]:
    """Turns Ctrl-C into a request to stop; a second Ctrl-C does not wait.

    Leaves signals alone outside the main thread, which none reaches, and where Ctrl-C is ignored.

    Raises:
      KeyboardInterrupt: at the end, if Ctrl-C came.
    """
    stop, before = Stop(), signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield stop
        return
    came: list[int] = []

    def asked(number: int, frame: object) -> None:
        came.append(number)
        stop.asked = True
        if len(came) > 1:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, asked)
    try:
        yield stop
    except StoppedError:
        if not came:
            raise
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        before(came[0], None)
        raise KeyboardInterrupt  # a handler of somebody else's may return


def in_a_thread(call: Callable[[], T], stop: Stop) -> T:
    """The result of a call that takes long; raises as `results`."""
    with _pool(1) as pool:
        return results([pool.submit(call)], stop)[0]


def side_by_side(calls: Sequence[Callable[[], T]], threads: int, stop: Stop) -> list[T]:
    """The results of calls in threads of their own; where one fails, the others are stopped.

    Raises:
      StoppedError: as `stop` asks for; the calls end with the piece that they are at.
      Exception: that of the first call to fail.
    """
    with _pool(threads) as pool:
        return results([pool.submit(call) for call in calls], stop)


def results(futures: Sequence[Future[T]], stop: Stop) -> list[T]:
    """Results of calls, waited for as long as nothing asks to stop; raises as `side_by_side`."""
    left = set(futures)
    while left:
        done, left = wait(left, timeout=LOOK)
        failed = [future for future in done if future.exception()]
        if failed and not stop.asked:
            stop.asked = True
            wait(left)
            failed[0].result()
        stop.look()
    return [future.result() for future in futures]


@contextmanager
def _pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Threads whose end is not waited for."""
    pool = ThreadPoolExecutor(threads)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
