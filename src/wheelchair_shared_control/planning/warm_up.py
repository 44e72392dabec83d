"""Compile, or load from the cache, every kernel of costmap and navigation before the first message is taken."""
import numpy as np

from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control.costmap import Costmap
from wheelchair_shared_control.planning import planners
from wheelchair_shared_control.values import RANGERS, Odometry, Ranges, Twist


def warm_up(settings):
    """Look at a wall with every source of ``settings`` (group ``move_base``), and drive towards it for a moment."""
    pose, now = np.zeros(3), 1.0
    costmap, navigator = Costmap(settings.local_costmap, settings.wheelchair), planners.make(settings)
    costmap.move_to(pose)
    camera = cameras.from_settings(settings.wheelchair)
    odom_from_camera = cameras.mounting(settings.wheelchair)
    for name in settings.local_costmap.observation_sources.split():
        source = getattr(settings.local_costmap, name)
        kind = source.data_type
        if kind == "Image":
            image = np.full((camera.height, camera.width), 2.0, np.float32)
            image.setflags(write=False)  # as an image that came as a message: another form of the kernels
            costmap.insert_depth(image, camera, odom_from_camera, now, source=name)
        elif kind == "PointCloud2":
            y, z = np.meshgrid(np.linspace(-1.0, 1.0, 50), np.linspace(0.1, 1.2, 20))
            points = np.stack((np.full(y.size, 2.0), y.ravel(), z.ravel()), axis=1)
            costmap.insert_points(points, (0.25, 0.0, 1.1), now, source=name)
        elif kind == "LaserScan":
            angles = np.linspace(-1.0, 1.0, 50)
            height = 0.5 * (source.min_obstacle_height + source.max_obstacle_height)
            costmap.insert_scan(2.0 / np.cos(angles), angles, 5.0, pose, height, now, source=name)
        else:
            costmap.insert_ranges(Ranges(now, np.full(len(RANGERS), 0.6)), pose, source=name)
    for _ in range(2):
        snapshot = costmap.update(pose, now)
    drive(navigator, free_ground(snapshot), now)


def free_ground(snapshot):
    """The snapshot with every obstacle gone and every cell known: a path is sure to be found on it."""
    return snapshot._replace(
        cost=np.zeros_like(snapshot.cost), distance=np.full_like(snapshot.distance, snapshot.distance.max()),
        known=np.ones_like(snapshot.known),
    )


def drive(navigator, snapshot, now):
    """Search, refine and follow: ahead past a bend, with and without a person who pushes, and backwards."""
    for goal, user in (((1.5, 0.6, 0.5), None), ((1.5, 0.3, 0.0), Twist(0.2, 0.0)), ((-0.8, 0.1, 0.0), None)):
        navigator.set_goal(goal, now)
        for k in range(30):
            pose = np.array([0.01 * k, 0.0, 0.02])
            odometry = Odometry(now, pose, Twist(0.2, 0.1))
            navigator.update(now, odometry, snapshot._replace(stamp=now), user=user, candidates=k == 0)
            now += 0.05
