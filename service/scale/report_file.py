"""Check that a report may be written to its place, before the work."""

from __future__ import annotations

from pathlib import Path

from ..errors import InvalidParameter


def check_report_file(report: Path) -> None:
    """Raise InvalidParameter where no file can be written under this name."""
    if not report.parent.is_dir():
        raise InvalidParameter("report", f"{report.parent}: there is no such folder")
    if report.is_dir():
        raise InvalidParameter("report", f"{report}: it is a folder")
