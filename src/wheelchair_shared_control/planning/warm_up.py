"""Compile, or load from the cache, every kernel of costmap and navigation before the first message is taken."""
import math

import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control.costmap import Costmap
from wheelchair_shared_control.planning.navigation import Navigator
from wheelchair_shared_control.values import RANGERS, Odometry, Ranges, Twist


def warm_up(settings):
    """Look at a wall with every source of ``settings`` (group ``move_base``), and drive towards it for a moment."""
    pose, now = np.zeros(3), 1.0
    costmap, navigator = Costmap(settings.local_costmap, settings.wheelchair), Navigator(settings)
    costmap.move_to(pose)
    camera = cameras.from_settings(settings.wheelchair)
    odom_from_camera = cameras.mounting(settings.wheelchair)
    for name in settings.local_costmap.observation_sources.split():
        kind = getattr(settings.local_costmap, name).data_type
        if kind == "Image":
            image = np.full((camera.height, camera.width), 2.0, np.float32)
            costmap.insert_depth(image, camera, odom_from_camera, now, source=name)
        elif kind == "PointCloud2":
            y, z = np.meshgrid(np.linspace(-1.0, 1.0, 50), np.linspace(0.1, 1.2, 20))
            points = np.stack((np.full(y.size, 2.0), y.ravel(), z.ravel()), axis=1)
            costmap.insert_points(points, (0.25, 0.0, 1.1), now, source=name)
        elif kind == "LaserScan":
            angles = np.linspace(-1.0, 1.0, 50)
            costmap.insert_scan(2.0 / np.cos(angles), angles, 5.0, pose, 0.3, now, source=name)
        else:
            costmap.insert_ranges(Ranges(now, np.full(len(RANGERS), 0.6)), pose, source=name)
    navigator.set_goal((1.0, 0.3, 0.5), now)
    for _ in range(6):
        snapshot = costmap.update(pose, now)._replace(stamp=now)
        navigator.update(now, Odometry(now, pose, Twist(0.1, 0.0)), snapshot, candidates=True)
        now += 0.05
    navigator.set_goal((math.sqrt(8.0), 0.1, 0.0), now)
    navigator.update(now, Odometry(now, pose, Twist(0.0, 0.0)), snapshot, user_v=0.2)
