"""Fit connections under the limit on open files, so that accepting never fails."""

from __future__ import annotations

import logging

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


def fitting(settings: Settings) -> int:
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
