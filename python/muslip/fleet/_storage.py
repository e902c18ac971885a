"""Files here and on object storage: what begins with a protocol is fsspec's, or pyarrow's where that is not installed."""

from __future__ import annotations

import contextlib
import glob
import os
import posixpath
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

TEMPORARY = "_part."
"""How a file begins that is not whole yet: readers of the data set pass it over."""


def is_remote(path: str) -> bool:
    """Whether a path names its storage, as ``s3://bucket/run.mf4`` does."""
    return "://" in path


def _fsspec(path: str) -> tuple[Any, str] | None:
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        return None
    system, inside = url_to_fs(path)
    return system, inside


def _pyarrow(path: str) -> tuple[Any, str]:
    from pyarrow.fs import FileSystem

    system, inside = FileSystem.from_uri(path)
    return system, inside


def found(pattern: str) -> list[str]:
    """The files that a pattern names, sorted; a folder's own files where it is one."""
    if not is_remote(pattern):
        if os.path.isdir(pattern):
            pattern = os.path.join(glob.escape(pattern), "*")
        return sorted(path for path in glob.glob(pattern, recursive=True) if os.path.isfile(path))
    by_fsspec = _fsspec(pattern)
    if by_fsspec is None:
        raise ModuleNotFoundError("a pattern on a storage needs fsspec: pip install fsspec")
    system, inside = by_fsspec
    inside = posixpath.join(inside, "*") if system.isdir(inside) else inside
    return sorted(system.unstrip_protocol(path) for path in system.glob(inside) if system.isfile(path))


def opened(path: str) -> BinaryIO:
    """A file, to be read from its start to its end."""
    if not is_remote(path):
        return open(path, "rb")
    by_fsspec = _fsspec(path)
    if by_fsspec is not None:
        system, inside = by_fsspec
        stream: BinaryIO = system.open(inside, "rb")
        return stream
    system, inside = _pyarrow(path)
    stream = system.open_input_stream(inside)
    return stream


@contextlib.contextmanager
def here(path: str) -> Iterator[str]:
    """The file as one of this machine: itself, or a copy for the while."""
    if not is_remote(path):
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        copy = os.path.join(folder, posixpath.basename(path) or "recording")
        with opened(path) as source, open(copy, "wb") as target:
            shutil.copyfileobj(source, target, 1 << 20)
        yield copy


class Folder:
    """A folder of a data set. Files in it are whole or absent, and written over at once."""

    def __init__(self, path: str) -> None:
        self.path = path if is_remote(path) else os.path.abspath(path)

    def _of(self, name: str) -> str:
        return posixpath.join(self.path, name) if is_remote(self.path) else os.path.join(self.path, name)

    def make(self) -> None:
        """Make it where it is not there, and take away what a killed run left half written."""
        if is_remote(self.path):
            by_fsspec = _fsspec(self.path)
            if by_fsspec is not None:
                by_fsspec[0].makedirs(by_fsspec[1], exist_ok=True)
            return
        os.makedirs(self.path, exist_ok=True)
        for path in Path(self.path).glob(TEMPORARY + "*"):
            path.unlink(missing_ok=True)

    def names(self) -> list[str]:
        """Names of the files in it, sorted."""
        if not is_remote(self.path):
            return sorted(os.listdir(self.path)) if os.path.isdir(self.path) else []
        by_fsspec = _fsspec(self.path)
        if by_fsspec is not None:
            system, inside = by_fsspec
            listed = system.ls(inside, detail=False) if system.isdir(inside) else []
            return sorted(posixpath.basename(one.rstrip("/")) for one in listed)
        from pyarrow.fs import FileSelector

        system, inside = _pyarrow(self.path)
        return sorted(one.base_name for one in system.get_file_info(FileSelector(inside, allow_not_found=True)))

    def read(self, name: str) -> bytes | None:
        """The bytes of one of its files; ``None`` where there is none."""
        try:
            with opened(self._of(name)) as stream:
                return stream.read()
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write one of its files. On object storage that is one upload, which is whole or absent of itself."""
        if not is_remote(self.path):
            part, target = self._of(f"{TEMPORARY}{name}.{os.getpid()}"), self._of(name)
            with open(part, "wb") as stream:
                stream.write(content)
            os.replace(part, target)
            return
        by_fsspec = _fsspec(self._of(name))
        if by_fsspec is not None:
            by_fsspec[0].pipe_file(by_fsspec[1], content)
            return
        system, inside = _pyarrow(self._of(name))
        with system.open_output_stream(inside) as stream:
            stream.write(content)
