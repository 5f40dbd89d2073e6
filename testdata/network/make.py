"""Adjusts a small network by dense least squares and writes it in the form of gama-local's XML.

Two targets T1 and T2 stand between the fixed points A and B. Three vectors are observed: A to T1, T1 to T2 and
B to T2, with the covariances C, 4 C and C. x points north and y east.
"""

import numpy as np

A, B = np.array([100.0, 500.0, 10.0]), np.array([108.0, 506.0, 14.0])
C = np.array([[1.0, 0.3, 0.0], [0.3, 4.0, -0.2], [0.0, -0.2, 0.25]])  # mm^2
A_T1, T1_T2, B_T2 = [3.001, 2.0, 1.0], [2.0, 1.998, 1.0005], [-3.0, -2.0, -2.0]

one, none = np.eye(3), np.zeros((3, 3))
design = np.block([[one, none], [-one, one], [none, one]])
observed = np.concatenate([A + A_T1, T1_T2, B + B_T2])
weight = np.linalg.inv(np.kron(np.diag([1.0, 4.0, 1.0]), C))
covariance = np.linalg.inv(design.T @ weight @ design)
adjusted = covariance @ design.T @ weight @ observed

# An orientation comes after the coordinates; its covariances are of no use to a reader of coordinates.
full = np.block([[covariance, np.full((6, 1), 0.01)], [np.full((1, 6), 0.01), np.eye(1)]])
full = full.round(12) + 0.0
rows = ["".join(f"<flt>{v:.7e}</flt> " for v in full[i, i:]).rstrip() for i in range(7)]
point = "   <point> <id>{}</id> <{}>{:.6f}</{}> <{}>{:.6f}</{}> <{}>{:.6f}</{}> </point>"


def line(name, place, axes):
    return point.format(name, *(v for axis, value in zip(axes, place) for v in (axis, value, axis)))


lines = [
    '<?xml version="1.0"?>',
    '<gama-local-adjustment xmlns="http://www.gnu.org/software/gama/gama-local-adjustment">',
    "<description>Two targets between two pillars; written by make.py</description>",
    '<network-general-parameters gama-local-version="2.0" axes-xy="ne" angles="left-handed"/>',
    "<coordinates>",
    "<fixed>",
    line("A", A, "xyz"),
    line("B", B, "xyz"),
    "</fixed>",
    "<adjusted>",
    line("T1", adjusted[:3], "xyz"),
    line("T2", adjusted[3:], "XYZ"),
    "</adjusted>",
    "<orientation-shifts>",
    "   <orientation> <id>A</id> <approx>10.100000</approx> <adj>10.100100</adj> </orientation>",
    "</orientation-shifts>",
    "<cov-mat>",
    "<dim>7</dim> <band>6</band>",
    *rows,
    "</cov-mat>",
    "</coordinates>",
    "</gama-local-adjustment>",
]
print("\n".join(lines))
