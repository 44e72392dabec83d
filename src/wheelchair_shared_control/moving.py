"""Obstacles that move: cells of the costmap grouped into blobs, and the velocity of each blob.

What an unmoved obstacle shows changes as the chair drives: cells are added where more of it comes into view. Only
a blob whose leading and trailing edge both went the same way has moved, by the smaller of the two.
"""
import numpy as np

NOTHING = np.empty((0, 2))


class MovingCells:
    """Follows blobs of lethal cells from grid to grid; ``settings`` are those of the guard."""

    def __init__(self, settings):
        self._settings = settings
        self.reset()

    def reset(self):
        """Forget all grids."""
        self.points, self.velocities, self.stamp = NOTHING, NOTHING, 0.0

    def update(self, grid, pose):
        """Take a grid; a grid taken before is passed over."""
