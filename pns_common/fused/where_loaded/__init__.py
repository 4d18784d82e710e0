"""What others ask for by itself: by kernels where they are loaded, else by arrays."""
