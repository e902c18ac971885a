"""What Spark's workers run. These functions travel by value: they may use nothing of this package before they have found it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas

ASKED = "part int, units binary"
ANSWERED = "part int, units int"

ARCHIVE = "muslip"
"""The name that the archive is unpacked under: ``--archives muslip.zip#muslip``."""


def _answered(packed: bytes, asked: pandas.DataFrame) -> pandas.DataFrame:
    import os
    import pickle
    import sys

    from pyspark import SparkFiles  # pyright: ignore[reportMissingImports]

    archive = os.path.join(SparkFiles.getRootDirectory(), ARCHIVE)
    if os.path.isdir(archive) and archive not in sys.path:
        sys.path.insert(0, archive)

    from muslip.fleet._engines import here

    plan = pickle.loads(packed)
    return asked[["part"]].assign(units=here([pickle.loads(part) for part in asked["units"]], plan))


def batches_by(packed: bytes) -> Callable[[Iterator[pandas.DataFrame]], Iterator[pandas.DataFrame]]:
    """What ``mapInPandas`` is given for a plan."""

    def batches(asked: Iterator[pandas.DataFrame]) -> Iterator[pandas.DataFrame]:
        for batch in asked:
            yield _answered(packed, batch)

    return batches


def group_by(packed: bytes) -> Callable[[pandas.DataFrame], pandas.DataFrame]:
    """What ``applyInPandas`` is given for a plan."""

    def group(asked: pandas.DataFrame) -> pandas.DataFrame:
        return _answered(packed, asked)

    return group
