"""Numbers of glTF 2.0: components (§3.6.2.2), modes (§3.7.2.1), targets (§5.11.5), GLB (§4.4)."""

from __future__ import annotations

import numpy as np

BYTE, UNSIGNED_BYTE, SHORT, UNSIGNED_SHORT = 5120, 5121, 5122, 5123
UNSIGNED_INT, FLOAT = 5125, 5126
# The component types of indices.
UNSIGNED_INTEGERS = (UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT)
COMPONENT_TYPES = {
    BYTE: np.dtype("<i1"),
    UNSIGNED_BYTE: np.dtype("<u1"),
    SHORT: np.dtype("<i2"),
    UNSIGNED_SHORT: np.dtype("<u2"),
    UNSIGNED_INT: np.dtype("<u4"),
    FLOAT: np.dtype("<f4"),
}
COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COLUMNS = {"MAT2": 2, "MAT3": 3, "MAT4": 4}

TRIANGLES, STRIP, FAN = 4, 5, 6
SURFACES = (TRIANGLES, STRIP, FAN)

# Says which successive triangles are one polygon: those that begin with one vertex.
NGONS = "FB_ngon_encoding"

# Pairs of vertices, between which viewers draw lines.
OUTLINE = "CESIUM_primitive_outline"

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963

# The magic word of a GLB is bodies.media.GLB_MAGIC.
GLB_VERSION = 2
JSON_CHUNK, BIN_CHUNK = b"JSON", b"BIN\0"

# EXT_structural_metadata has the widest numbers in buffers, of 8 bytes. BIN and joined buffers
# begin at multiples of that.
WIDEST = 8
