"""What a request sends: media types, parts, archives, and the files beside a document."""
