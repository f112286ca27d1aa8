"""Chunks of one call, each taken by whichever of XLA's threads is free, or by the caller.

Threads draw from one counter the right to do a chunk. The caller does them from the first on,
others from the last, so that each meets mostly what it had in the call before and has in its own
memory. How many each does is chance, what is done is not. The caller waits for chunks that others
have begun, but for no thread to begin: one that comes late finds nothing left to do. Until then
the job's place in memory is kept, which is why it outlives the call.
"""

import os

from llvmlite import ir

from .jaxpr import BIT, INT, LONG, POINTER, as_word, counted
from .xla_ffi import CallFrame

JOBS = 16
"""Calls of one loop that may be under way with help; any more do their chunks themselves."""
# Words of eight bytes at the beginning of a job, before those that its chunks read and write.
USERS, DRAWN, DONE, LAST, WORDS = 0, 1, 2, 3, 5
STAGES = WORDS - LAST
"""The most there may be; of each is counted what has been drawn from the last chunk on."""


def word(build: ir.IRBuilder, words: ir.Value, index: int | ir.Value) -> ir.Value:
    """Address of a word of eight bytes."""
    index = LONG(index) if isinstance(index, int) else index
    return build.gep(words, [index], source_etype=LONG)


def run(
    frame: CallFrame, stages: list[ir.Function], chunks: int, given: list[ir.Value], spare: int
) -> None:
    """Has all chunks of the first stage done, then all of the next; where the builder stands.

    Args:
      frame: of the call.
      stages: functions of the words of a job and the number of a chunk.
      chunks: of each stage.
      given: the first words of the job.
      spare: words after them, for the chunks to write.
    """
    assert len(stages) <= STAGES
    build, module = frame.build, frame.build.module
    size = WORDS + len(given) + spare
    work = _work(module, stages, chunks)
    task = _task(module, work)
    jobs = ir.GlobalVariable(module, ir.ArrayType(LONG, JOBS * size), "jobs")
    jobs.linkage, jobs.initializer = "internal", ir.Constant(jobs.value_type, None)

    most = build.sub(frame.threads(), LONG(1))
    wanted = build.select(build.icmp_signed("<", most, LONG(chunks)), most, LONG(chunks - 1))
    own, job, helpers = (build.alloca(LONG, number) for number in (size, 1, 1))
    build.store(LONG(1), word(build, own, USERS))
    build.store(as_word(build, own), job)
    build.store(LONG(0), helpers)
    with counted(build, LONG(0), LONG(JOBS)) as index:
        missing = build.icmp_signed("<", build.load(helpers, typ=LONG), wanted)
        with build.if_then(missing):
            place = word(build, jobs, build.mul(index, LONG(size)))
            users = build.add(wanted, LONG(1))
            free = build.cmpxchg(word(build, place, USERS), LONG(0), users, "acq_rel", "acquire")
            with build.if_then(build.extract_value(free, 1)):
                build.store(as_word(build, place), job)
                build.store(wanted, helpers)

    place = build.load(job, typ=POINTER)
    for index in range(DRAWN, WORDS):
        build.store(LONG(0), word(build, place, index))
    for index, value in enumerate(given, start=WORDS):
        build.store(as_word(build, value), word(build, place, index))
    with counted(build, LONG(0), build.load(helpers, typ=LONG)):
        refused = build.not_(frame.schedule(task, place))
        with build.if_then(refused):
            _left(build, place)
    build.call(work, [place, BIT(1)])
    _wait(build, place, len(stages) * chunks)
    _left(build, place)


def _work(module: ir.Module, stages: list[ir.Function], chunks: int) -> ir.Function:
    """Does chunks until none is left, as the caller or as another."""
    work = _function(module, "work", BIT)
    job, calling = work.args
    build = ir.IRBuilder(work.append_basic_block())
    own = [build.alloca(LONG) for _ in stages]
    for count in own:
        build.store(LONG(0), count)
    again = work.append_basic_block()
    build.branch(again)
    build.position_at_end(again)
    drawn = build.atomic_rmw("add", word(build, job, DRAWN), LONG(1), "acq_rel")
    with build.if_then(build.icmp_signed(">=", drawn, LONG(len(stages) * chunks))):
        build.ret_void()
    words = word(build, job, WORDS)
    for number, (stage, done) in enumerate(zip(stages, own, strict=True)):
        place = build.sub(drawn, LONG(number * chunks))
        with build.if_then(build.icmp_unsigned("<", place, LONG(chunks))):
            _wait(build, job, number * chunks)
            with build.if_else(calling) as (first, last):
                with first:
                    chunk = build.load(done, typ=LONG)
                    build.store(build.add(chunk, LONG(1)), done)
                    build.call(stage, [words, chunk])
                with last:
                    count = word(build, job, LAST + number)
                    before = build.atomic_rmw("add", count, LONG(1), "acq_rel")
                    build.call(stage, [words, build.sub(LONG(chunks - 1), before)])
    build.atomic_rmw("add", word(build, job, DONE), LONG(1), "acq_rel")
    build.branch(again)
    return work


def _task(module: ir.Module, work: ir.Function) -> ir.Function:
    """The function that another thread is asked to call."""
    task = _function(module, "task")
    build = ir.IRBuilder(task.append_basic_block())
    build.call(work, [*task.args, BIT(0)])
    _left(build, task.args[0])
    build.ret_void()
    return task


def _wait(build: ir.IRBuilder, job: ir.Value, number: int) -> None:
    """Until so many chunks are done."""
    again, after = build.append_basic_block(), build.append_basic_block()
    build.branch(again)
    build.position_at_end(again)
    done = build.load_atomic(word(build, job, DONE), "acquire", 8, typ=LONG)
    missing = build.icmp_signed("<", done, LONG(number))
    if os.name == "posix":  # who is waited for may want this very core
        with build.if_then(missing):
            build.call(_yield(build.module), [])
    build.cbranch(missing, again, after)
    build.position_at_end(after)


def _yield(module: ir.Module) -> ir.Function:
    """The function `sched_yield` of the C library."""
    name = "sched_yield"
    if name in module.globals:
        return module.globals[name]
    return ir.Function(module, ir.FunctionType(INT, []), name)


def _left(build: ir.IRBuilder, job: ir.Value) -> None:
    """One user fewer; without any the place is free."""
    build.atomic_rmw("sub", word(build, job, USERS), LONG(1), "acq_rel")


def _function(module: ir.Module, name: str, *more: ir.Type) -> ir.Function:
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [POINTER, *more]), name)
    function.linkage = "internal"
    return function
