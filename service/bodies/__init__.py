"""Bodies of requests: media types, parts, archives, and the files beside a document."""
