"""The loop of nodes/move_base with a clock that the test moves: what no rostest can do to a running graph."""
import importlib.machinery
import importlib.util

import numpy as np
import pytest

from wheelchair_shared_control import parameters

pytest.importorskip("move_base_msgs")
rospy = pytest.importorskip("rospy")


def load():
    """The node as a module."""
    path = str(parameters.package_file("nodes/move_base"))
    loader = importlib.machinery.SourceFileLoader("move_base_node", path)
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("move_base_node", loader))
    loader.exec_module(module)
    return module


class World:
    """Stands in for rospy, actionlib and tf: one goal, odometry and a free ranger at every cycle."""

    def __init__(self, node, monkeypatch, jumps):
        self.node, self.jumps, self.now, self.cycle = node, jumps, 1000.0, 0
        self.subscribers, self.speeds, self.logged = {}, [], []
        world = self

        class Publisher:
            def __init__(self, topic, kind, **options):
                self.topic = topic

            def publish(self, message):
                if self.topic == "cmd_vel":
                    world.speeds.append((world.cycle, message.linear.x))

            def get_num_connections(self):
                return 0

        class Server:
            def __init__(self, *_, **options):
                self.new = True

            def accept_new_goal(self):
                self.new = False
                goal = node.MoveBaseActionGoal().goal
                goal.target_pose.header.frame_id = "odom"
                goal.target_pose.pose.position.x = goal.target_pose.pose.orientation.w = 1.5
                return goal

            def is_new_goal_available(self):
                return self.new

            def is_active(self):
                return not self.new

            def is_preempt_requested(self):
                return False

            def publish_feedback(self, feedback):
                pass

            def start(self):
                pass

        class Buffer:
            def __init__(self, cache_time):
                pass

            def lookup_transform(self, *_):
                transform = node.tf2_ros.TransformStamped()
                transform.transform.rotation.w = 1.0
                return transform

            def clear(self):
                pass

        class Rate:
            def __init__(self, frequency):
                pass

            def sleep(self):
                world.sleep()

        fakes = dict(Publisher=Publisher, Subscriber=self.subscribe, Service=lambda *_: None, Rate=Rate,
                     get_time=lambda: self.now, is_shutdown=lambda: self.cycle >= 60, on_shutdown=lambda what: None,
                     get_name=lambda: "/move_base", logwarn=lambda text, *given: self.logged.append(text % given))
        for name, fake in fakes.items():
            monkeypatch.setattr(rospy, name, fake)
        monkeypatch.setattr(node.actionlib, "SimpleActionServer", Server)
        monkeypatch.setattr(node.tf2_ros, "Buffer", Buffer)
        monkeypatch.setattr(node.tf2_ros, "TransformListener", lambda buffer: None)

    def subscribe(self, topic, kind, callback, callback_args=None, **options):
        self.subscribers[topic] = (kind, callback, callback_args)

    def sleep(self):
        self.cycle += 1
        self.now += 0.05
        if self.cycle in self.jumps:
            self.now, raises = self.jumps[self.cycle]
            if raises:
                raise rospy.exceptions.ROSTimeMovedBackwardsException(1.0)
        self.send("odom")
        self.send("ir/left_front", range=np.inf, min_range=0.1, max_range=1.5)

    def send(self, topic, **fields):
        kind, callback, argument = self.subscribers[topic]
        message = kind(**fields)
        message.header.frame_id, message.header.stamp = "odom", rospy.Time.from_sec(self.now)
        if topic == "odom":
            message.pose.pose.orientation.w = 1.0
            callback(message)
        else:
            callback(message, argument)


def test_a_clock_that_is_put_right_by_a_little_changes_nothing(monkeypatch):
    node = load()
    world = World(node, monkeypatch, {30: (1001.40, False)})  # 0.05 s before the cycle before
    node.run(parameters.load("move_base").replace(**{"local_costmap/observation_sources": "rangers"}))
    speeds = dict(world.speeds)
    assert min(speed for cycle, speed in speeds.items() if 29 <= cycle < 45) > 0.1


@pytest.mark.parametrize("raises", [False, True], ids=["within a cycle", "while it sleeps"])
def test_a_clock_that_is_set_back_stops_the_chair_only_for_a_moment(monkeypatch, raises):
    node = load()
    world = World(node, monkeypatch, {30: (5.0, raises)})
    node.run(parameters.load("move_base").replace(**{"local_costmap/observation_sources": "rangers"}))
    speeds = dict(world.speeds)
    assert speeds[29] > 0.1
    assert speeds[31] == 0.0, "nothing is known yet"
    assert speeds[45] > 0.1
    assert not any("old" in text for text in world.logged)
