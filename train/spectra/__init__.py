"""Spectra of schemes at stars: subdivision matrices, tangent eigenvalues, the Reif gap."""
