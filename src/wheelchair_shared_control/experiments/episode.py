"""One episode without ROS: from a start to its verdict, deterministic for a seed."""
import numpy as np

from wheelchair_shared_control import blending, se2
from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control.experiments import graph as graphs
from wheelchair_shared_control.experiments import metrics, results
from wheelchair_shared_control.experiments.recorder import Recorder
from wheelchair_shared_control.experiments.referee import Referee, Verdict
from wheelchair_shared_control.shared_control import CENTRE
from wheelchair_shared_control.simulation import doors, person, scenes
from wheelchair_shared_control.simulation.simulator import Simulator
from wheelchair_shared_control.simulation.world import SceneError
from wheelchair_shared_control.values import STOP, Twist

ESCAPE_TIME = 5.0  # s with the stick pushed the opposite way
FRONT_EDGE = 0.02  # m behind the front edge a touch still counts as one of the front
STICK_WINDOW = 1.0  # s over which the stick is averaged for that
CHOICE_STREAM = 11  # of chance: which door, which side, where the command line leaves it open


def description(options, seed):
    """The scene of an episode as the mapping that ``scenes.setup`` reads."""
    content = {"scene": options.scene, "door_width": options.door_width, "clutter": options.clutter}
    for key in ("start_distance", "start_heading", "start_offset"):
        if getattr(options, key) is not None:
            content[key] = list(getattr(options, key))
    if options.map is None:
        return content
    content.update(map=options.map, doors=options.doors)
    rng = scenes.stream(seed, CHOICE_STREAM)
    names = list(doors.read(options.doors))
    # both draws are made always, so that naming the door does not change the side
    door, side = int(rng.integers(len(names))), int(rng.integers(2))
    content["door"] = names[door] if options.door is None else options.door
    content["side"] = side if options.side is None else options.side
    return content


class Episode:
    """A run of the graph under the eyes of a referee; ``run`` gives the result, ``log`` the ticks.

    Raises SceneError where there is no door to cross.
    """

    def __init__(self, options, seed, settings=None):
        self.options, self.seed = options, int(seed)
        self.settings = settings or graphs.settings_for(options)
        wheelchair = self.settings.navigation.wheelchair
        self.footprint = footprints.from_settings(wheelchair)
        scene = description(options, seed)
        self.setup = scenes.setup(scene, seed, wheelchair)
        if self.setup.door is None:
            raise SceneError("%s: has no door to cross" % (options.map or options.scene))
        self.side = scene.get("side")
        self.log = None

    @property
    def world(self):
        """The ``World`` of the episode."""
        return self.setup.world

    @property
    def door(self):
        """The ``Door`` to cross."""
        return self.setup.door

    def run(self, watch=None):
        """Drive to the end; returns the result as a dictionary (see ``results.of_log``).

        ``watch(graph, simulator)`` is called after every tick of the blender.
        """
        if self.setup.start is None:
            return self._not_driven("no pose fits the rule for starts")
        walker = None
        if self.options.person:
            walker = self._person()
            if walker is None:
                return self._not_driven("no person fits across the chair's way")
        simulator = Simulator(
            self.world, self.settings.simulator, self.seed, self.setup.start, self.options.camera, walker
        )
        try:
            return self._drive(simulator, watch)
        finally:
            simulator.close()

    def _not_driven(self, reason):
        return results.not_driven(self.seed, Verdict("no_start", reason), self._extra(None, None))

    def _extra(self, front_touch_speed, escape):
        return {
            "front_touch_speed": front_touch_speed, "escape_m": escape, "door": self.door.name, "side": self.side,
            "door_width_m": float(self.door.width),
        }

    def _person(self):
        """Who walks across the undisturbed motion of this episode, or None."""
        alone = Episode(self.options._replace(person=False), self.seed, self.settings)
        alone.run()
        world_poses = se2.compose(self.door.pose, alone.log.truth)
        trajectory = np.column_stack((alone.log.time, world_poses))
        wheelchair = self.settings.navigation.wheelchair
        return person.draw(trajectory, self.world, wheelchair, scenes.stream(self.seed, scenes.PERSON_STREAM))

    def _drive(self, simulator, watch):
        graph = graphs.Graph(self.options, self.setup, self.seed, self.settings, simulator)
        referee = Referee(self.door.pose, self.footprint, blending.needs_planner(self.options.policy))
        recorder = Recorder(self.door.pose)
        verdict = None
        while verdict is None:
            # the chair's state when the command was made belongs to the command
            truth = simulator.truth()
            clearance = simulator.clearance()
            graph.tick()
            if graph.fresh:
                recorder.add(truth, graph.state, clearance)
                if watch is not None:
                    watch(graph, simulator)
            touched = [name for name, _ in simulator.contacts()]
            verdict = referee.update(
                simulator.time, simulator.truth().pose, touched, graph.assistance.state, graph.refusal
            )
        self.log = recorder.log()
        escape = self._escape(graph, simulator) if verdict.outcome == "standstill" else None
        extra = self._extra(front_touch_speed(simulator.touches, self.footprint), escape)
        return results.of_log(
            self.seed, verdict, self.log, self.settings.navigation.wheelchair, extra
        )

    def _escape(self, graph, simulator):
        """How far [m] the chair gets in 5 s with the stick pushed the opposite way.

        Through its middle, and once more where the chair asks for that after a fault, as a person would.
        """
        recent = self.log.user[self.log.time > self.log.time[-1] - STICK_WINDOW]
        recent = recent[np.isfinite(recent).all(axis=1)]
        if not len(recent):
            return 0.0
        poses, end = [simulator.truth().pose], simulator.time + ESCAPE_TIME
        opposite = Twist(*(-recent.mean(axis=0)))
        graph.override_user(STOP)
        while simulator.time < end:
            graph.tick()
            if len(poses) % graphs.CONTROL_EVERY == 0:
                graph.override_user(STOP if CENTRE in graph.state.reason else opposite)
            poses.append(simulator.truth().pose)
        return metrics.corner_path(self.footprint, poses)


def front_touch_speed(touches, footprint):
    """Fastest forward speed [m/s] of the chair at a touch of its front edge; None without one."""
    speeds = [touch.v for touch in touches if touch.place[0] >= footprint.front - FRONT_EDGE]
    return max(speeds) if speeds else None


def run(options, seed, settings=None):
    """Result of one episode."""
    return Episode(options, seed, settings).run()
