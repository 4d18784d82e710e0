"""The memory that there is: the machine's, or less where a container has less."""

import os
from pathlib import Path

import pytest

from pns_common.base import memory


@pytest.fixture
def memory_with(monkeypatch):
    """Return what is said of the memory of a container."""

    def asked(container):
        monkeypatch.setattr(memory, "CONTAINER", container)
        return memory.memory_here.__wrapped__()

    return asked


def test_it_is_the_machines_as_linux_lists_it(memory_with, tmp_path):
    listed = Path("/proc/meminfo")
    if not listed.exists():
        pytest.skip("it is not listed here")
    kibibytes = int(listed.read_text().split()[1])
    assert memory_with(tmp_path / "missing") == kibibytes * 1024


@pytest.mark.parametrize(("text", "less"), [("1048576\n", True), ("max\n", False)])
def test_a_container_may_have_less(memory_with, tmp_path, text, less):
    machine = memory_with(tmp_path / "missing")
    (tmp_path / "memory.max").write_text(text)
    assert memory_with(tmp_path / "memory.max") == (1048576 if less else machine)


def test_where_the_system_does_not_say_it_is_not_known(memory_with, tmp_path, monkeypatch):
    monkeypatch.delattr(os, "sysconf")
    assert memory_with(tmp_path / "missing") is None
