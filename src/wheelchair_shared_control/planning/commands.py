"""Commands along a path: what was sent and still acts, what drives the next steps, and how much of that stays clear.

The chair of the next half second is predicted through dead time and lag; a command counts as legal if the true
footprint stays clear while it is held and then braked.
"""
from collections import deque
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control.planning import following
from wheelchair_shared_control.values import Twist

SLOWEST_TURN = 0.12  # rad/s: on the spot
LEAST = 0.008  # m/s and rad/s together: a smaller command moves nothing
# Candidates, as shares of the wanted speed and turn rate, in the order of preference.
SCALES = np.array([[1.0, 1.0], [0.85, 0.85], [0.7, 0.7], [0.55, 0.55], [0.4, 0.4], [0.28, 0.28], [0.18, 0.18],
                   [0.1, 0.1], [0.5, 1.0], [1.0, 0.5], [1.0, 0.0], [0.4, 0.0], [0.0, 1.0], [0.0, 0.5]])


class Candidates(NamedTuple):
    """Trajectories (n, steps, 3) that were looked at, their commands (n, 2) and smallest clearances (n,) [m]."""

    poses: np.ndarray
    commands: np.ndarray
    clearance: np.ndarray


class Commands:
    """The commands of one navigator, with its limits; settings of group ``move_base``, ``planner`` a Planner."""

    def __init__(self, settings, planner):
        self.settings, self.planner = settings, planner
        limits, actuation, p = settings.wheelchair.limits, settings.wheelchair.actuation, settings.planner
        self.plant = following.Plant(actuation.dead_time, actuation.lag, limits.acceleration, limits.turn_acceleration)
        self.v_max = min(p.max_vel_x, limits.speed)
        self.w_max = min(p.max_vel_theta, limits.turn_rate)
        self.acc = min(p.acc_lim_x, limits.acceleration)
        self.turn_acc = min(p.acc_lim_theta, limits.turn_acceleration)
        self._sent = deque(maxlen=200)

    def forget(self):
        """Nothing was sent."""
        self._sent.clear()

    def note(self, now, command):
        """Remember what is sent at ``now`` [s]."""
        self._sent.append((now, command.v, command.w))

    @property
    def moving(self):
        """Whether the chair was told last to move."""
        return bool(self._sent) and (abs(self._sent[-1][1]) > 0.02 or abs(self._sent[-1][2]) > 0.05)

    def predict(self, now, odometry, user):
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
        if user is not None:
            # Half of it is the person's: what is measured tells more than what was sent.
            targets[:, 0] = 0.5 * (targets[:, 0] + user.v)
            targets[:, 1] = 0.5 * (targets[:, 1] + state[4])
            last = np.array([0.5 * (last[0] + user.v), 0.5 * (last[1] + state[4])])
        acting = following.predict(state, targets, plant.lag, plant.acceleration, plant.turn_acceleration, dt)
        felt = int(round(plant.lag / dt))
        anchor = following.predict(acting, np.tile(last, (felt, 1)), plant.lag, plant.acceleration,
                                   plant.turn_acceleration, dt)
        return acting, anchor[:3].copy()

    def along(self, field, path):
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
            v, w = 0.0, np.sign(turn) * max(abs(run[0, 1] * rate[0]), SLOWEST_TURN)
            w = np.sign(w) * min(abs(w), max(0.1, np.sqrt(1.2 * self.turn_acc * abs(turn))))
        else:
            along = np.cumsum(np.abs(run[:, 0]))
            n = min(same, int(np.searchsorted(along, 0.18)) + 1)
            bend = np.sum(run[:n, 1]) / max(along[n - 1], 0.02)
            v = kind * max(abs(run[0, 0] * rate[0]), 0.06)
            v = np.sign(v) * min(abs(v), self.w_max / max(abs(bend), 1e-3))
            w = bend * abs(v)
        return self.limited(v, w)

    def turning(self, turn):
        """The command that turns on the spot by ``turn`` [rad] and can still brake at its end."""
        return self.limited(0.0, np.sign(turn) * min(self.w_max, max(SLOWEST_TURN, np.sqrt(self.turn_acc * abs(turn)))))

    def limited(self, v, w):
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

    def legal(self, field, acting, command, path):
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
