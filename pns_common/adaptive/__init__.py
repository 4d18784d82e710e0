"""Adaptive refinement: faces only where the surface bends.

parts.py        pieces of the refined levels, with the rings that masks need
certificate.py  bounds of the distance between faces and the limit surface
turning.py      angles by which shading turns over faces
tree.py         which faces are split, and how neighbours of two levels meet
refine.py       the refinement: ``refine`` with a goal
"""
