"""Fit the bytes of results on their disk, so that keeping old ones never fails new ones."""

from __future__ import annotations

import logging
import os
import shutil
from pathlib import Path
from tempfile import gettempdir

from ..settings import Settings, StartError

log = logging.getLogger("pns.service")

# Of what is free at the start: results that are made, and those that are struck out while somebody
# takes them, lie there beside those that are kept.
KEPT_SHARE = 0.75


def result_folder(settings: Settings) -> Path:
    """Return where results are kept."""
    return settings.result_folder or Path(gettempdir())


def fitting(settings: Settings) -> Settings:
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
