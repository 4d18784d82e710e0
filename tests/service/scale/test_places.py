"""File systems elsewhere: what goes wrong there is told with the name of the file."""

import errno

import pytest
from fsspec.implementations.local import LocalFileSystem

from service.scale.places import Place, place_of


class ForeignError(Exception):
    """As the libraries of object stores raise them."""


class Broken:
    """A file system elsewhere that nobody can reach."""

    protocol = "far"

    def unstrip_protocol(self, path):
        return f"far://{path}"

    def __getattr__(self, name):
        def fails(*_, **__):
            raise ForeignError("no route")

        return fails


@pytest.mark.parametrize(
    "act",
    [
        Place.read,
        Place.is_file,
        Place.is_folder,
        Place.matches,
        lambda place: place.write(b""),
        lambda place: list(place.files(print)),
    ],
)
def test_an_error_of_a_library_names_its_file(act):
    with pytest.raises(OSError, match="ForeignError: no route") as refusal:
        act(Place(Broken(), "a/b.obj"))
    assert refusal.value.filename == "far://a/b.obj"


def test_an_error_of_this_machine_is_its_own(tmp_path):
    with pytest.raises(IsADirectoryError) as refusal:
        place_of(str(tmp_path)).read()
    assert refusal.value.errno == errno.EISDIR


def test_a_fault_on_this_machine_is_not_taken_for_a_far_one():
    class BrokenHere(LocalFileSystem):
        isfile = isdir = Broken().isfile

    for ask in (Place.is_file, Place.is_folder):
        with pytest.raises(ForeignError):
            ask(Place(BrokenHere(), "a/b.obj"))


def test_what_nobody_can_reach_is_not_taken_to_be_gone():
    assert not Place(Broken(), "a/b.obj").is_gone()
