"""Navigation to a goal: the state machine of move_base without ROS, one call of ``update`` a control cycle.

It never drives on an old costmap, replans when the way is blocked, stops when no command is legal, asks for the
costmap to be cleared once, and gives up with the reason. Turning on the spot as a recovery is off: somebody sits on
the chair, perhaps in a doorway.
"""
from typing import NamedTuple, Optional

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.limiter import within_limits
from wheelchair_shared_control.planning import clearance
from wheelchair_shared_control.planning.commands import Candidates, Commands
from wheelchair_shared_control.planning.holding import Hold, way_back
from wheelchair_shared_control.planning.kept_path import KeptPath
from wheelchair_shared_control.planning.planner import Planner
from wheelchair_shared_control.values import STOP, Twist

IDLE, ACTIVE, SUCCEEDED, ABORTED = "idle", "active", "succeeded", "aborted"
PUSHING = 0.05  # m/s: above this a person drives forward; so far the other way the person pulls back
AT_REST = 0.02  # m/s, rad/s: less of both is a stick at rest, as the blender's stick/dead_zone_*
BACK_TIMES = 4  # how often for one goal
FAR_ENOUGH, FACING = 1.8, 0.10  # m, rad: when the chair looks towards its goal first
TURNING = 0.6  # rad/s: mean rate of a turn on the spot
EMPTY = np.zeros((0, 3))


class Decision(NamedTuple):
    """What one cycle decides.

    ``command``: Twist, or None for silence. ``status`` and ``reason`` stay after the end of a goal.
    ``global_plan`` (n, 3), ``local_plan`` (m, 3): poses in odom. ``recovery``: the costmap is to be cleared outside
    the footprint's reach, now.
    """

    command: Optional[Twist]
    status: str
    reason: str
    global_plan: np.ndarray = EMPTY
    local_plan: np.ndarray = EMPTY
    recovery: bool = False
    candidates: Optional[Candidates] = None


def may_reverse(user):
    """Whether the planner may drive back: nobody pushes forward (``user``: Twist, or None where nobody drives)."""
    return user is None or user.v <= PUSHING


class Navigator:
    """Drives to one goal at a time; settings of group ``move_base``."""

    def __init__(self, settings):
        self.settings = settings
        self.planner = Planner(settings.wheelchair, settings)
        self.commands = Commands(settings, self.planner)
        self._path = KeptPath(self.planner, settings.planner_frequency)
        self._hold = Hold(self.commands.plant)
        self._forget()
        self.status, self.reason = IDLE, ""
        self._zero_due = False
        self._pulled_back = False
        self._updated = -np.inf

    def _forget(self):
        self.goal = None
        self._path.forget()
        self._since_legal = self._since_path = None
        self._recovered = False
        self._anchor = None
        self._hold.forget()
        self._backs = 0
        self._looks = True  # before the first path

    # --- goals -------------------------------------------------------------------------------------------
    def set_goal(self, goal_odom, now):
        """Drive to ``goal_odom`` (3,); a goal under way is replaced without stopping."""
        goal = np.asarray(goal_odom, dtype=float)
        if goal.shape != (3,) or not np.all(np.isfinite(goal)):
            raise ValueError("a goal is three finite numbers x, y, yaw")
        under_way = self._path.kept() if self.status == ACTIVE else None
        self._forget()
        self.goal = goal
        if under_way is not None:
            self._path.resume(under_way)
        self._looks = self._path.empty
        self.status, self.reason, self._zero_due = ACTIVE, "", False

    def cancel(self, now):
        """Give the goal up: one zero, then silence."""
        if self.status == ACTIVE:
            self._end(IDLE, "cancelled")
            self._zero_due = True

    def _end(self, status, reason):
        self._forget()
        self.status, self.reason = status, reason

    def make_plan(self, snapshot, start, goal, tolerance=0.0):
        """Poses (n, 3) from ``start`` (3,) to ``goal`` (3,), both in odom, none driven; (0, 3) where there is no way.

        ``tolerance`` [m]: how far from the goal the plan may end.
        """
        goal = np.asarray(goal, dtype=float)
        field = clearance.padded(clearance.make_field(snapshot), goal[:2], 1.0, 4.0)
        path, _ = self.planner.plan(field, start, goal, True, tolerance=tolerance)
        self._path.stop_searching()
        return EMPTY if path is None else path.poses

    # --- one cycle ---------------------------------------------------------------------------------------
    def update(self, now, odometry, snapshot, user=None, candidates=False):
        """Decision of one control cycle.

        ``odometry``: values.Odometry or None; ``snapshot``: CostmapSnapshot or None; ``user``: the person's command, a
        Twist, None where no person drives: then, and while the person does not push forward, the chair may reverse;
        while the person pulls back, nothing drives it ahead, and nothing is given up. ``candidates``: keep the
        trajectories that were looked at.
        """
        if user is not None:
            # as the blender takes it: within the chair's limits, and what is not finite is nobody's
            user = within_limits(user, self.settings.wheelchair.limits) if np.isfinite(user).all() else None
        self._pulled_back = user is not None and user.v <= -PUSHING
        if now < self._updated:
            self._clock_was_set_back()
        elif self._pulled_back:
            self._wait_with_patience(now - self._updated)
        elif user is not None and max(abs(user.v), abs(user.w)) < AT_REST:
            self._expect_no_progress(now - self._updated)
        self._updated = now
        if self.status != ACTIVE:
            command = STOP if self._zero_due else None
            self._zero_due = False
            self.commands.forget()
            return Decision(command, self.status, self.reason)
        stale = self._stale(now, odometry, snapshot)
        if stale:
            self._since_legal = self._since_path = None
            return self._stop(now, stale)
        field = clearance.padded(clearance.make_field(snapshot), self.goal[:2], 1.0, 4.0)
        if self._arrived(odometry):
            self._end(SUCCEEDED, "goal reached")
            self.commands.forget()
            return Decision(STOP, SUCCEEDED, self.reason)
        if self._oscillates(now, odometry):
            return self._abort("no progress of %.2f m within %.0f s" % (
                self.settings.oscillation_distance, self.settings.oscillation_timeout))
        return self._drive(now, odometry, field, user, candidates)

    def _clock_was_set_back(self):
        """Begin anew with the same goal: what waits for a time, or was told at one, would wait too long."""
        goal = self.goal
        self._forget()
        self.goal = goal
        self.commands.forget()

    def _wait_with_patience(self, pause):
        """What gives up after a time counts ``pause`` [s] less of it.

        Who is on the way out of a dead end need not be told that it is one: the fault would ask for a centred stick,
        and hold the chair there.
        """
        if self._since_legal is not None:
            self._since_legal += pause
        if self._since_path is not None:
            self._since_path += pause
        self._expect_no_progress(pause)

    def _expect_no_progress(self, pause):
        """The last ``pause`` [s] do not count as without progress: the person wanted none."""
        if self._anchor is not None:
            self._anchor = self._anchor[0], self._anchor[1] + pause

    def _drive(self, now, odometry, field, user, candidates):
        """Decision towards a goal that is not reached, over a costmap that is fresh: what a rival planner replaces.

        ``field``: clearance.Field that reaches to the goal; the rest as in ``update``.
        """
        # What a person pushes on, half of it, the chair keeps driving where the path turns on the spot.
        self._path.turn_radius = 0.0 if user is None else 0.5 * max(user.v, 0.0) / TURNING
        acting, anchor = self.commands.predict(now, odometry, user)
        moving = -1 if abs(acting[3]) < 0.1 else (0 if acting[3] > 0.0 else 1)
        if self._looks:
            look = self._look(now, odometry, field, acting, anchor, moving, user)
            if look is not None:
                return look
        self._back_off(now, odometry, field, anchor, user)
        path, reason = self._path.update(now, field, anchor, self.goal, may_reverse(user), moving)
        if path is None:
            return self._without_path(now, reason)
        self._since_path = None
        return self._along(now, field, acting, path, candidates)

    def _along(self, now, field, acting, path, candidates):
        """Decision to drive the first steps of ``path``, or as much of that as stays clear."""
        command = self.commands.along(field, path)
        legal = self.commands.legal(field, acting, command, path)
        kept = Candidates(*legal[1:]) if candidates else None
        plans = dict(global_plan=path.poses, local_plan=legal[1][0], candidates=kept)
        if legal[0] is None:
            return self._without_command(now, plans)
        self._since_legal = None
        return self._send(now, legal[0], "", **plans)

    def _stale(self, now, odometry, snapshot):
        s = self.settings
        if odometry is None:
            return "no odometry"
        if abs(now - odometry.stamp) > s.odom_timeout:  # also from the future: another computer's clock
            return "odometry is %.1f s old, limit %.1f s" % (now - odometry.stamp, s.odom_timeout)
        if not np.all(np.isfinite(odometry.pose)) or not np.all(np.isfinite(odometry.twist)):
            return "odometry is not finite"
        if snapshot is None:
            return "no costmap"
        if snapshot.stamp == -np.inf:
            return "costmap is not complete: a required source has sent nothing yet"
        if not abs(now - snapshot.stamp) <= s.costmap_timeout:
            return "costmap is %.1f s old, limit %.1f s" % (now - snapshot.stamp, s.costmap_timeout)
        return ""

    def _arrived(self, odometry):
        p = self.settings.planner
        return (np.hypot(*(odometry.pose[:2] - self.goal[:2])) <= p.xy_goal_tolerance
                and abs(se2.wrap_angle(odometry.pose[2] - self.goal[2])) <= p.yaw_goal_tolerance)

    def _oscillates(self, now, odometry):
        if self.settings.oscillation_timeout <= 0.0:
            return False
        pose = odometry.pose
        if self._anchor is None:
            self._anchor = (pose, now)
            return False
        moved = np.hypot(*(pose[:2] - self._anchor[0][:2]))
        turned = abs(se2.wrap_angle(pose[2] - self._anchor[0][2])) * self.planner.footprint.circumscribed_radius
        if moved + turned > self.settings.oscillation_distance:
            self._anchor = (pose, now)
        return now - self._anchor[1] > self.settings.oscillation_timeout

    # --- outcomes ----------------------------------------------------------------------------------------
    def _send(self, now, command, reason, **plans):
        if self._pulled_back and command.v > 0.0:
            # Ahead and back would cancel each other out, and a chair before an obstacle would be held there.
            command, reason, plans = STOP, "the person pulls back", {}
        self.commands.note(now, command)
        return Decision(command, self.status, reason, **plans)

    def _stop(self, now, reason, **plans):
        return self._send(now, STOP, reason, **plans)

    def _abort(self, reason):
        self._end(ABORTED, reason)
        self.commands.forget()
        return Decision(STOP, ABORTED, reason)

    def _without_path(self, now, reason):
        if self._since_path is None:
            self._since_path = now
        return self._wait(now, now - self._since_path, self.settings.planner_patience, reason, {})

    def _without_command(self, now, plans):
        if self._since_legal is None:
            self._since_legal = now
        self._path.drop()
        return self._wait(now, now - self._since_legal, self.settings.controller_patience,
                          "no command is free of collision", plans)

    def _wait(self, now, waited, patience, reason, plans):
        if waited <= patience:
            return self._stop(now, reason, **plans)
        if self._recovered or not self.settings.recovery_behavior_enabled:
            return self._abort(reason)
        self._recovered = True
        self._since_legal = self._since_path = None
        self._path.search_now()
        return self._stop(now, reason, recovery=True, **plans)

    # --- looking -----------------------------------------------------------------------------------------
    def _look(self, now, odometry, field, acting, anchor, moving, user):
        """Decision to turn on the spot towards the goal while the ground before it was not seen; else None.

        The camera sees 57 degrees: a path through ground that it has not seen would be found anew all the time.
        Only from standstill, and not close to the goal, where it would show little.
        """
        way = self.goal[:2] - anchor[:2]
        distance = float(np.hypot(*way))
        turn = float(se2.wrap_angle(np.arctan2(way[1], way[0]) - anchor[2]))
        along = anchor[:2] + way * np.arange(1.0, max(distance, 1.0), 0.1)[:, None] / max(distance, 1e-6)
        self._looks = (
            moving < 0 and distance > FAR_ENOUGH and abs(turn) > FACING
            and not all(clearance.known_at(field.known, field.frame, *point) == clearance.SEEN for point in along))
        if not self._looks:
            return None
        soon = anchor + np.outer((0.1, 0.2), (0.0, 0.0, np.sign(turn)))
        room = self.planner.clearance(field, np.vstack((anchor, soon)))
        if np.any(room[1:] < min(self.settings.planner.turn_clearance, room[0])) or self._held(
                now, odometry, user is None or user.v > PUSHING):
            self._looks = False
            return None
        still = self.planner.still(field, acting[:3])
        legal = self.commands.legal(field, acting, self.commands.turning(turn), still)
        if legal[0] is None:
            self._looks = False
            return None
        return self._send(now, legal[0], "looks towards the goal", local_plan=legal[1][0])

    # --- backing off -------------------------------------------------------------------------------------
    def _back_off(self, now, odometry, field, anchor, user):
        """Begin a way back where the chair stands although it is told to move, or finds nothing to tell it.

        Nothing while a person drives.
        """
        held = self._held(now, odometry, user is None)
        if not held or self.settings.planner.min_vel_x >= 0.0 or self._backs >= BACK_TIMES:
            return
        self._hold.forget()
        steps = way_back(field, self.planner, anchor)
        if steps is None:
            return
        self._backs += 1
        self._path.go_back(field, anchor, steps, now)
        self.commands.note(now, STOP)  # it stands: what was told last need not be braked from

    def _held(self, now, odometry, obeyed):
        """Whether the chair stands although it has long been told to move, or although it has a path.

        ``obeyed``: that it is told so by nobody else, or by a person, too: a stick at rest keeps the chair where it is.
        """
        told = self.commands.moving or self._since_legal is not None
        return self._hold.update(now, odometry.pose, told and obeyed)
