"""Fit settings to this machine: connections to its open files, results to their disk.

So accepting never fails, and keeping old results never fails new ones.
"""

from __future__ import annotations

import logging
import os
import shutil
from pathlib import Path
from tempfile import gettempdir

from ..settings import Settings, StartError

log = logging.getLogger("pns.service")

# A worker takes pipes and a sentinel; the rest are libraries, models, logs and listening sockets.
OF_WORKER = 16
OF_PROCESS = 128
# The body, the answer, the report and the page of a job, and the page's map. Whoever is connected
# may hold them: while it uploads, and then until its job is measured and stands in line.
OF_REQUEST = 5
# What is kept of one that is done: its answer and its report.
OF_RESULT = 2
# Connections beyond those, until the idle ones have ended.
BEYOND = 128
# Of what is free at the start: results that are made, and those that are struck out while somebody
# takes them, lie there beside those that are kept.
KEPT_SHARE = 0.75


def connections_that_fit(settings: Settings) -> int:
    """Return `settings.connections`, or what descriptors are there for; raises the limit first.

    Raises:
        StartError: there are not descriptors enough for a single connection.
    """
    try:
        import resource
    except ImportError:  # Windows has no such limit.
        return settings.connections
    # Short jobs have a worker and slots of their own.
    requests = settings.slots + settings.queue + 1
    reserved = OF_PROCESS + OF_WORKER * (settings.workers + 1) + OF_REQUEST * requests
    reserved += OF_RESULT * settings.results + BEYOND
    of_connection = 1 + OF_REQUEST
    wanted = reserved + of_connection * settings.connections
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        soft = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    if soft == resource.RLIM_INFINITY or soft >= wanted:
        return settings.connections
    fit = (soft - reserved) // of_connection
    if fit < 1:
        raise StartError(
            f"{soft} open files are allowed and {reserved + of_connection} needed: raise the limit "
            "(ulimit -n), or lower PNS_QUEUE, PNS_WORKERS or PNS_RESULTS"
        )
    log.warning(
        "%d open files allow %d connections at most, in place of the %d of PNS_CONNECTIONS",
        soft,
        fit,
        settings.connections,
    )
    return fit


def result_folder(settings: Settings) -> Path:
    """Return where results are kept."""
    return settings.result_folder or Path(gettempdir())


def with_results_that_fit(settings: Settings) -> Settings:
    """Return the settings, with as many bytes of results as there is room for.

    With more the disk would be full before the oldest result had to go, and every job would fail
    until its time is over. Where nothing can be said of a disk, its jobs will say it. Raises
    StartError where there is no such folder, or none that may be written to.
    """
    try:
        folder = result_folder(settings)
    except OSError as error:
        raise StartError(f"results can be kept nowhere: {error.strerror}") from error
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise StartError(f"results: {folder} is no folder that may be written to")
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return settings
    fit = max(1, int(free * KEPT_SHARE))
    if fit >= settings.result_bytes:
        return settings
    log.warning(
        "%d bytes are free in %s: results may take %d, in place of the %d of PNS_RESULT_BYTES",
        free,
        folder,
        fit,
        settings.result_bytes,
    )
    return settings.model_copy(update={"result_bytes": type(settings.result_bytes)(fit)})
