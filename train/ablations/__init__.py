"""The operator with parts taken out, and feature sets with groups left out."""
