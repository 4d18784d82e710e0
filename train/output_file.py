"""Files that commands write at their end: tried before they begin, since minutes lie between."""

import tempfile
from pathlib import Path

from pns_common import ParameterError


def prepare_output(path: Path) -> None:
    """Make the folder of a file that is to be written.

    Raises:
        ParameterError: no file can be written there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        expected = f"a file in a folder that can be written ({error.strerror})"
        raise ParameterError("output", str(path), expected=expected) from error
