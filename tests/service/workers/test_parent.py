"""Workers whose parent is killed: nobody is left to end them."""

import multiprocessing
import os
import select

import pytest

from tests.support import orphans


@pytest.mark.parametrize("start", [orphans.serve, orphans.refine_a_library])
def test_a_worker_ends_with_a_parent_that_is_killed_also_inside_a_job(start, tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    parent = multiprocessing.get_context("spawn").Process(target=start, args=(pipe,))
    parent.start()
    # Without waiting for a writer, whose process may have died.
    with os.fdopen(os.open(pipe, os.O_RDONLY | os.O_NONBLOCK), "rb", buffering=0) as told:
        assert select.select([told], [], [], 60)[0]
        assert told.read(5) == b"begun"
        parent.kill()
        parent.join()
        # Its end of the pipe is closed by nothing but its end.
        assert select.select([told], [], [], 30)[0]
        assert told.read(1) == b""
