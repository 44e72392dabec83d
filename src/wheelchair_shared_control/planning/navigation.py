"""Navigation to a goal: the state machine of move_base without ROS, one call of ``update`` a control cycle.

It never drives on an old costmap, replans when the way is blocked, stops when no command is legal, asks for the
costmap to be cleared once, and gives up with the reason. Turning on the spot as a recovery is off: somebody sits on
the chair, perhaps in a doorway.
"""
from collections import deque
from typing import NamedTuple, Optional

import numpy as np

from wheelchair_shared_control import se2
from wheelchair_shared_control.planning import clearance, following
from wheelchair_shared_control.planning.holding import Hold, way_back
from wheelchair_shared_control.planning.planner import Path, Planner, resampled, rolled
from wheelchair_shared_control.values import STOP, Twist

IDLE, ACTIVE, SUCCEEDED, ABORTED = "idle", "active", "succeeded", "aborted"
PUSHING = 0.05  # m/s: above this a person is driving forward
SLICE = 500  # states expanded in one cycle
BACK_TIME, BACK_TIMES, BACKED = 5.0, 4, 0.04  # s for a way back, how often for one goal, m that may remain of it
FAR_ENOUGH, FACING = 1.8, 0.10  # m, rad: when the chair looks towards its goal first
TURNING = 0.6  # rad/s: mean rate of a turn on the spot
FACED = 0.04  # rad: a turn on the spot with no more left is done
LEAST = 0.008  # m/s and rad/s together: a smaller command moves nothing
# Candidates, as shares of the wanted speed and turn rate, in the order of preference.
SCALES = np.array([[1.0, 1.0], [0.85, 0.85], [0.7, 0.7], [0.55, 0.55], [0.4, 0.4], [0.28, 0.28], [0.18, 0.18],
                   [0.1, 0.1], [0.5, 1.0], [1.0, 0.5], [1.0, 0.0], [0.4, 0.0], [0.0, 1.0], [0.0, 0.5]])
EMPTY = np.zeros((0, 3))


class Candidates(NamedTuple):
    """Trajectories (n, steps, 3) that were looked at, their commands (n, 2) and smallest clearances (n,) [m]."""

    poses: np.ndarray
    commands: np.ndarray
    clearance: np.ndarray


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


class Navigator:
    """Drives to one goal at a time; settings of group ``move_base``."""

    def __init__(self, settings):
        self.settings = settings
        wheelchair = settings.wheelchair
        self.planner = Planner(wheelchair, settings)
        limits = wheelchair.limits
        self.plant = following.Plant(
            wheelchair.actuation.dead_time, wheelchair.actuation.lag, limits.acceleration, limits.turn_acceleration)
        p = settings.planner
        self.v_max = min(p.max_vel_x, limits.speed)
        self.w_max = min(p.max_vel_theta, limits.turn_rate)
        self.acc = min(p.acc_lim_x, limits.acceleration)
        self.turn_acc = min(p.acc_lim_theta, limits.turn_acceleration)
        self._sent = deque(maxlen=200)
        self._hold = Hold(self.plant)
        self._forget()
        self.status, self.reason = IDLE, ""
        self._zero_due = False

    def _forget(self):
        self.goal = None
        self._path, self._step, self._path_goal = None, 0, None
        self._searched_at = -np.inf
        self._since_legal = self._since_path = None
        self._recovered = False
        self._anchor = None
        self._hold.forget()
        self._back_until, self._backs = None, 0
        self._no_path = ""
        self._searching = False
        self._looks = True  # before the first path
        self._turn_radius = 0.0

    # --- goals -------------------------------------------------------------------------------------------
    def set_goal(self, goal_odom, now):
        """Drive to ``goal_odom`` (3,); a goal under way is replaced without stopping."""
        goal = np.asarray(goal_odom, dtype=float)
        if goal.shape != (3,) or not np.all(np.isfinite(goal)):
            raise ValueError("a goal is three finite numbers x, y, yaw")
        under_way = (self._path, self._step, self._path_goal) if self.status == ACTIVE else (None, 0, None)
        self._forget()
        self.goal = goal
        # The way to the old goal is driven on until there is one to the new.
        self._path, self._step, self._path_goal = under_way
        self._looks = self._path is None
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
        self._searching = False
        return EMPTY if path is None else path.poses

    # --- one cycle ---------------------------------------------------------------------------------------
    def update(self, now, odometry, snapshot, user_v=None, candidates=False):
        """Decision of one control cycle.

        ``odometry``: values.Odometry or None; ``snapshot``: CostmapSnapshot or None; ``user_v`` [m/s]: the person's
        forward command, None where no person drives: then, and while the person does not push forward, the chair may
        reverse. ``candidates``: keep the trajectories that were looked at.
        """
        if user_v is not None:
            # as the blender takes it: within the chair's limits, and what is not finite is nobody's
            limit = self.settings.wheelchair.limits.speed
            user_v = min(max(user_v, -limit), limit) if np.isfinite(user_v) else None
        if self.status != ACTIVE:
            command = STOP if self._zero_due else None
            self._zero_due = False
            self._sent.clear()
            return Decision(command, self.status, self.reason)
        stale = self._stale(now, odometry, snapshot)
        if stale:
            self._since_legal = self._since_path = None
            return self._stop(now, stale)
        field = clearance.padded(clearance.make_field(snapshot), self.goal[:2], 1.0, 4.0)
        if self._arrived(odometry):
            self._end(SUCCEEDED, "goal reached")
            self._sent.clear()
            return Decision(STOP, SUCCEEDED, self.reason)
        if self._oscillates(now, odometry):
            return self._abort("no progress of %.2f m within %.0f s" % (
                self.settings.oscillation_distance, self.settings.oscillation_timeout))
        return self._drive(now, odometry, field, user_v, candidates)

    def _drive(self, now, odometry, field, user_v, candidates):
        """Decision towards a goal that is not reached, over a costmap that is fresh: what a rival planner replaces.

        ``field``: clearance.Field that reaches to the goal; the rest as in ``update``.
        """
        # What a person pushes on, half of it, the chair keeps driving where the path turns on the spot.
        self._turn_radius = 0.0 if user_v is None else 0.5 * max(user_v, 0.0) / TURNING
        acting, anchor = self._predict(now, odometry, user_v)
        moving = -1 if abs(acting[3]) < 0.1 else (0 if acting[3] > 0.0 else 1)
        if self._looks:
            look = self._look(now, odometry, field, acting, anchor, moving, user_v)
            if look is not None:
                return look
        self._back_off(now, odometry, field, anchor, user_v)
        path, reason = self._keep_path(now, field, anchor, user_v is None or user_v <= PUSHING, moving)
        if path is None:
            return self._without_path(now, reason)
        return self._along(now, field, acting, path, candidates)

    def _along(self, now, field, acting, path, candidates):
        """Decision to drive the first steps of ``path``, or as much of that as stays clear."""
        command = self._follow(field, path)
        legal = self._legal(field, acting, command, path)
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
        self._sent.append((now, command.v, command.w))
        return Decision(command, self.status, reason, **plans)

    def _stop(self, now, reason, **plans):
        return self._send(now, STOP, reason, **plans)

    def _abort(self, reason):
        self._end(ABORTED, reason)
        self._sent.clear()
        return Decision(STOP, ABORTED, reason)

    def _without_path(self, now, reason):
        if self._since_path is None:
            self._since_path = now
        return self._wait(now, now - self._since_path, self.settings.planner_patience, reason, {})

    def _without_command(self, now, plans):
        if self._since_legal is None:
            self._since_legal = now
        self._path = None
        return self._wait(now, now - self._since_legal, self.settings.controller_patience,
                          "no command is free of collision", plans)

    def _wait(self, now, waited, patience, reason, plans):
        if waited <= patience:
            return self._stop(now, reason, **plans)
        if self._recovered or not self.settings.recovery_behavior_enabled:
            return self._abort(reason)
        self._recovered = True
        self._since_legal = self._since_path = None
        self._searched_at = -np.inf
        return self._stop(now, reason, recovery=True, **plans)

    # --- looking -----------------------------------------------------------------------------------------
    def _look(self, now, odometry, field, acting, anchor, moving, user_v):
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
                now, odometry, user_v is None or user_v > PUSHING):
            self._looks = False
            return None
        w = np.sign(turn) * min(self.w_max, max(0.12, np.sqrt(self.turn_acc * abs(turn))))
        pose = self.planner.still(field, acting[:3])
        legal = self._legal(field, acting, self._limited(0.0, w), pose)
        if legal[0] is None:
            self._looks = False
            return None
        return self._send(now, legal[0], "looks towards the goal", local_plan=legal[1][0])

    # --- backing off -------------------------------------------------------------------------------------
    def _back_off(self, now, odometry, field, anchor, user_v):
        """Begin a way back where the chair stands although it is told to move; nothing while a person drives."""
        held = self._held(now, odometry, user_v is None)
        if not held or self.settings.planner.min_vel_x >= 0.0 or self._backs >= BACK_TIMES:
            return
        self._hold.forget()
        steps = way_back(field, self.planner, anchor)
        if steps is None:
            return
        self._backs += 1
        self._back_until = now + BACK_TIME
        poses = rolled(anchor, steps)
        self._path = Path(steps, poses, np.full(len(steps), -1), self.planner.clearance(field, poses))
        self._step, self._path_goal = 0, poses[-1]
        self._searching = False
        self._sent.append((now, 0.0, 0.0))  # it stands: what was told last need not be braked from

    def _held(self, now, odometry, obeyed):
        """Whether the chair stands although it has long been told to move.

        ``obeyed``: that it is told so by nobody else, or by a person, too: a stick at rest keeps the chair where it is.
        """
        told = bool(self._sent) and (abs(self._sent[-1][1]) > 0.02 or abs(self._sent[-1][2]) > 0.05)
        return self._hold.update(now, odometry.pose, told and obeyed)

    def _backing(self, now, way, blocked):
        """Whether the way back is still being driven; at its end the path to the goal is looked for."""
        if self._back_until is None:
            return False
        if not blocked and now < self._back_until and np.hypot(*(way.poses[0, :2] - self._path_goal[:2])) > BACKED:
            return True
        self._back_until, self._path, self._searched_at = None, None, -np.inf
        return False

    # --- path --------------------------------------------------------------------------------------------
    def _predict(self, now, odometry, user_v):
        """State (5,) at which a command sent now begins to act, and the pose (3,) at which it is felt."""
        plant, dt = self.plant, 0.02
        state = np.concatenate((odometry.pose, odometry.twist)).astype(np.float64)
        ahead = now - odometry.stamp + plant.dead_time
        n = max(0, int(round(ahead / dt)))
        times = odometry.stamp + (np.arange(n) + 0.5) * dt - plant.dead_time
        targets = np.zeros((n, 2))
        sent = list(self._sent)
        k = 0
        for i, t in enumerate(times):
            while k < len(sent) and sent[k][0] <= t:
                k += 1
            targets[i] = sent[k - 1][1:] if k else state[3:]
        last = np.array(sent[-1][1:]) if sent else state[3:].copy()
        if user_v is not None:
            # Half of it is the person's: what is measured tells more than what was sent.
            targets[:, 0] = 0.5 * (targets[:, 0] + user_v)
            targets[:, 1] = 0.5 * (targets[:, 1] + state[4])
            last = np.array([0.5 * (last[0] + user_v), 0.5 * (last[1] + state[4])])
        acting = following.predict(state, targets, plant.lag, plant.acceleration, plant.turn_acceleration, dt)
        felt = int(round(plant.lag / dt))
        anchor = following.predict(acting, np.tile(last, (felt, 1)), plant.lag, plant.acceleration,
                                   plant.turn_acceleration, dt)
        return acting, anchor[:3].copy()

    def _keep_path(self, now, field, anchor, allow_reverse, moving):
        """(the way from ``anchor`` on, "") along the path that is kept or newly found, or (None, reason).

        The path found by the search stays the reference: each cycle bends what remains of it for the present
        costmap and pose, but never the bent one further, which would wander.
        """
        way, blocked = None, True
        outdated = self._path_goal is not None and not np.array_equal(self._path_goal, self.goal)
        if self._path is not None:
            way, deviation, turned = self._remaining(field, anchor)
            blocked = (self.planner.blocked(way, 0.0) >= 0 or deviation > 0.25 or turned > 0.6
                       or (not allow_reverse and bool(np.any(way.kinds < 0))))
            if self._backing(now, way, blocked):
                return way, ""
            if self._path is None:
                way, blocked = None, True
        period = 0.2 if blocked else 1.0 / self.settings.planner_frequency
        if not self._searching and now - self._searched_at >= period:
            self._searched_at, self._searching = now, True
            self.planner.begin(field, anchor, self.goal, allow_reverse, moving)
        if self._searching:
            done = self.planner.go_on(SLICE)
            if done is not None:
                self._searching = False
                new, self._no_path = done
                if new is not None:
                    way, blocked = self._better(field, anchor, new, way, blocked or outdated)
                elif blocked or outdated:
                    self._path = way = None
        if way is None:
            return None, self._no_path or "looking for a path"
        self._since_path = None
        return way, ""

    def _better(self, field, anchor, new, way, blocked):
        """The new path, or the one that is driven where the new one is not clearly better."""
        old = self._path, self._step, self._path_goal
        self._path, self._step, self._path_goal = new, 0, self.goal
        new_way, deviation, turned = self._remaining(field, anchor)
        new_blocked = self.planner.blocked(new_way, 0.0) >= 0 or deviation > 0.25 or turned > 0.6
        old_price = np.inf if blocked else self.planner.price(field, anchor, way.steps, way.kinds)
        new_price = self.planner.price(field, anchor, new_way.steps, new_way.kinds)
        if new_price < 0.85 * old_price - 0.5 and not (new_blocked and not blocked):
            return new_way, new_blocked
        self._path, self._step, self._path_goal = old
        return way, blocked

    def _remaining(self, field, anchor):
        """What is left of the path, bent to start at ``anchor``; and the distance [m, rad] from the path."""
        path = self._path
        step, part = following.project(anchor, path.poses, path.kinds, self._step, self._turn_radius)
        self._step = step
        on_path = path.poses[step] + part * (path.poses[step + 1] - path.poses[step])
        steps = path.steps[step:].copy()
        steps[0] *= 1.0 - part
        steps, kinds = resampled(steps, path.kinds[step:])
        targets = rolled(on_path, steps)
        targets[-1] = self.planner._inside(field, self._path_goal)
        # The way back is straight: it was looked at as it is.
        way = self.planner.refine(field, anchor, steps, kinds, targets, 0 if self._back_until is not None else 6)
        n = int(np.argmax(way.kinds != 0))
        if n and abs(np.sum(way.steps[:n, 1])) < FACED:
            # The rest of a turn is not worth standing for: the drive that follows steers it out.
            self._step += int(np.argmax(path.kinds[step:] != 0))
            targets = targets[n:]
            way = self.planner.refine(field, anchor, steps[n:], kinds[n:], targets, 6)
        return way, np.hypot(*(anchor[:2] - on_path[:2])), abs(se2.wrap_angle(anchor[2] - on_path[2]))

    # --- command -----------------------------------------------------------------------------------------
    def _follow(self, field, path):
        """The command that drives the first steps of ``path``."""
        p = self.settings.planner
        seen = self.planner.seen(field, path)
        clear = np.minimum(path.clear[:-1], path.clear[1:])
        rate = following.speeds(
            path.steps, path.kinds, clear, seen, p.speed_at_contact, p.speed_per_clearance, p.speed_in_unknown,
            self.v_max, -p.min_vel_x, self.w_max, 0.8 * self.acc, 0.6 * self.turn_acc)
        kind = path.kinds[0]
        same = 1
        while same < len(path.kinds) and path.kinds[same] == kind:
            same += 1
        run = path.steps[:same]
        if kind == 0:
            turn = np.sum(run[:, 1])
            v, w = 0.0, np.sign(turn) * max(abs(run[0, 1] * rate[0]), 0.12)
            w = np.sign(w) * min(abs(w), max(0.1, np.sqrt(1.2 * self.turn_acc * abs(turn))))
        else:
            along = np.cumsum(np.abs(run[:, 0]))
            n = min(same, int(np.searchsorted(along, 0.18)) + 1)
            bend = np.sum(run[:n, 1]) / max(along[n - 1], 0.02)
            v = kind * max(abs(run[0, 0] * rate[0]), 0.06)
            v = np.sign(v) * min(abs(v), self.w_max / max(abs(bend), 1e-3))
            w = bend * abs(v)
        return self._limited(v, w)

    def _limited(self, v, w):
        """The command within the acceleration limits from the last one."""
        dt = 1.0 / self.settings.controller_frequency
        v0, w0 = self._sent[-1][1:] if self._sent else (0.0, 0.0)
        w_wanted = w
        w = w0 + min(max(w - w0, -self.turn_acc * dt), self.turn_acc * dt)
        if abs(w_wanted) > 0.05 and v != 0.0:
            # The bend of the path is kept: while the turn rate still builds up, the chair goes slower.
            v *= min(max(w / w_wanted, 0.3), 1.0)
        v = v0 + min(max(v - v0, -self.acc * dt), self.acc * dt)
        return Twist(float(v), float(min(max(w, -self.w_max), self.w_max)))

    def _legal(self, field, acting, command, path):
        """(the command, or the most of it that stays clear, or None), and the trajectories that were looked at."""
        p, plant = self.settings.planner, self.plant
        nothing = np.hypot(*command) <= LEAST  # between a drive and its reversal
        commands = np.ascontiguousarray(SCALES * np.array(command))
        n = int(np.ceil(p.sim_time / following.DT))
        hold = max(1, int(round(1.0 / self.settings.controller_frequency / following.DT))) + 1
        poses, least = following.rollouts(
            field.distance, field.frame, *self.planner.body, acting, commands, path.poses[-1], n, hold,
            plant.lag, plant.acceleration, plant.turn_acceleration, following.DT)
        here = float(self.planner.clearance(field, acting[None, :3])[0])
        corner = np.hypot(commands[:, 0], commands[:, 1] * self.planner.footprint.circumscribed_radius)
        # As the guard has it; and not much closer than the path ahead: a wide door is not passed by a hair.
        margin = np.maximum(p.margin + p.margin_per_speed * corner, min(0.5 * float(np.min(path.clear[:12])), 0.05))
        for k in np.flatnonzero(least >= np.minimum(margin, here - 1e-4)):
            if nothing or np.hypot(*commands[k]) > LEAST:
                return Twist(*map(float, commands[k])), poses, commands, least
        return None, poses, commands, least
