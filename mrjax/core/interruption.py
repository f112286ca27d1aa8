"""Ctrl-C during a long call: the call ends at the next point where this is safe.

Python would raise `KeyboardInterrupt` at any point. During a compilation, jaxlib 0.10.1 then
crashes when the interpreter ends; in a callback of the garbage collector the exception is lost.
"""

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")

POLL_INTERVAL = 0.05
"""Time between two checks of a request to stop, while calls in threads are waited for, s."""


class StoppedError(BaseException):
    """A run was stopped, by Ctrl-C or because another run failed.

    Like `KeyboardInterrupt`, it is no `Exception`: no handler takes it for a fault of the run.
    """


class Stop:
    """A request to end runs. Any thread or signal can make it; runs check it after every piece."""

    requested = False

    def check(self) -> None:
        """Checks whether a stop was requested.

        Raises:
          StoppedError: it was.
        """
        if self.requested:
            raise StoppedError


@contextmanager
def interruptible() -> Iterator[Stop]:
    """Turns Ctrl-C into a request to stop; a second Ctrl-C interrupts at once.

    Signals are left alone outside the main thread, which no signal reaches, and in processes that
    ignore Ctrl-C.

    Raises:
      KeyboardInterrupt: at the end, if Ctrl-C was pressed.
    """
    stop, before = Stop(), signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield stop
        return
    signals: list[int] = []

    def request_stop(number: int, frame: object) -> None:
        signals.append(number)
        stop.requested = True
        if len(signals) > 1:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, request_stop)
    try:
        yield stop
    except StoppedError:
        if not signals:
            raise
    finally:
        signal.signal(signal.SIGINT, before)
    if signals:
        before(signals[0], None)
        raise KeyboardInterrupt  # in case that handler returns


def in_a_thread(call: Callable[[], T], stop: Stop) -> T:
    """Runs a long call in a thread and returns its result; raises as `results` does."""
    with _pool(1) as pool:
        return results([pool.submit(call)], stop)[0]


def side_by_side(calls: Sequence[Callable[[], T]], threads: int, stop: Stop) -> list[T]:
    """Runs calls in threads and returns their results; if one fails, the others are stopped.

    Raises:
      StoppedError: a stop was requested; each call ends with its current piece.
      Exception: the exception of the first call that failed.
    """
    with _pool(threads) as pool:
        return results([pool.submit(call) for call in calls], stop)


def results(futures: Sequence[Future[T]], stop: Stop) -> list[T]:
    """Waits for calls and returns their results; raises as `side_by_side` does."""
    pending = set(futures)
    while pending:
        finished, pending = wait(pending, timeout=POLL_INTERVAL)
        failed = [future for future in finished if future.exception()]
        if failed and not stop.requested:
            stop.requested = True
            wait(pending)
            failed[0].result()
        stop.check()
    return [future.result() for future in futures]


@contextmanager
def _pool(threads: int) -> Iterator[ThreadPoolExecutor]:
    """Thread pool that does not wait for its threads at the end."""
    pool = ThreadPoolExecutor(threads)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
