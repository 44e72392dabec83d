"""The assistance's states: the person asks, a doorway is latched, the chair is handed back.

MANUAL -> DETECTING (button) -> ASSISTING (doorway and room behind it) -> ARRIVED, or back to MANUAL (nothing
found, no room, cancelled), or FAULT (planner, prediction). What ends it: ``Assistance._assisting``.
"""
from typing import NamedTuple, Optional, Tuple

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.assistance_goal import NO_ROOM, choose, free_goal
from wheelchair_shared_control.footprint import from_settings
from wheelchair_shared_control.grid import Grid
from wheelchair_shared_control.values import Doorway, Odometry, Twist

MANUAL, DETECTING, ASSISTING, ARRIVED, FAULT = range(5)
STATE_NAMES = ("MANUAL", "DETECTING", "ASSISTING", "ARRIVED", "FAULT")


class AssistanceInputs(NamedTuple):
    """What one cycle knows; everything in odom.

    ``press`` and ``cancel`` are levels (the button is down): edges are found here. ``doorways`` is the newest
    answer of detector or tracker, None before the first. ``navigator_status`` is "idle", "pending" (sent, not
    accepted), "active", "succeeded" or "aborted" for the last goal sent. ``fault`` is a reason from elsewhere:
    the blender's, when planner or prediction have become stale.
    """

    odometry: Optional[Odometry]
    press: bool = False
    cancel: bool = False
    user: Optional[Twist] = None
    doorways: Optional[Tuple[Doorway, ...]] = None
    detector_reason: str = ""
    navigator_status: str = "idle"
    navigator_reason: str = ""
    grid: Optional[Grid] = None
    fault: str = ""


class AssistanceOutput(NamedTuple):
    """State and what is to be done: a ``goal`` (3,) to send, a goal to cancel, a question to the detector."""

    state: int
    reason: str
    doorway: Optional[Doorway]
    goal: Optional[np.ndarray]
    cancel_goal: bool
    detect: bool
    refused: bool


class Assistance:
    """Memory of the assistance: ``update`` once a cycle, ``reset`` to begin anew.

    ``settings`` are those of the group ``doorway_assistant``.
    """

    def __init__(self, settings):
        self.settings = settings
        self.chair = from_settings(settings.wheelchair)
        self.reset()

    def reset(self):
        """MANUAL, nothing latched, no button down."""
        self.state, self.reason, self.refused = MANUAL, "", False
        self.doorway, self.goal = None, None
        self._since = self._asked = self._goal_sent = -np.inf
        self._press_was = self._cancel_was = False
        self._seen, self._no_room, self._why = -np.inf, 0, ""
        self._back_since = self._off_since = None
        self._centred, self._old_fault = False, ""

    def update(self, now, inputs):
        """One cycle at ``now`` [s]: ``AssistanceOutput``."""
        pressed = inputs.press and not self._press_was
        cancelled = inputs.cancel and not self._cancel_was
        self._press_was, self._cancel_was = bool(inputs.press), bool(inputs.cancel)
        if now < self._since:  # time went back (a bag, a reset of the simulator)
            self._since = self._asked = self._goal_sent = self._seen = now
            self._back_since = self._off_since = None
        actions = {"goal": None, "cancel_goal": False, "detect": False}
        if self.state in (DETECTING, ASSISTING) and (pressed or cancelled):
            self._to_manual(now, "cancelled by the button", actions)
        elif pressed:
            self._enter(DETECTING, now, "looking for a doorway")
            self.doorway, self.goal, self._asked = None, None, -np.inf
            self._seen, self._no_room, self._why = now - self.settings.detection.age, 0, ""
        if self.state == DETECTING:
            self._detecting(now, inputs, actions)
        elif self.state == ASSISTING:
            self._assisting(now, inputs, actions)
        elif self.state == ARRIVED:
            self._arrived(now, inputs)
        elif self.state == FAULT:
            self._fault(now, inputs)
        return AssistanceOutput(self.state, self.reason, self.doorway, refused=self.refused, **actions)

    # ---- one state each ----------------------------------------------------------------------------

    def _detecting(self, now, inputs, actions):
        limits = self.settings.detection
        why = inputs.detector_reason or self._why or "no doorway in view"
        if not self._odometry_fresh(now, inputs):
            why = "no fresh odometry"
        elif inputs.doorways is not None:
            fresh = [
                doorway for doorway in inputs.doorways
                if doorway.stamp >= self._since - limits.age and self._seen_by_now(now, doorway)
            ]
            ahead = max((doorway.stamp - now for doorway in inputs.doorways), default=0.0)
            if ahead > self.settings.odometry_age:
                why = self._why = "the doorways are stamped %.1f s in the future" % ahead
            new = [doorway for doorway in fresh if doorway.stamp > self._seen]
            if new:
                self._seen = max(doorway.stamp for doorway in new)
                choice = choose(fresh, inputs.odometry.pose, inputs.user, self.settings, self.chair)
                why = self._why = choice.reason  # said again where no newer look comes in time
                if choice.doorway is not None:
                    goal = free_goal(choice.doorway.pose, inputs.grid, self.chair, self.settings)
                    if goal is not None:
                        self._accept(now, choice.doorway, goal, inputs, actions)
                        return
                    self._no_room += 1
            if self._no_room:
                why = NO_ROOM
        if self._no_room >= limits.no_room_tries or now - self._since >= limits.duration:
            self._to_manual(now, "refused: " + why, actions, refused=True)
            actions["cancel_goal"] = False  # none was sent
        elif now - self._asked >= limits.period:
            self._asked = now
            actions["detect"] = True

    def _accept(self, now, doorway, goal, inputs, actions):
        self._enter(ASSISTING, now, "assisting through a doorway of %.2f m" % doorway.width)
        self.doorway, self.goal, self._goal_sent = doorway, goal, now
        self._back_since = self._off_since = None
        self._old_fault = inputs.fault
        actions["goal"] = goal

    def _assisting(self, now, inputs, actions):
        if inputs.fault != self._old_fault:  # one that was there before is of the last assistance
            self._old_fault = ""
        if inputs.fault and inputs.fault != self._old_fault:
            self._to_fault(now, inputs.fault, actions)
        elif inputs.navigator_status == "pending" and now - self._goal_sent > self.settings.server_wait:
            self._to_fault(now, "planner: goal not accepted within %.1f s" % self.settings.server_wait, actions)
        elif inputs.navigator_status == "aborted":
            self._to_fault(now, "planner: " + (inputs.navigator_reason or "goal aborted"), actions)
        elif inputs.navigator_status == "succeeded" and now > self._goal_sent:
            self._enter(ARRIVED, now, "arrived behind the doorway")
        elif self._odometry_fresh(now, inputs):  # without odometry the blender stops; it recovers by itself
            pose = inputs.odometry.pose
            if self._pulled_back(now, inputs.user):
                self._to_manual(now, "cancelled: stick pulled back", actions)
            elif self._turned_away(now, pose):
                self._to_manual(now, "cancelled: the chair turned away from the door", actions)
            elif self._beyond_goal(pose):
                self._enter(ARRIVED, now, "arrived behind the doorway")
                actions["cancel_goal"] = True
            else:
                self._refine(now, inputs, actions)

    def _arrived(self, now, inputs):
        if self._odometry_fresh(now, inputs):
            if np.hypot(*(inputs.odometry.pose[:2] - self.goal[:2])) > self.settings.arrival.leave:
                self._enter(MANUAL, now, "")

    def _fault(self, now, inputs):
        limits = self.settings.fault
        if inputs.user is None or not np.isfinite(inputs.user).all():
            return
        at_rest = max(abs(inputs.user.v), abs(inputs.user.w)) < limits.stick_at_rest
        if at_rest:
            self._centred = True
        elif self._centred and now - self._since >= limits.hold:
            self._enter(MANUAL, now, "")

    # ---- what ends the assistance ------------------------------------------------------------------

    def _pulled_back(self, now, user):
        limits = self.settings.cancel
        if user is None or not user.v <= -limits.stick_back:
            self._back_since = None
            return False
        self._back_since = now if self._back_since is None else self._back_since
        return now - self._back_since >= limits.stick_time

    def _turned_away(self, now, pose):
        limits = self.settings.cancel
        if abs(float(se2.wrap_angle(pose[2] - self.doorway.pose[2]))) <= limits.heading:
            self._off_since = None
            return False
        self._off_since = now if self._off_since is None else self._off_since
        return now - self._off_since >= limits.heading_time

    def _beyond_goal(self, pose):
        """Whether ``base_link`` has passed the goal's line, wherever the stick has led it beside the goal."""
        door_from_goal = se2.compose(se2.inverse(self.doorway.pose), self.goal)
        door_from_base = se2.compose(se2.inverse(self.doorway.pose), pose)
        return bool(door_from_base[0] >= door_from_goal[0])

    # ---- the latched doorway -----------------------------------------------------------------------

    def _refine(self, now, inputs, actions):
        """Move the latched doorway towards what is seen of it; send the goal again where it has moved."""
        limits = self.settings.refine
        door_from_base = se2.compose(se2.inverse(self.doorway.pose), inputs.odometry.pose)
        if door_from_base[0] + self.chair.front > -limits.until:
            return
        seen = self._same_doorway(now, inputs)
        if seen is not None:
            self._seen = seen.stamp
            step = seen.pose - self.doorway.pose
            step[2] = se2.wrap_angle(step[2])
            pose = self.doorway.pose + limits.gain * step
            pose[2] = se2.wrap_angle(pose[2])
            jambs = self.doorway.jambs + limits.gain * (seen.jambs - self.doorway.jambs)
            self.doorway = seen._replace(pose=pose, jambs=jambs)
        if now - self._goal_sent < limits.goal_period:
            return
        goal = free_goal(self.doorway.pose, inputs.grid, self.chair, self.settings)
        if goal is None:
            return  # somebody may stand there for a moment: the planner waits, then gives up with its reason
        shift = float(np.hypot(*(goal[:2] - self.goal[:2])))
        turn = abs(float(se2.wrap_angle(goal[2] - self.goal[2])))
        if shift > limits.goal_shift or turn > limits.goal_turn:
            self.goal, self._goal_sent = goal, now
            actions["goal"] = goal

    def _seen_by_now(self, now, doorway):
        """Whether its stamp can be: one from the future would make every later look an older one."""
        return doorway.stamp <= now + self.settings.odometry_age

    def _same_doorway(self, now, inputs):
        """The newer observation of the latched doorway, None where there is none."""
        limits = self.settings.refine
        best, nearest = None, limits.distance
        for doorway in inputs.doorways or ():
            if not (doorway.stamp > self._seen and self._seen_by_now(now, doorway)):
                continue
            # The normal points as the latched one does, also where the chair stands oblique to the plane.
            turned = abs(float(se2.wrap_angle(doorway.pose[2] - self.doorway.pose[2]))) > np.pi / 2.0
            if turned:
                pose = np.array([doorway.pose[0], doorway.pose[1], se2.wrap_angle(doorway.pose[2] + np.pi)])
                doorway = doorway._replace(pose=pose, jambs=doorway.jambs[::-1])
            apart = float(np.hypot(*(doorway.pose[:2] - self.doorway.pose[:2])))
            off = abs(float(se2.wrap_angle(doorway.pose[2] - self.doorway.pose[2])))
            if apart < nearest and off < limits.angle:
                best, nearest = doorway, apart
        return best

    # ---- changes of state --------------------------------------------------------------------------

    def _enter(self, state, now, reason):
        self.state, self.reason, self.refused = state, reason, False
        self._since, self._centred = now, False

    def _to_manual(self, now, reason, actions, refused=False):
        self._enter(MANUAL, now, reason)
        self.refused = refused
        self.doorway, self.goal = None, None
        actions.update(goal=None, cancel_goal=True, detect=False)

    def _to_fault(self, now, reason, actions):
        self._enter(FAULT, now, reason)
        self.doorway, self.goal = None, None
        actions.update(goal=None, cancel_goal=True, detect=False)

    def _odometry_fresh(self, now, inputs):
        odometry = inputs.odometry
        return (
            odometry is not None
            and abs(now - odometry.stamp) <= self.settings.odometry_age
            and bool(np.isfinite(odometry.pose).all())
        )
