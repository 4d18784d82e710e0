"""How many bytes of results fit on their disk, so that keeping old ones never fails new ones."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path
from tempfile import gettempdir

from ..settings import Settings

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
    until its time is over. Where nothing can be said of the folder, its jobs will say it.
    """
    folder = result_folder(settings)
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
