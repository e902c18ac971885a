"""Who works on the parts: a pool of processes on this machine, Spark, Ray. What is done is the same."""

from __future__ import annotations

import concurrent.futures
import os
import pickle
import threading
from collections.abc import Callable, Sequence
from typing import Any

from . import _child
from ._results import GROUPS
from ._work import Part, Plan, work_on

Told = Callable[[int], None]

_MOST_TASKS = 512
_TASKS_A_CORE = 8
_RECORDINGS_A_TASK = 4000
"""More tasks than those a core only where one would have more than this: between two of them nothing is computed for 0.06 s."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def pool(parts: list[Part], plan: Plan, told: Told, workers: int | None = None) -> None:
    """A process a core of this machine; threads here hand out the work and write the results."""
    children: list[_child.Child] = []
    own = threading.local()
    is_over = threading.Event()

    def begin() -> None:
        own.child = _child.Child(plan.folder)
        children.append(own.child)

    def one(part: Part) -> int:
        return 0 if is_over.is_set() else sum(work_on([part], plan, own.child))

    threads = concurrent.futures.ThreadPoolExecutor(workers or cores(), "muslip-fleet", initializer=begin)
    try:
        for done in concurrent.futures.as_completed([threads.submit(one, part) for part in parts]):
            told(done.result())
    except BaseException:
        is_over.set()
        threads.shutdown(wait=False, cancel_futures=True)
        raise
    finally:
        for child in children:
            child.end()
        threads.shutdown()


def here(parts: Sequence[Part], plan: Plan) -> list[int]:
    """Parts, by the child of the worker that this is called in."""
    return work_on(parts, plan, _child.mine(plan.folder))


def spark(parts: list[Part], plan: Plan, told: Told, session: Any = None) -> None:
    """Apache Spark: recordings by ``mapInPandas``, groups by ``applyInPandas``. Workers need pandas, pyarrow and this package."""
    from pyspark import cloudpickle  # pyright: ignore[reportMissingImports]
    from pyspark.sql import SparkSession  # pyright: ignore[reportMissingImports]

    from . import _spark

    is_own = session is None and SparkSession.getActiveSession() is None
    session = session or SparkSession.builder.appName("muslip fleet").getOrCreate()
    # These functions travel themselves; what they call is looked up where they run, in the archive that was sent along.
    cloudpickle.register_pickle_by_value(_spark)
    packed = pickle.dumps(plan)
    frame = session.createDataFrame([(index, pickle.dumps(part)) for index, part in enumerate(parts)], _spark.ASKED)
    try:
        if plan.results.schema is GROUPS:
            frame = frame.repartition(min(len(parts), _MOST_TASKS), "part")
            answers = frame.groupBy("part").applyInPandas(_spark.group_by(packed), _spark.ANSWERED)
        else:
            answers = frame.repartition(_tasks(parts, session)).mapInPandas(_spark.batches_by(packed), _spark.ANSWERED)
        for row in answers.collect():
            told(row["units"])
    finally:
        if is_own:
            session.stop()


def _tasks(parts: list[Part], session: Any) -> int:
    """Tasks of several parts: enough of them that no core waits for the last, few enough that Spark's share of each is none."""
    units = sum(len(of) for _, of in parts)
    at_once: int = session.sparkContext.defaultParallelism
    return min(len(parts), max(_TASKS_A_CORE * at_once, units // _RECORDINGS_A_TASK))


def ray(parts: list[Part], plan: Plan, told: Told) -> None:
    """Ray: a task a part. Workers need pyarrow and this package."""
    import ray  # pyright: ignore[reportMissingImports]

    is_own = not ray.is_initialized()
    if is_own:
        ray.init()
    try:
        shared = ray.put(plan)
        asked = [ray.remote(here).options(max_retries=3).remote([part], shared) for part in parts]
        while asked:
            ready, asked = ray.wait(asked)
            for units in ray.get(ready):
                told(sum(units))
    finally:
        if is_own:
            ray.shutdown()


ENGINES: dict[str, Callable[..., None]] = {"pool": pool, "spark": spark, "ray": ray}
