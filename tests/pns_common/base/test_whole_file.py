"""A file is written whole or not at all."""

import errno
import os
import resource
import signal
import subprocess
import sys

import pytest

from pns_common.base.whole_file import replace_file, replacing


def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path):
    path = tmp_path / "report.json"
    replace_file(path, b"first")
    replace_file(path, b"second")
    assert path.read_bytes() == b"second"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", ["a" * 251 + ".glb", "鋼" * 83 + ".glb"], ids=["letters", "kanji"])
def test_a_name_may_be_as_long_as_the_system_allows(tmp_path, name):
    replace_file(tmp_path / name, b"whole")
    assert (tmp_path / name).read_bytes() == b"whole"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_process_that_is_killed_leaves_nothing_of_what_it_was_writing(tmp_path):
    try:
        os.close(os.open(tmp_path, os.O_WRONLY | os.O_TMPFILE))
    except (AttributeError, OSError):
        pytest.skip("the system has no files without names here")
    code = (
        "import resource, signal; from pathlib import Path; "
        "from pns_common.base.whole_file import replace_file; "
        "signal.signal(signal.SIGXFSZ, signal.SIG_DFL); "
        "resource.setrlimit(resource.RLIMIT_CORE, (0, 0)); "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)); "
        f"replace_file(Path({str(tmp_path)!r}) / 'part.glb', bytes(10_000))"
    )
    ended = subprocess.run([sys.executable, "-c", code], check=False)
    assert ended.returncode == -signal.SIGXFSZ
    assert list(tmp_path.iterdir()) == []


def cannot(*_, **__):
    raise OSError(errno.EOPNOTSUPP, "not here")


@pytest.mark.parametrize(("name", "lacks"), [("O_TMPFILE", 0x40000000), ("link", cannot)])
def test_a_system_without_files_that_have_no_name_does_without(tmp_path, monkeypatch, name, lacks):
    monkeypatch.setattr(os, name, lacks, raising=False)
    replace_file(tmp_path / "part.glb", b"whole")
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [
        ("part.glb", b"whole")
    ]


def test_nobody_sees_a_file_before_it_is_whole(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.write_text("old")
    with replacing(path) as temporary, temporary.open("w") as rows:
        rows.write("new")
        rows.flush()
        assert path.read_text() == "old"
    assert path.read_text() == "new"


def test_where_writing_fails_the_old_file_stays_alone(tmp_path):
    path = tmp_path / "rows.jsonl"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), replacing(path) as temporary:
        temporary.write_text(str(1 / 0))
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_may_be_read_by_whom_any_other_may(tmp_path):
    (tmp_path / "plain").touch()
    replace_file(tmp_path / "replaced", b"")
    modes = {path.stat().st_mode for path in tmp_path.iterdir()}
    assert len(modes) == 1


def test_a_missing_folder_is_named_by_the_file_that_was_asked_for(tmp_path):
    path = tmp_path / "none" / "report.json"
    with pytest.raises(FileNotFoundError) as refusal:
        replace_file(path, b"")
    assert refusal.value.filename == str(path)


def test_where_a_file_cannot_be_put_it_is_named(tmp_path):
    """Not the temporary one, which nobody asked for."""
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError) as refusal:
        replace_file(tmp_path / "folder", b"")
    assert refusal.value.filename == str(tmp_path / "folder")
    assert str(refusal.value).endswith(f": {str(tmp_path / 'folder')!r}")


@pytest.mark.parametrize("write", [replace_file, lambda path, data: writes(path, data)])
def test_a_write_that_fails_names_the_file(tmp_path, write):
    path, before = tmp_path / "part.glb", resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError, match=r"part\.glb") as refusal:
            write(path, bytes(10_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert (refusal.value.errno, refusal.value.filename) == (errno.EFBIG, str(path))
    assert str(refusal.value).endswith(f": {str(path)!r}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [OSError("no mode RGBA"), FileNotFoundError(2, "none", "other")])
def test_an_error_of_its_own_words_or_of_another_file_is_told_as_it_is(tmp_path, error):
    before = str(error)
    with pytest.raises(OSError) as raised, replacing(tmp_path / "picture.jpg"):  # noqa: PT011
        raise error
    assert str(raised.value) == before


def writes(path, data):
    with replacing(path) as temporary:
        temporary.write_bytes(data)
