"""LLVM code that shares the chunks of one call among XLA's threads and the calling thread.

A thread that increments a common counter may do one more chunk. The caller takes chunks from the
first on, helpers take them from the last on. So each thread mostly meets data of the previous call
that is still in its own cache. The number of chunks of each thread is random, the result is not.
The caller waits for chunks that helpers have begun, but never for a helper to begin: a late helper
finds no chunk left. The job is reserved until the last helper has left, so it can outlive the call.
"""

import os

from llvmlite import ir

from .jaxpr import BIT, INT, LONG, POINTER, as_word, counted
from .xla_ffi import CallFrame

JOBS = 16
"""Maximum number of concurrent calls of one loop with helpers; further calls run on one thread."""
# Indices of the 8-byte words that begin a job, before the words that its chunks read and write.
USERS, DRAWN, DONE, LAST, WORDS = 0, 1, 2, 3, 5
STAGES = WORDS - LAST
"""Maximum number of stages; each has a counter of the chunks that helpers took from the end."""


def word(build: ir.IRBuilder, words: ir.Value, index: int | ir.Value) -> ir.Value:
    """Address of the 8-byte word with this index."""
    index = LONG(index) if isinstance(index, int) else index
    return build.gep(words, [index], source_etype=LONG)


def run(
    frame: CallFrame, stages: list[ir.Function], chunks: int, values: list[ir.Value], spare: int
) -> None:
    """Emits code that runs all chunks of the first stage, then all chunks of the next stage.

    Args:
      frame: the call frame; code is emitted at the position of its builder.
      stages: functions of the words of a job and the index of a chunk.
      chunks: number of chunks of each stage.
      values: values of the first words of the job.
      spare: number of words after them, which the chunks may write.
    """
    assert len(stages) <= STAGES
    build, module = frame.build, frame.build.module
    size = WORDS + len(values) + spare
    work = _work(module, stages, chunks)
    task = _task(module, work)
    jobs = ir.GlobalVariable(module, ir.ArrayType(LONG, JOBS * size), "jobs")
    jobs.linkage, jobs.initializer = "internal", ir.Constant(jobs.value_type, None)

    most = build.sub(frame.threads(), LONG(1))
    helper_count = build.select(build.icmp_signed("<", most, LONG(chunks)), most, LONG(chunks - 1))
    own, job, helpers = (build.alloca(LONG, number) for number in (size, 1, 1))
    build.store(LONG(1), word(build, own, USERS))
    build.store(as_word(build, own), job)
    build.store(LONG(0), helpers)
    with counted(build, LONG(0), LONG(JOBS)) as index:
        missing = build.icmp_signed("<", build.load(helpers, typ=LONG), helper_count)
        with build.if_then(missing):
            place = word(build, jobs, build.mul(index, LONG(size)))
            users = build.add(helper_count, LONG(1))
            free = build.cmpxchg(word(build, place, USERS), LONG(0), users, "acq_rel", "acquire")
            with build.if_then(build.extract_value(free, 1)):
                build.store(as_word(build, place), job)
                build.store(helper_count, helpers)

    place = build.load(job, typ=POINTER)
    for index in range(DRAWN, WORDS):
        build.store(LONG(0), word(build, place, index))
    for index, value in enumerate(values, start=WORDS):
        build.store(as_word(build, value), word(build, place, index))
    with counted(build, LONG(0), build.load(helpers, typ=LONG)):
        refused = build.not_(frame.schedule(task, place))
        with build.if_then(refused):
            _leave(build, place)
    build.call(work, [place, BIT(1)])
    _wait(build, place, len(stages) * chunks)
    _leave(build, place)


def _work(module: ir.Module, stages: list[ir.Function], chunks: int) -> ir.Function:
    """Emits the function that does chunks until none is left, for the caller and for helpers."""
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
    """Emits the function that a helper thread calls."""
    task = _function(module, "task")
    build = ir.IRBuilder(task.append_basic_block())
    build.call(work, [*task.args, BIT(0)])
    _leave(build, task.args[0])
    build.ret_void()
    return task


def _wait(build: ir.IRBuilder, job: ir.Value, number: int) -> None:
    """Emits a wait until `number` chunks are done."""
    again, after = build.append_basic_block(), build.append_basic_block()
    build.branch(again)
    build.position_at_end(again)
    done = build.load_atomic(word(build, job, DONE), "acquire", 8, typ=LONG)
    missing = build.icmp_signed("<", done, LONG(number))
    if os.name == "posix":  # the thread we wait for may need this core
        with build.if_then(missing):
            build.call(_yield(build.module), [])
    build.cbranch(missing, again, after)
    build.position_at_end(after)


def _yield(module: ir.Module) -> ir.Function:
    """Declares the function `sched_yield` of the C library."""
    name = "sched_yield"
    if name in module.globals:
        return module.globals[name]
    return ir.Function(module, ir.FunctionType(INT, []), name)


def _leave(build: ir.IRBuilder, job: ir.Value) -> None:
    """Emits the decrement of the number of users; a job without users is free for the next call."""
    build.atomic_rmw("sub", word(build, job, USERS), LONG(1), "acq_rel")


def _function(module: ir.Module, name: str, *more: ir.Type) -> ir.Function:
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [POINTER, *more]), name)
    function.linkage = "internal"
    return function
