"""An episode as a bag that rviz shows: what the nodes would have published, by plain calls.

Play it with ``roslaunch wheelchair_shared_control bag.launch bag:=FILE``.
"""
import os
import tempfile
from pathlib import Path

import numpy as np

from wheelchair_shared_control import doorway_markers, markers, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.bag_writing import BagWriter
from wheelchair_shared_control.bags import BagError
from wheelchair_shared_control.costmap import to_grid
from wheelchair_shared_control.planning.navigation import ACTIVE
from wheelchair_shared_control.simulation import surfaces

OWN_TYPES = ("BlendState", "Doorway", "AssistanceState", "DoorwayArray")
WORLD_OPACITY = 0.35  # what the chair knows must stay visible through the walls
WORLD_REACH = 25.0  # m: of a large building the surroundings
ADD, DELETE, DELETE_ALL, TRIANGLE_LIST = 0, 2, 3, 11  # visualization_msgs/Marker
MARKER_PERIOD = 0.1  # s


class EpisodeBag:
    """Writes one episode, for ``with``: ``watch`` is what ``Episode.run`` calls after every tick of the blender.

    The file is there only once it is whole. Raises BagError where it cannot be written.
    """

    def __init__(self, path, episode):
        self._path, self._episode = Path(path), episode
        self._bag, self._temporary = None, None

    def __enter__(self):
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            handle, self._temporary = tempfile.mkstemp(
                dir=str(self._path.parent), prefix="." + self._path.name, suffix=".bag"
            )
            os.close(handle)
            os.unlink(self._temporary)  # the writer wants a name that is not taken
        except OSError as error:
            raise BagError("%s: cannot be written: %s" % (self._path, error.strerror))
        return self

    def watch(self, graph, simulator):
        """Note what is new since the last call."""
        if self._bag is None:
            self._bag = _Bag(self._temporary, self._episode, simulator.camera)
            self._bag.__enter__()
        self._bag.tick(graph, simulator)

    def __exit__(self, kind, *_):
        if self._bag is not None:
            self._bag.__exit__()
            if kind is None:
                os.replace(self._temporary, str(self._path))
            elif os.path.exists(self._temporary):
                os.unlink(self._temporary)


class _Bag(BagWriter):
    """The topics of the graph; a value that is the same as at the last tick is not written again."""

    latched = ("tf_static", "simulator/world", "assistance")

    def __init__(self, path, episode, lens):
        self._settings = episode.settings
        wheelchair = self._settings.navigation.wheelchair
        super().__init__(path, wheelchair, lens, OWN_TYPES)
        self._episode = episode
        self._footprint = footprints.from_settings(wheelchair)
        padding = self._settings.navigation.local_costmap.footprint_padding
        self._padded = footprints.grown(self._footprint, padding)
        self._before, self._last, self._next_markers, self._world_shown = {}, None, -np.inf, False

    def tick(self, graph, simulator):
        """One tick of the blender."""
        state, now = graph.state, graph.state.stamp
        self.odometry(now, graph.odometry)
        self._joints(now, simulator.joints(0.0 if self._last is None else now - self._last))
        self._last = now
        if not self._world_shown:
            self._world_shown = True
            self._world(now, graph.odometry.pose, simulator.truth().pose)
        if self._is_new("depth", graph.depth):
            self.depth(now, graph.depth.image)
        if self._is_new("ranges", graph.ranges):
            self.ranges(now, graph.ranges.values)
        if self._is_new("costmap", graph.snapshot):
            self._costmap(now, to_grid(graph.snapshot), graph.odometry.pose)
        if self._is_new("decision", graph.decision):
            self._plans(now, graph.decision)
        if self._is_new("doorways", graph.doorways):
            self._doorways(now, graph.doorways or ())
        said = graph.assistance.state, graph.assistance.reason
        if said != self._before.get("assistance"):
            self._before["assistance"] = said
            self._assistance(now, graph.assistance)
        self._state(now, state)
        for topic, command in (
            ("user/cmd_vel", state.user), ("planner/cmd_vel", state.planner), ("cmd_vel", state.sent)
        ):
            if command is not None:
                self.write(topic, now, self.twist(command))
        if now >= self._next_markers:
            self._next_markers = now + MARKER_PERIOD
            shown = [self._blend_marker(shape, now) for shape in markers.shapes(state, self._footprint)]
            self._markers("blender/markers", now, shown)

    def _is_new(self, name, value):
        before, self._before[name] = self._before.get(name), value
        return value is not None and value is not before

    # ---- topics ----------------------------------------------------------------------------------------

    def _joints(self, now, angles):
        nothing = np.zeros(0)
        position = np.array(list(angles.values()), float)
        header = self.header("joint_states", now, "")
        self.write("joint_states", now, self.type("sensor_msgs", "JointState")(
            header, list(angles), position, nothing, nothing))

    def _costmap(self, now, grid, pose):
        t = self.type
        # before every source has spoken, a grid has no time of observation
        stamp = grid.stamp if np.isfinite(grid.stamp) else now
        header = self.header("move_base/local_costmap/costmap", stamp, "odom")
        rows, columns = grid.cells.shape
        corner = t("geometry_msgs", "Point")(float(grid.origin[0]), float(grid.origin[1]), 0.0)
        upright = self.pose((0.0, 0.0, 0.0))[1]
        info = t("nav_msgs", "MapMetaData")(
            header.stamp, float(grid.resolution), columns, rows, t("geometry_msgs", "Pose")(corner, upright)
        )
        data = np.ascontiguousarray(grid.cells, dtype=np.int8).reshape(-1)
        self.write("move_base/local_costmap/costmap", now, t("nav_msgs", "OccupancyGrid")(header, info, data))
        topic = "move_base/local_costmap/footprint"
        corners = [t("geometry_msgs", "Point32")(x, y, 0.0) for x, y in footprints.corners(self._padded, pose).tolist()]
        outline = t("geometry_msgs", "PolygonStamped")(self.header(topic, now, "odom"), t("geometry_msgs", "Polygon")(
            corners))
        self.write(topic, now, outline)

    def _plans(self, now, decision):
        if decision.status != ACTIVE:
            return
        for topic, plan in (("global_plan", decision.global_plan), ("local_plan", decision.local_plan)):
            topic = "move_base/" + topic
            header = self.header(topic, now, "odom")
            poses = [
                self.type("geometry_msgs", "PoseStamped")(header, self.type("geometry_msgs", "Pose")(*self.pose(pose)))
                for pose in np.asarray(plan)
            ]
            self.write(topic, now, self.type("nav_msgs", "Path")(header, poses))

    def _doorways(self, now, doorways):
        header = self.header("doorway_detector/doorways", now, "odom")
        found = [self._doorway(header, doorway) for doorway in doorways]
        array = self.type("wheelchair_shared_control", "DoorwayArray")(header, found)
        self.write("doorway_detector/doorways", now, array)
        height = self._settings.detector.door.height
        shown = [self._marker("all", 0, 0, now, "odom", action=DELETE_ALL)]
        for number, doorway in enumerate(doorways):
            for shape in doorway_markers.shapes(doorway, height):
                shown.append(self._marker(
                    shape.name, number, shape.kind, now, "odom", shape.scale, shape.colour, shape.position, shape.yaw,
                    text=shape.text,
                ))
        self._markers("doorway_detector/markers", now, shown)

    def _doorway(self, header, doorway):
        t = self.type
        covariance = np.zeros((6, 6))
        covariance[np.ix_((0, 1, 5), (0, 1, 5))] = doorway.covariance
        pose = t("geometry_msgs", "Pose")(*self.pose(doorway.pose))
        jambs = [t("geometry_msgs", "Point")(x, y, 0.0) for x, y in np.asarray(doorway.jambs, float).tolist()]
        return t("wheelchair_shared_control", "Doorway")(
            header, t("geometry_msgs", "PoseWithCovariance")(pose, covariance.reshape(-1)), float(doorway.width),
            float(doorway.confidence), jambs,
        )

    def _assistance(self, now, output):
        t, header = self.type, self.header("assistance", now, "odom")
        if output.doorway is not None:
            doorway = self._doorway(header, output.doorway)
        else:
            nowhere = t("geometry_msgs", "PoseWithCovariance")(
                t("geometry_msgs", "Pose")(*self.pose((0.0, 0.0, 0.0))), np.zeros(36)
            )
            jambs = [t("geometry_msgs", "Point")(0.0, 0.0, 0.0) for _ in range(2)]
            doorway = t("wheelchair_shared_control", "Doorway")(header, nowhere, np.nan, 0.0, jambs)
        message = t("wheelchair_shared_control", "AssistanceState")(header, output.state, output.reason, doorway)
        self.write("assistance", now, message)

    def _state(self, now, state):
        absent = (np.nan, np.nan)
        commands = {
            name: self.twist(absent if getattr(state, name) is None else getattr(state, name))
            for name in ("user", "planner", "blended", "sent")
        }
        numbers = {
            name: float(getattr(state, name))
            for name in ("d_l", "d_f", "d_r", "v", "mean_l", "mean_r", "sigma_l", "sigma_r", "sigma", "log_density",
                         "clearance")
        }
        self.write("blender/state", now, self.type("wheelchair_shared_control", "BlendState")(
            header=self.header("blender/state", now, "odom"), beta=np.nan if state.beta is None else float(state.beta),
            guard=int(state.guard), policy=str(state.policy), reason=str(state.reason), **commands, **numbers,
        ))

    def _world(self, now, odom_pose, true_pose):
        """The world as it lies in odom at the start."""
        odom_from_world = se2.compose(odom_pose, se2.inverse(true_pose))
        shown = []
        for name, colour, triangles in surfaces.of_world(self._episode.world, true_pose[:2], WORLD_REACH):
            colours = np.column_stack((surfaces.shades(triangles, colour), np.full(len(triangles), WORLD_OPACITY)))
            shown.append(self._marker(
                name, 0, TRIANGLE_LIST, now, "odom", (1.0, 1.0, 1.0), (0.0, 0.0, 0.0, WORLD_OPACITY),
                (odom_from_world[0], odom_from_world[1], 0.0), odom_from_world[2],
                points=triangles.reshape(-1, 3), colours=colours,
            ))
        self._markers("simulator/world", now, shown)

    # ---- markers ---------------------------------------------------------------------------------------

    def _markers(self, topic, now, shown):
        self.write(topic, now, self.type("visualization_msgs", "MarkerArray")(shown))

    def _blend_marker(self, shape, now):
        several = len(shape.points) > 1
        at = shape.points[0] if len(shape.points) == 1 else (0.0, 0.0, 0.0)
        return self._marker(
            shape.name, 0, shape.kind, now, "odom" if shape.odom else "base_link", shape.scale, shape.colour, at,
            text=shape.text, points=shape.points if several else (), action=ADD if shape.points else DELETE,
        )

    def _marker(self, name, number, kind, now, frame, scale=(1.0, 1.0, 1.0), colour=(0.0, 0.0, 0.0, 1.0),
                at=(0.0, 0.0, 0.0), yaw=0.0, text="", points=(), colours=(), action=ADD):
        t = self.type
        point = t("geometry_msgs", "Point")
        shade = t("std_msgs", "ColorRGBA")
        pose = t("geometry_msgs", "Pose")(point(*(float(value) for value in at)), self.pose((0.0, 0.0, yaw))[1])
        return t("visualization_msgs", "Marker")(
            header=self.header("markers", now, frame), ns=name, id=number, type=kind, action=action, pose=pose,
            scale=self.vector(*scale), color=shade(*(float(value) for value in colour)),
            lifetime=t("builtin_interfaces", "Duration")(0, 0), frame_locked=False,
            points=[point(*row) for row in np.asarray(points, float).reshape(-1, 3).tolist()],
            colors=[shade(*row) for row in np.asarray(colours, float).reshape(-1, 4).tolist()],
            text=text, mesh_resource="", mesh_use_embedded_materials=False,
        )
