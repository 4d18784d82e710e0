"""The product: HTTP service, command line, glTF reader and writer."""
