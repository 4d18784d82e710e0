"""Checkpoint to ONNX model file: the only package that imports train."""
