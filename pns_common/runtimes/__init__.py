"""What runs a model file: a program of our own, onnxruntime, or numpy."""
