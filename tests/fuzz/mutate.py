"""Break a file: bits and lengths anywhere, values inside its JSON, its compressed data alone."""

import json
import struct

from service.bodies.media import FORMATS, GLB, GLTF

NUMBERS = [-1, 0, 1, 2, 3, 4, 5, 7, 12, 100, 252, 5121, 5126, 65535, 2**31, 2**32 - 1, 2**53, 2**70]
VALUES = [*NUMBERS, 0.5, -1e308, None, True, "", "POSITION", "data:,", "../x", [], [0], {}]

WORDS = [
    *(b"0", b"-1", b"3", b"255", b"99999999999", b"9" * 25, b"9" * 5000, b"1e39", b"1e400"),
    *(b"nan", b"-inf", b"1e-320", b"0x10", b"1_0", b"\xff\xfe", b"\xe9t\xe9", b"\0", b"", b"#"),
    *(b"f", b"v", b"solid", b"endsolid", b"vertex", b"element", b"list", b"\n", b"//", b"1/1/1"),
]


def mutated(seed, rng):
    """One malformed body (now and then one that is still right)."""
    ways = [_flipped, _overwritten, _cut, _doubled]
    if seed.content_type in (GLB, GLTF):
        # The JSON is where a reader can be lied to without the decoder noticing.
        ways += [_edited] * 6
    if seed.content_type == GLB:
        ways += [_binary_only] * 3
    if seed.content_type in FORMATS.keys() - {GLB, GLTF}:
        ways += [_reworded] * 4
    return rng.choice(ways)(seed.body, rng)


def _flipped(body, rng):
    data = bytearray(body)
    for _ in range(rng.choice([1, 1, 2, 8, 64])):
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    return bytes(data)


def _overwritten(body, rng):
    data = bytearray(body)
    number = rng.choice([0, 1, 2**31 - 1, 2**32 - 1, rng.getrandbits(32)])
    byte = rng.randrange(max(1, len(data) - 4))
    data[byte : byte + 4] = struct.pack("<I", number)
    return bytes(data)


def _cut(body, rng):
    return body[: rng.randrange(len(body))]


def _doubled(body, rng):
    start = rng.randrange(len(body))
    end = min(len(body), start + rng.choice([1, 4, 64, 1024]))
    byte = rng.randrange(len(body))
    return body[:byte] + body[start:end] + body[byte:]


def _reworded(body, rng):
    """Replace words of a text, or of a binary file's head."""
    head, rest = (body, b"") if body.isascii() else (body[:400], body[400:])
    words = head.split(b" ")
    for _ in range(rng.choice([1, 1, 2, 4])):
        words[rng.randrange(len(words))] = rng.choice(WORDS)
    return b" ".join(words) + rest


def _binary_only(body, rng):
    """Break the BIN chunk, where compressed data lie, and leave the JSON whole."""
    start = 20 + struct.unpack_from("<I", body, 12)[0] + 8
    if start >= len(body):
        return _flipped(body, rng)
    data = bytearray(body)
    for _ in range(rng.choice([1, 1, 2, 4, 16])):
        # Headers are at the start, and say how much is to come.
        reach = rng.choice([16, 64, len(data) - start])
        data[start + rng.randrange(min(reach, len(data) - start))] = rng.randrange(256)
    return bytes(data)


def _edited(body, rng):
    binary = body[:4] == b"glTF"
    end = 20 + struct.unpack_from("<I", body, 12)[0] if binary else len(body)
    tree = json.loads(body[20:end] if binary else body)
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        places = list(_places(tree))
        if not places:
            break
        holder, key = rng.choice(places)
        if rng.random() < 0.2:
            del holder[key]
        elif isinstance(holder[key], int) and rng.random() < 0.5:
            holder[key] += rng.choice([-1, 1, 4, 2**20, 2**32])
        else:
            holder[key] = rng.choice(VALUES)
    text = json.dumps(tree).encode()
    if not binary:
        return text
    text += b" " * (-len(text) % 4)
    rest = body[end:]
    header = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return header + struct.pack("<I4s", len(text), b"JSON") + text + rest


def _places(value):
    """Every (container, key) of a JSON tree; long strings are left alone."""
    keys = list(value) if isinstance(value, dict) else range(len(value))
    for key in keys:
        if not (isinstance(value[key], str) and len(value[key]) > 1000):
            yield value, key
        if isinstance(value[key], dict | list):
            yield from _places(value[key])
