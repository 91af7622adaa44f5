"""Runs scenes x parameters x motions x seeds by Dask (torquer-batch, or python3 -m torquer.batch).

    torquer.batch.run("study.toml", "results", workers=2)

Stored cases are not run again, and no kill loses them. Jobs that do not know each other work on
shares, and gather() then collects these. The README of the package describes the study file and
clusters.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import itertools
import json
import logging
import multiprocessing.spawn
import os
import pathlib
import sys
import threading
import time
from typing import Any, Callable, Dict, Iterator, List, Optional, TextIO

from . import Error, __build__, __version__
from . import _batch_case, _batch_report, _command
from ._batch_share import Share, read_share, slurm_share
from ._batch_store import Stopped, Store
from ._batch_study import Case, Study, cases, need, read_study

__all__ = ["Stopped", "Summary", "gather", "main", "run"]

# Cases submitted ahead of the workers: enough that no worker waits, few enough for the scheduler.
_AHEAD = 4
_LEAST_AHEAD = 64
# A scheduler that does not answer within this time counts as missing.
_SCHEDULER_S = 10.0
# A case that ends more workers than this has failed.
_MOST_DEATHS = 3


@dataclasses.dataclass(frozen=True)
class Summary:
    """Result of a run."""

    cases: int
    stored_before: int
    done: int
    failures: List[Dict[str, Any]]
    """Each has "case", its labels, and "message"."""
    seconds: float
    folder: str


class _Progress:
    """Progress: on a terminal one line that is overwritten, otherwise a line every ten seconds."""

    def __init__(self, out: Optional[TextIO], total: int) -> None:
        self._out = out
        self._total = total
        self._began = self._last = time.monotonic()
        self._terminal = out is not None and out.isatty()

    def show(self, done: int, failed: int, last: bool = False) -> None:
        now = time.monotonic()
        if self._out is None or (not last and now - self._last < (0.2 if self._terminal else 10)):
            return
        self._last = now
        text = f"{done + failed} of {self._total} cases"
        if failed:
            text += f", {failed} failed"
        if 0 < done + failed < self._total:
            left_s = (now - self._began) / (done + failed) * (self._total - done - failed)
            text += f", {_duration(left_s)} left"
        end = "\n" if last or not self._terminal else ""
        self._out.write(f"\r\033[K{text}{end}" if self._terminal else f"{text}{end}")
        self._out.flush()


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _work(case: Case, build: str) -> Any:
    if __build__ != build:
        raise Error(f"this worker has the build {__build__} of Torquer, but torquer-batch has {build}; install the same on all machines")
    return _batch_case.run(case)


class _WithoutMain:
    """While one is open, Dask's workers of this process do not import its main script.

    Cases do not need the script. Without a guard it would begin a batch in each worker, which
    multiprocessing ends and Dask restarts, without end.
    """

    _NAME = "Dask Worker process"
    _lock = threading.Lock()
    _open = 0
    _usual: Any = None

    def __enter__(self) -> "_WithoutMain":
        with self._lock:
            if _WithoutMain._open == 0:
                _WithoutMain._usual = multiprocessing.spawn.get_preparation_data
                multiprocessing.spawn.get_preparation_data = self._prepare
            _WithoutMain._open += 1
        return self

    def __exit__(self, *_: Any) -> None:
        with self._lock:
            _WithoutMain._open -= 1
            if _WithoutMain._open == 0:
                multiprocessing.spawn.get_preparation_data = _WithoutMain._usual

    @classmethod
    def _prepare(cls, name: str) -> Dict[str, Any]:
        data: Dict[str, Any] = cls._usual(name)
        if name.startswith(cls._NAME):
            data.pop("init_main_from_name", None)
            data.pop("init_main_from_path", None)
        return data


def _connect(workers: int, scheduler: Optional[str]) -> Any:
    """Client of Dask for threads or processes of this machine, or for a cluster."""
    distributed = need("distributed", "python3-distributed")
    dask = need("dask", "python3-distributed")
    dask.config.set(
        {
            "distributed.scheduler.allowed-failures": _MOST_DEATHS,
            "distributed.comm.timeouts.connect": f"{_SCHEDULER_S:g}s",
            "distributed.client.heartbeat": "2s",
            # Read when a worker process imports Dask.
            "distributed.nanny.pre-spawn-environ": {
                **dask.config.get("distributed.nanny.pre-spawn-environ", {}), "DASK_LOGGING__DISTRIBUTED": "critical",
            },
        }
    )
    if scheduler is not None:
        try:
            return distributed.Client(scheduler, timeout=_SCHEDULER_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise Error(f"--scheduler {scheduler}: {error}; give its address, as tcp://node1:8786") from None
    # Without an address Dask's pages are open to all machines.
    page = "127.0.0.1:0"
    local: Dict[str, Any] = {
        "dashboard_address": None, "scheduler_kwargs": {"dashboard_address": page}, "worker_dashboard_address": page,
    }
    if workers > 0:
        local.update(n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1")
    else:
        threads = len(os.sched_getaffinity(0))
        local.update(n_workers=1, threads_per_worker=threads, processes=False)
    cluster = distributed.LocalCluster(**local)
    client = distributed.Client(cluster, set_as_default=False)
    client.torquer_cluster = cluster  # closed with it
    return client


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Without Dask's log of this process: torquer-batch reports failures and losses itself."""
    log = logging.getLogger("distributed")
    usual = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(usual)


@contextlib.contextmanager
def _client(workers: int, scheduler: Optional[str]) -> Iterator[Any]:
    distributed = need("distributed", "python3-distributed")  # sets the level of its log
    need("zarr", "python3-zarr")  # with which the results are stored
    with _WithoutMain(), _quiet():
        client = _connect(workers, scheduler)
        try:
            yield client
        finally:
            # A close that takes too long loses nothing, and must hide no interrupt.
            for part in (client, getattr(client, "torquer_cluster", None)):
                with contextlib.suppress(OSError, TimeoutError, distributed.TimeoutError):
                    if part is not None:
                        part.close(timeout=5)


def _each_result(client: Any, waiting: Iterator[Case]) -> Iterator[tuple[Case, Any]]:
    """Yields cases as they end, with their result or exception."""
    distributed = need("distributed", "python3-distributed")
    running: Dict[str, Case] = {}
    ended = distributed.as_completed(loop=client.loop)
    broken = (OSError, TimeoutError, distributed.client.CancelledError)
    number = itertools.count()

    def submit(case: Case) -> None:
        # A new key each time, because a cluster may have stored results of another run.
        future = client.submit(_work, case, __build__, key=f"torquer-{case.key}-{os.getpid()}-{next(number)}", pure=False)
        running[future.key] = case
        ended.add(future)

    def fill() -> None:
        most = max(_LEAST_AHEAD, _AHEAD * sum(client.nthreads().values()))
        for case in itertools.islice(waiting, max(0, most - len(running))):
            submit(case)

    try:
        fill()
        while running:
            batch = ended.next_batch(block=False)
            if not batch:
                if client.status != "running":
                    raise _lost("it does not answer")
                time.sleep(0.005)
            for future in batch:
                case = running.pop(future.key)
                try:
                    raised = future.exception()
                    result = future.result() if raised is None else raised
                except broken as error:
                    # The case has ended, but so has the worker with its result.
                    if client.status != "running":
                        raise _lost(repr(error)) from None
                    submit(case)
                    continue
                yield case, result
                future.release()
            if batch:
                fill()
    except broken as error:
        raise _lost(repr(error)) from None


def _lost(why: str) -> Error:
    return Stopped(f"the scheduler is gone ({why}); the finished cases are stored; run the command again")


class _Work:
    """Cases of a study that a call is about."""

    def __init__(self, study: str) -> None:
        self.study: Study = read_study(study)
        self.cases: List[Case] = list(cases(self.study))
        self.keys: Dict[str, None] = dict.fromkeys(case.key for case in self.cases)
        self.identity = {"study": hashlib.sha256("".join(self.keys).encode()).hexdigest(), "build": __build__}

    @property
    def count(self) -> int:
        return len(self.keys)

    def keep_only(self, share: Share) -> None:
        self.keys = dict.fromkeys(share.of(list(self.keys)))
        self.cases = [case for case in self.cases if case.key in self.keys]

    def finish(self, store: Store, failures: List[Dict[str, Any]]) -> None:
        stored = store.readings
        rows = [{**case.labels, **_batch_report.marked(stored[case.key])} for case in self.cases if case.key in stored]
        store.finish(rows, failures, _batch_report.page(self.study, rows, failures))


def run(
    study: str,
    out: str,
    workers: int = 0,
    scheduler: Optional[str] = None,
    progress: Optional[TextIO] = None,
    on_case: Optional[Callable[[Case], None]] = None,
    share: Optional[str] = None,
) -> Summary:
    """Runs the cases of a study file that are not stored in the folder `out` yet.

    workers: processes on this machine; 0: threads of this process, one for each core.
    scheduler: address of Dask's scheduler, as "tcp://node1:8786"; replaces workers.
    progress: stream for a line about the progress.
    on_case: called after each case that was stored.
    share: "3/64" runs the third of 64 shares of the cases, and stores it in `out`/shares/3-of-64.

    Raises Error naming the file, the key, its value and the remedy. If the scheduler is lost or
    the disk is full, completed cases are stored.
    """
    part = None if share is None else read_share(share)
    work = _Work(study)
    began = time.monotonic()
    with Store(pathlib.Path(out), part.folder if part else "", work.identity if part else None) as store:
        if part:
            work.keep_only(part)
        left: Dict[str, Case] = {case.key: case for case in work.cases if not store.has(case.key)}
        done = 0
        failures: List[Dict[str, Any]] = []
        if left:
            line = _Progress(progress, len(left))
            with _client(workers, scheduler) as client:
                for case, result in _each_result(client, iter(left.values())):
                    if isinstance(result, Exception):
                        message = str(result) if isinstance(result, Error) else _unexpected(result)
                        failures.append({"case": case.labels, "message": message})
                    else:
                        store.keep(case, result)
                        done += 1
                        if on_case is not None:
                            on_case(case)
                    line.show(done, len(failures))
            line.show(done, len(failures), last=True)
        work.finish(store, failures)
        return Summary(work.count, work.count - len(left), done, failures, time.monotonic() - began, str(store.folder))


def gather(study: str, out: str) -> Summary:
    """Collects the results of all shares of a study from `out`/shares in the folder `out`.

    Missing cases are failures of the summary. Raises Error for a share of another study or build.
    """
    work = _Work(study)
    began = time.monotonic()
    with Store(pathlib.Path(out)) as store:
        before = sum(key in store.readings for key in work.keys)
        failed = store.gather(work.keys, work.identity)
        missing: List[Dict[str, Any]] = [
            {"case": case.labels, "message": failed.get(json.dumps(case.labels), "no share has stored it yet")}
            for case in work.cases
            if case.key not in store.readings
        ]
        work.finish(store, missing)
        done = sum(key in store.readings for key in work.keys) - before
        return Summary(work.count, before, done, missing, time.monotonic() - began, str(store.folder))


def _unexpected(error: Exception) -> str:
    if type(error).__name__ == "KilledWorker":
        return f"ended {_MOST_DEATHS + 1} workers, one after the other; check the log of their machine, for example for memory"
    return f"{type(error).__name__}: {error}"


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="torquer-batch",
        description="Runs every case of a study: scenes x parameters x motions x seeds. Stored cases are not run again.",
    )
    parser.add_argument("--version", action="version", version=f"torquer-batch {__version__}")
    parser.add_argument("study", metavar="STUDY", help="study file in TOML format")
    parser.add_argument("--out", metavar="FOLDER", help="output folder for the results (default: STUDY's name with -results)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers", metavar="N", type=int, default=0,
        help="number of processes on this machine (default: one process with a thread per core)",
    )
    where.add_argument("--gather", action="store_true", help="run nothing; collect the results of all shares from FOLDER/shares")
    where.add_argument("--scheduler", metavar="ADDRESS", help="address of a Dask scheduler, such as tcp://node1:8786")
    parser.add_argument(
        "--share", metavar="K/N",
        help="run share K of N of the cases, and store it in FOLDER/shares (default in a job array of Slurm: share of the task)",
    )
    parser.add_argument("--json", action="store_true", help="print one line of JSON at the end")
    parser.add_argument("--completion", choices=["bash"], action=_command.Completion, help="print a completion script for bash")
    arguments = parser.parse_args()
    out = arguments.out or f"{pathlib.Path(arguments.study).stem}-results"
    try:
        if not 0 <= arguments.workers <= 1024:
            raise Error(f"--workers {arguments.workers}: give 1 to 1024")
        if arguments.gather:
            if arguments.share:
                raise Error("--share and --gather exclude each other; gather when the shares have run")
            summary = gather(arguments.study, out)
        else:
            share = arguments.share or slurm_share(os.environ)
            summary = run(arguments.study, out, arguments.workers, arguments.scheduler, sys.stderr, share=share)
    except Error as error:
        print(f"torquer-batch: {error}", file=sys.stderr)
        return 1 if isinstance(error, Stopped) else 2
    except KeyboardInterrupt:
        print(f"\ntorquer-batch: stopped; the finished cases are stored in {out}; run the command again", file=sys.stderr)
        return 130
    if arguments.json:
        print(json.dumps(dataclasses.asdict(summary)))
    else:
        print(
            f"{summary.done} cases {'gathered' if arguments.gather else 'done'}, {summary.stored_before} were stored before, "
            f"{len(summary.failures)} {'missing' if arguments.gather else 'failed'}: "
            f"{summary.folder}/report.html"
        )
    for failure in summary.failures[:10]:
        print(f"{'missing' if arguments.gather else 'failed'}: {_batch_report.name(failure['case'])}: {failure['message']}", file=sys.stderr)
    if len(summary.failures) > 10:
        print(f"and {len(summary.failures) - 10} more: {summary.folder}/failures.jsonl", file=sys.stderr)
    return 1 if summary.failures else 0


def command() -> int:
    """The command torquer-batch: its exit status."""
    return _command.run("torquer-batch", main)


if __name__ == "__main__":
    sys.exit(command())
