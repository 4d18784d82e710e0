"""Model files in numpy alone: read, checked and evaluated where onnxruntime is not installed."""

from pns_common.runtimes.numpy_network.network import NumpyNetwork, open_network

__all__ = ["NumpyNetwork", "open_network"]
