"""Meshes of other libraries, refined with what they carry; none of these is imported here."""
