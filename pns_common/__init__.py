"""The operator: kernels over arrays, with no knowledge of torch, HTTP or glTF."""
