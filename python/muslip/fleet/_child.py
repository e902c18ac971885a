"""A process that works on one recording at a time, and can be ended: what hangs, aborts or is killed costs one row and no job.

It is given many at once and answers with whatever is ready every few milliseconds: to hand over one small recording at a time
costs as much as to estimate it.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import pickle
import queue
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import IO, Any

_HEAD = struct.Struct("<Q")

_ANSWER_S = 0.02
"""How long results wait for more of them, before they are sent together."""


class TooLong(Exception):
    """The work took longer than it may."""


class Died(Exception):
    """The process of the work ended without an answer: on the first item without a result, or on one soon after."""


def _send(stream: IO[bytes], value: object) -> None:
    content = pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)
    stream.write(_HEAD.pack(len(content)) + content)
    stream.flush()


def _receive(stream: IO[bytes]) -> Any:
    head = stream.read(_HEAD.size)
    if len(head) < _HEAD.size:
        raise EOFError
    (length,) = _HEAD.unpack(head)
    content = stream.read(length)
    if len(content) < length:
        raise EOFError
    return pickle.loads(content)


class Ended(Exception):
    """Nobody waits for its work any more."""


class Child:
    """A process of its own, started anew and not forked: the threads of an engine do not survive a fork.

    Parameters
    ----------
    folder : str, optional
        Where it works, so that relative paths mean the same; where that folder is on this machine.
    """

    def __init__(self, folder: str | None = None) -> None:
        self._folder = folder if folder is not None and os.path.isdir(folder) else None
        self._process: subprocess.Popen[bytes] | None = None
        self._answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._is_over = False

    def _start(self) -> subprocess.Popen[bytes]:
        if self._is_over:
            raise Ended
        # One thread a child: the cores are shared by children.
        environment = {**os.environ, "RAYON_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
        process = subprocess.Popen(
            [sys.executable, "-c", "from muslip.fleet._child import serve; serve()"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=self._folder, env=environment,
        )  # fmt: skip
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def listen(stream: IO[bytes]) -> None:
            try:
                while True:
                    answers.put((True, _receive(stream)))
            except Exception:
                answers.put((False, None))

        assert process.stdout is not None
        threading.Thread(target=listen, args=(process.stdout,), name="muslip-fleet", daemon=True).start()
        self._process, self._answers = process, answers
        is_ready, _ = answers.get()
        if not is_ready:
            self.close()
            raise RuntimeError(f"{sys.executable} cannot import muslip.fleet: its words are on standard error")
        return process

    @property
    def pid(self) -> int | None:
        """Of its process, while there is one."""
        return None if self._process is None else self._process.pid

    def ready(self) -> None:
        """Start its process where there is none."""
        if self._process is None:
            self._start()

    def call(self, function: Callable[..., Any], *arguments: object, timeout_s: float | None = None) -> Any:
        """What a function answers there; its process is started where there is none.

        Raises
        ------
        TooLong
            It took longer than ``timeout_s``; its process is ended.
        Died
            Its process ended.
        """
        (answer,) = self.each(function, [arguments], timeout_s=timeout_s)
        return answer

    def each(
        self, function: Callable[..., Any], items: Sequence[tuple[object, ...]], *common: object, timeout_s: float | None = None
    ) -> Iterator[Any]:
        """What a function answers there for one item after the other, as soon as it is known; ``common`` follows on each.

        Raises
        ------
        TooLong
            The first item without a result took longer than ``timeout_s``; its process is ended.
        Died
            Its process ended.
        """
        process = self._process or self._start()
        assert process.stdin is not None
        answered = 0
        try:
            _send(process.stdin, (function, items, common))
            while answered < len(items):
                # Results wait for each other, and for their turn.
                wait_s = None if timeout_s is None else timeout_s + 4.0 * _ANSWER_S
                is_answer, results = self._answers.get(timeout=wait_s)
                if not is_answer:
                    raise self._died(process)
                answered += len(results)
                yield from results
        except queue.Empty:
            raise TooLong from None
        except OSError:
            raise self._died(process) from None
        finally:
            if answered < len(items):
                # Whatever it is at, nobody waits for it.
                self.close()

    def _died(self, process: subprocess.Popen[bytes]) -> Died:
        code = process.wait()
        self.close()
        return Died(f"signal {-code}" if code < 0 else f"status {code}")

    def end(self) -> None:
        """End it for good: whoever is at work with it is to end as well."""
        self._is_over = True
        self.close()

    def close(self) -> None:
        """End its process; the next work starts another."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()


_mine = threading.local()


def mine(folder: str | None) -> Child:
    """The child of this thread of this process, kept for the next recording."""
    if getattr(_mine, "of", None) != (os.getpid(), folder):
        # A forked process has its parent's child, which is not for it to end.
        _mine.of, _mine.child = (os.getpid(), folder), Child(folder)
        atexit.register(_mine.child.close)
    child: Child = _mine.child
    return child


def serve() -> None:
    """Work until nobody asks any more."""
    requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # Whatever prints is not to print between the answers.
    os.dup2(2, 1)
    waiting: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                waiting.put(_receive(requests))
        except EOFError:
            # Who asked is gone; so is the sense of whatever is being worked on.
            os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    # So that no recording is charged with the start.
    _send(answers, None)
    told = _Told(answers)
    while True:
        function, items, common = waiting.get()
        for item in items:
            told.add(function(*item, *common))
        told.now()


class _Told:
    """Results on their way to who asked, several together."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._lock = threading.Condition()
        self._ready: list[Any] = []
        self._since_s = 0.0
        # The next item may take its time, and computes without Python's lock.
        threading.Thread(target=self._watch, daemon=True).start()

    def add(self, result: Any) -> None:
        with self._lock:
            self._ready.append(result)
            if len(self._ready) == 1:
                self._since_s = time.monotonic()
                self._lock.notify()
            elif time.monotonic() - self._since_s > _ANSWER_S:
                self._send()

    def now(self) -> None:
        with self._lock:
            self._send()

    def _send(self) -> None:
        if self._ready:
            ready, self._ready = self._ready, []
            _send(self._stream, ready)

    def _watch(self) -> None:
        while True:
            with self._lock:
                self._lock.wait_for(lambda: self._ready)
            time.sleep(_ANSWER_S)
            with self._lock:
                if time.monotonic() - self._since_s > _ANSWER_S:
                    self._send()
