"""The true doorway in place of the detector's (``--detector truth``)."""
import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.values import Doorway

COVARIANCE = np.diag([1e-6, 1e-6, 1e-6])


def in_odom(door, truth_world, pose_odom, stamp):
    """``Doorway`` in odom of a ``Door`` in the world: where odometry, drifted as it is, believes it to be.

    ``truth_world``, ``pose_odom`` (3,): the same moment's pose of ``base_link`` in world and odom.
    """
    odom_from_world = se2.compose(pose_odom, se2.inverse(truth_world))
    pose = se2.compose(odom_from_world, door.pose)
    half = 0.5 * door.width
    jambs = se2.transform_points(pose, np.array([[0.0, half], [0.0, -half]]))
    return Doorway(pose, door.width, 1.0, jambs, COVARIANCE, stamp)
