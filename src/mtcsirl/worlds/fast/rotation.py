"""The one thing that Meta-World asks of scipy: the quaternion of a rotation matrix."""

import math

import numpy as np


class MatrixRotation:
    """Stands in for ``scipy.spatial.transform.Rotation`` where the matrix is known to be a rotation.

    scipy first checks that the matrix is orthogonal and repairs it if it is not; MuJoCo makes its matrices from unit
    quaternions, so that they are orthogonal to 1e-15, far inside scipy's tolerance of 1e-12.
    """

    def __init__(self, quaternion: np.ndarray) -> None:
        self._quaternion = quaternion

    @classmethod
    def from_matrix(cls, matrix: np.ndarray) -> "MatrixRotation":
        """Take a rotation matrix [3, 3]."""
        return cls(quaternion_of(matrix))

    def as_quat(self) -> np.ndarray:
        """Return the quaternion (x, y, z, w)."""
        return self._quaternion


def quaternion_of(matrix: np.ndarray) -> np.ndarray:
    """Return the unit quaternion [4] (x, y, z, w) of a rotation matrix [3, 3], in scipy's order of operations.

    Shepperd's method: of x^2, y^2, z^2 and w^2, written with the diagonal and the trace, the largest is the divisor.
    """
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    trace = a + e + i
    if trace > a and trace > e and trace > i:
        x, y, z, w = h - f, c - g, d - b, 1 + trace
    elif a >= e and a >= i:
        x, y, z, w = 1 - trace + 2 * a, d + b, g + c, h - f
    elif e >= i:
        x, y, z, w = b + d, 1 - trace + 2 * e, h + f, c - g
    else:
        x, y, z, w = c + g, f + h, 1 - trace + 2 * i, d - b
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    return np.array((x / norm, y / norm, z / norm, w / norm))
