"""glTF 2.0 in and out, by splicing: what is not geometry stays as it was."""
