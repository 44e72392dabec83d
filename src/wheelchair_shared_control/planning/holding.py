"""Noticing that commands are not carried out, and the way back from there.

Between planner and wheels stands the guard, with margins of its own and readings that the costmap does not hold yet.
What it does not let pass would be commanded for ever: the planner sees no obstacle in its way. A little way back the
chair has room to come again, squarer.
"""
import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.planning.clearance import SEEN, known_at

PATIENCE = 1.5  # s beyond dead time and lag
MOVED, TURNED = 0.03, 0.05  # m, rad: more than this is a motion
BACK, LEAST_BACK, STEP = 0.5, 0.12, 0.06  # m: how far back, if there is so much room; how far at least
CLOSER = 0.003  # m: so much closer than it stands the chair may come on its way back


class Hold:
    """Says when the chair stands although it is told to move."""

    def __init__(self, plant):
        self._patience = PATIENCE + plant.dead_time + plant.lag
        self.forget()

    def forget(self):
        """Begin anew."""
        self._pose, self._since = None, None

    def update(self, now, pose, moving):
        """Whether the chair at ``pose`` (3,) has stood too long, now that it is told to move or (``moving``) not."""
        stood = self._pose is not None and (
            np.hypot(*(pose[:2] - self._pose[:2])) <= MOVED
            and abs(se2.wrap_angle(pose[2] - self._pose[2])) <= TURNED)
        if not stood or not moving:
            self._pose, self._since = np.array(pose, dtype=float), now
            return False
        return now - self._since > self._patience


def way_back(field, planner, pose):
    """Steps (n, 2) straight back from ``pose`` (3,), over ground that was seen, or None where there is no room."""
    footprint = planner.footprint
    n = int(round(BACK / STEP))
    behind = np.array(pose) - STEP * np.arange(n + 1)[:, None] * [np.cos(pose[2]), np.sin(pose[2]), 0.0]
    clear = planner.clearance(field, behind)
    least = min(clear[0] - CLOSER, planner.settings.min_clearance)
    count = 0
    for k in range(1, n + 1):
        edge = [se2.compose(behind[k], np.array([footprint.rear, side * footprint.half_width, 0.0]))
                for side in (-1.0, 0.0, 1.0)]
        if clear[k] < least or any(known_at(field.known, field.frame, x, y) != SEEN for x, y, _ in edge):
            break
        count = k
    if count * STEP < LEAST_BACK:
        return None
    return np.tile([-STEP, 0.0], (count, 1))
