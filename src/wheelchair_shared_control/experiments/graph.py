"""The graph of the nodes by plain calls: the same functions at the same rates, no ROS.

A message is an assignment, a topic an attribute. Equal seeds give bit-identical runs.
"""
import functools
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import blending, parameters, users
from wheelchair_shared_control import camera as cameras
from wheelchair_shared_control.assistance import ASSISTING, FAULT, Assistance, AssistanceInputs
from wheelchair_shared_control.costmap import Costmap, to_grid
from wheelchair_shared_control.planning import planners
from wheelchair_shared_control.shared_control import Inputs, SharedControl
from wheelchair_shared_control.simulation import true_doorway
from wheelchair_shared_control.simulation.scenes import USER_STREAM, stream
from wheelchair_shared_control.task_model import TaskModel

TICK = 1.0 / 60.0  # s: the least common step of the rates below
CAMERA_EVERY = 6  # ticks: 10 Hz, and with it the costmap
CONTROL_EVERY = 3  # ticks: 20 Hz: user, rangers, planner, assistance
TIMER_AFTER = 2  # ticks: the blender answers the user at once, and again 1/30 s later by its timer
REFINE_EVERY = 30  # ticks: 2 Hz, the detector while a doorway is latched

DENSITY_LEVEL = 0.05  # quantile of the training set below which an input counts as not demonstrated
DETECTOR_SEED = 0
NEVER = 3.14  # rad off the door, hardly to be reached


class GraphSettings(NamedTuple):
    """Checked settings of every node of the graph."""

    simulator: parameters.Settings
    navigation: parameters.Settings
    detector: parameters.Settings
    assistant: parameters.Settings
    blender: parameters.Settings
    users: parameters.Settings



# keys of GraphSettings in the order of its fields
GROUPS = ("simulator", "move_base", "doorway_detector", "doorway_assistant", "blender", "users")


# A doorway that is told (`--detector truth`) need not lie in the camera's view.
TOLD = {"choice/bearing": np.pi, "choice/incidence": np.pi, "choice/distance": 10.0}


def settings_for(options):
    """Settings of all nodes; ``options.dead_time``, ``.lag`` set the plant, and what planner and guard know."""
    changed = {
        "wheelchair/actuation/dead_time": options.dead_time, "wheelchair/actuation/lag": options.lag,
        "sigma_scale": options.sigma_scale, "odometry/factor": options.drift,
    }
    changed = {key: value for key, value in changed.items() if value is not None}
    if not options.detector:
        changed.update(TOLD)
    return _settings(tuple(sorted(changed.items())))


@functools.lru_cache(maxsize=16)
def _settings(changed):
    """Settings with ``changed`` ((key, value), ...); the same for all episodes of a comparison, so kept."""
    changed, result = dict(changed), []
    for group in GROUPS:
        settings = parameters.load(group)
        known = settings.as_dict()
        changes = {key: value for key, value in changed.items() if key in known}
        result.append(settings.replace(**changes) if changes else settings)
    return GraphSettings(*result)


def model_name(options):
    """The task model that an episode asks: the option's, or the policy's own."""
    if options.model is not None:
        return options.model
    return "full" if options.policy == "learned_confidence" else "paper"


class Detector:
    """The detector's node: doorways of one image, followed over several in odom."""

    def __init__(self, camera, base_from_camera, settings):
        # open3d takes a second to import, and an episode with the true doorway does without
        from wheelchair_shared_control import doorway, doorway_tracker

        self._detect = doorway.detect_depth
        self._in_frame = doorway_tracker.in_frame
        self._tracker = doorway_tracker.DoorwayTracker(settings)
        self._camera, self._base_from_camera, self._settings = camera, base_from_camera, settings

    def look(self, depth, odom_pose):
        """Tracked doorways in odom, and the reason where this image shows none."""
        found = self._detect(
            depth.image, self._camera, self._base_from_camera, self._settings, seed=DETECTOR_SEED, stamp=depth.stamp
        )
        seen = [self._in_frame(odom_pose, doorway) for doorway in found.doorways]
        return tuple(self._tracker.update(seen, odom_pose, depth.stamp)), found.reason


class Graph:
    """All nodes about one simulator; ``tick`` is one step of ``TICK`` seconds.

    ``options`` are an episode's ``Options``, ``setup`` its world, door and start. After a tick that the blender
    took part in, ``state`` is its newest ``State`` and ``fresh`` is set.
    """

    def __init__(self, options, setup, seed, settings=None, simulator=None):
        self.options, self.settings = options, settings or settings_for(options)
        s = self.settings
        self.simulator = simulator
        self.door = setup.door
        wheelchair = s.navigation.wheelchair
        width, height = options.camera
        self._camera = cameras.scaled(cameras.from_settings(wheelchair), width, height)
        self._base_from_camera = cameras.mounting(wheelchair)
        self._costmap = Costmap(s.navigation.local_costmap, wheelchair)
        self._navigator = planners.make(s.navigation, options.planner)
        self._detector = Detector(self._camera, self._base_from_camera, s.detector) if options.detector else None
        self._blender = SharedControl(s.blender, options.policy, options.guard)
        self._model = None
        if options.model is not None or blending.needs_prediction(options.policy):
            self._model = TaskModel.load(model_name(options))
            self._blender.density_floor = self._model.density_quantiles[DENSITY_LEVEL]
        # under policy `planner` the stick is logged, but no user takes part: neither planner nor assistance hears it
        self._planner_alone = options.policy == "planner"
        # Where no person takes part, nobody turns away from the door: the planner turns round where it is narrow.
        self._assistance = Assistance(
            s.assistant.replace(**{"cancel/heading": NEVER}) if self._planner_alone else s.assistant)
        self._user = users.make(
            options.user, s.users, setup.door.pose, stream(seed, USER_STREAM), setup.world,
            button=users.FACE_FIRST if options.detector else users.AT_ONCE,
        )
        self._tick = 0
        self._depth = self._snapshot = self._grid = self._ranges = None
        self._odometry = simulator.odometry()
        self._doorways, self._detector_reason = None, ""
        self._pressed, self._user_command, self._user_stamp = False, None, -np.inf
        self._decision, self._planner_stamp, self._planner = None, -np.inf, None
        self._goal, self._grid_received = None, -np.inf
        self.assistance = self._assistance.update(simulator.time, AssistanceInputs(self._odometry))
        self.refusal = ""
        self.state, self.fresh = None, False

    @property
    def snapshot(self):
        """The newest costmap."""
        return self._snapshot

    @property
    def depth(self):
        """The newest depth image."""
        return self._depth

    @property
    def ranges(self):
        """The newest readings of the rangers."""
        return self._ranges

    @property
    def odometry(self):
        """The odometry of this tick."""
        return self._odometry

    @property
    def doorways(self):
        """The newest doorways in odom, None before the detector was asked."""
        return self._doorways

    @property
    def decision(self):
        """The navigator's newest decision."""
        return self._decision

    def override_user(self, command):
        """Let ``command`` stand for the simulated user's from now on; it is heard under every policy."""
        self._user, self._user_command, self._pressed = None, command, False
        self._planner_alone = False

    def tick(self):
        """Advance simulation and graph by one step."""
        now = self.simulator.time
        self._odometry = self.simulator.odometry()
        if self._tick % CAMERA_EVERY == 0:
            self._look(now)
        control = self._tick % CONTROL_EVERY == 0
        if control:
            self._sense_sides(now)
            self._user_acts(now)
            self._assist(now)
            self._plan(now)
        self.fresh = control or self._tick % CONTROL_EVERY == TIMER_AFTER
        if self.fresh:
            self._blend(now)
        self._tick += 1
        self.simulator.advance(TICK)

    # ---- one node each ---------------------------------------------------------------------------------

    def _look(self, now):
        self._depth = self.simulator.depth()
        pose = self._odometry.pose
        self._costmap.move_to(pose)
        odom_from_camera = cameras.lifted(pose) @ self._base_from_camera
        self._costmap.insert_depth(self._depth.image, self._camera, odom_from_camera, self._depth.stamp)
        self._snapshot = self._costmap.update(pose, now)
        self._grid, self._grid_received = to_grid(self._snapshot), now
        if self.assistance.state == ASSISTING and self._tick % REFINE_EVERY == 0 and self.options.detector:
            self._detect(now)

    def _sense_sides(self, now):
        self._ranges = self.simulator.ranges()
        self._costmap.insert_ranges(self._ranges, self._odometry.pose)

    def _user_acts(self, now):
        if self._user is not None:
            action = self._user.update(now, self.simulator.truth(), self.assistance.state)
            self._user_command, self._pressed = action
        self._user_stamp = now

    def _assist(self, now):
        status, reason = ("idle", "") if self._decision is None else (self._decision.status, self._decision.reason)
        self.assistance = self._assistance.update(
            now,
            AssistanceInputs(
                self._odometry, press=self._pressed,
                user=None if self._planner_alone else self._user_command, doorways=self._doorways,
                detector_reason=self._detector_reason, navigator_status=status, navigator_reason=reason,
                grid=self._grid, fault="" if self.state is None else self.state.fault,
            ),
        )
        out = self.assistance
        if out.goal is not None:
            self._navigator.set_goal(out.goal, now)
            self._goal = out.goal
        elif out.cancel_goal:
            self._navigator.cancel(now)
        if out.detect:
            self._detect(now)
        self.refusal = out.reason if out.refused or out.state == FAULT else ""

    def _detect(self, now):
        """Doorways in the newest image, or the true one, in odom."""
        if self._detector is not None:
            self._doorways, self._detector_reason = self._detector.look(self._depth, self._odometry.pose)
        else:
            truth = self.simulator.truth().pose
            self._doorways = (true_doorway.in_odom(self.door, truth, self._odometry.pose, now),)

    def _plan(self, now):
        user = None if self._planner_alone else self._user_command
        self._decision = self._navigator.update(now, self._odometry, self._snapshot, user)
        if self._decision.recovery:
            self._costmap.clear_outside(self.settings.navigation.recovery_radius)
        if self._decision.command is not None:
            self._planner, self._planner_stamp = self._decision.command, now

    def _blend(self, now):
        inputs = Inputs(
            now, user=self._user_command, user_stamp=self._user_stamp, planner=self._planner,
            planner_stamp=self._planner_stamp, odometry=self._odometry, grid=self._grid,
            grid_received=self._grid_received, ranges=self._ranges, assistance=self.assistance.state,
            doorway=self.assistance.doorway, doorways=self._doorways or (), goal=self._goal,
        )
        query = self._blender.query(inputs)
        prediction = None if query is None or self._model is None else self._model.predict(*query)
        self.state = self._blender.update(inputs, prediction)
        if self.state.sent is not None:
            self.simulator.command(*self.state.sent)
