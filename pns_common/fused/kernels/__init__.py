"""Kernels over index ranges: each call writes rows begin … end − 1 and reads anything."""
