"""One mesh larger than memory: cut into parts, refined part by part, with the bits of the whole."""
