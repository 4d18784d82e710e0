"""Readers of the files that the command line wrote."""

import msgspec

from service.gltf.read.container import read_glb

# Of the example.
FACES = 1920


def tree_of(path):
    return msgspec.json.decode(read_glb(path.read_bytes()).text)


def tree_of_bytes(glb):
    return msgspec.json.decode(read_glb(glb).text)
