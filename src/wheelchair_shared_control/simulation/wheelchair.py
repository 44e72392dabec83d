"""The chair's physics: motors that answer late and weakly, wheels that may slip, odometry that drifts.

One pybullet client each. The drive wheels are motors with a torque limit that hold a speed; the castors
slide; the outline is a prism that meets the world. A wheel touches the floor in one point (a sphere): the
edge of a cylinder would make the track width uncertain.
"""
import functools
import math
import xml.etree.ElementTree as ElementTree
from collections import deque
from typing import NamedTuple

import numpy as np

from wheelchair_shared_control import footprint as footprints
from wheelchair_shared_control import parameters, se2
from wheelchair_shared_control.simulation.engine import pybullet
from wheelchair_shared_control.simulation.outlines import HIGH, LOW
from wheelchair_shared_control.simulation.world import SceneError
from wheelchair_shared_control.values import Odometry, Twist

URDF = "urdf/wheelchair.urdf"
CASTOR_FRICTION = 0.01
CASTOR_TRAIL = 0.05  # m, of the castors that are seen


class Body(NamedTuple):
    """What physics needs of the URDF: masses [kg], inertia (3,) [kg m2], places [m] in base_link."""

    mass: float
    centre: tuple
    inertia: tuple
    wheel_mass: float
    wheel_radius: float
    track: float
    castor_radius: float
    castor_x: float
    castor_y: float


@functools.lru_cache(maxsize=4)
def read_body(path=None):
    """The ``Body`` of a URDF file. Raises SceneError that names file and missing part."""
    path = str(path or parameters.package_file(URDF))

    def numbers(text):
        return tuple(float(word) for word in text.split())

    def find(where, what):
        found = root.find(where)
        if found is None:
            raise SceneError("%s: %s is missing" % (path, what))
        return found

    try:
        root = ElementTree.parse(path).getroot()
        inertial = find("link[@name='chassis']/inertial", "the inertial of link 'chassis'")
        inertia = inertial.find("inertia").attrib
        wheel = "link[@name='wheel_left']/"
        wheel_at = numbers(find("joint[@name='wheel_left_joint']/origin", "joint 'wheel_left_joint'").get("xyz"))
        swivel = numbers(find("joint[@name='castor_left_swivel_joint']/origin",
                              "joint 'castor_left_swivel_joint'").get("xyz"))
        return Body(
            mass=float(inertial.find("mass").get("value")),
            centre=numbers(inertial.find("origin").get("xyz")),
            inertia=tuple(float(inertia[key]) for key in ("ixx", "iyy", "izz")),
            wheel_mass=float(find(wheel + "inertial/mass", "the mass of link 'wheel_left'").get("value")),
            wheel_radius=float(find(wheel + "collision/geometry/cylinder",
                                    "the cylinder of link 'wheel_left'").get("radius")),
            track=2.0 * wheel_at[1],
            castor_radius=float(find("link[@name='castor_left']/collision/geometry/sphere",
                                     "the sphere of link 'castor_left'").get("radius")),
            castor_x=swivel[0],
            castor_y=swivel[1],
        )
    except (OSError, ElementTree.ParseError, AttributeError, KeyError, ValueError) as error:
        raise SceneError("%s: no chair can be read from it: %s" % (path, error))


class Wheelchair:
    """The chair in a pybullet client; steps of constant length, the same for the same commands."""

    def __init__(self, client, settings, rng):
        self._client, self._settings = client, settings
        self._chair = settings.wheelchair
        self.footprint = footprints.from_settings(self._chair)
        self.body = body = read_body()
        errors = settings.odometry
        self._scale = 1.0 + errors.factor * errors.scale_error * rng.standard_normal()
        self._drift = errors.factor * errors.yaw_drift * rng.standard_normal()
        self.identity = self._create(body)
        self._lag_gain = 1.0
        if self._chair.actuation.lag > 0.0:
            self._lag_gain = 1.0 - math.exp(-settings.physics_step / self._chair.actuation.lag)
        self.restart(np.zeros(3))

    def _create(self, body):
        f = self.footprint
        centre = body.centre
        prism = pybullet.createCollisionShape(
            pybullet.GEOM_BOX, halfExtents=[f.length / 2.0, f.half_width, (HIGH - LOW) / 2.0],
            collisionFramePosition=[(f.front + f.rear) / 2.0 - centre[0], 0.0, (HIGH + LOW) / 2.0 - centre[2]],
            physicsClientId=self._client)
        wheel = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=body.wheel_radius,
                                              physicsClientId=self._client)
        castor = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=body.castor_radius,
                                               physicsClientId=self._client)
        places = [(0.0, side * body.track / 2.0, body.wheel_radius) for side in (1.0, -1.0)]
        places += [(body.castor_x, side * body.castor_y, body.castor_radius) for side in (1.0, -1.0)]
        joints = [pybullet.JOINT_REVOLUTE] * 2 + [pybullet.JOINT_FIXED] * 2
        identity = pybullet.createMultiBody(
            baseMass=body.mass, baseCollisionShapeIndex=prism, basePosition=centre,
            linkMasses=[body.wheel_mass] * 2 + [0.5] * 2,
            linkCollisionShapeIndices=[wheel, wheel, castor, castor],
            linkVisualShapeIndices=[-1] * 4,
            linkPositions=[[p - c for p, c in zip(place, centre)] for place in places],
            linkOrientations=[[0, 0, 0, 1]] * 4, linkInertialFramePositions=[[0, 0, 0]] * 4,
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * 4, linkParentIndices=[0] * 4,
            linkJointTypes=joints, linkJointAxis=[[0, 1, 0]] * 4, physicsClientId=self._client)
        pybullet.changeDynamics(identity, -1, localInertiaDiagonal=body.inertia, lateralFriction=0.3, restitution=0.0,
                                linearDamping=0.0, angularDamping=0.0, physicsClientId=self._client)
        for link in range(4):
            pybullet.changeDynamics(
                identity, link, restitution=0.0, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0,
                lateralFriction=self._settings.wheel_friction if link < 2 else CASTOR_FRICTION,
                rollingFriction=0.0, spinningFriction=0.0, physicsClientId=self._client)
            # wheels and castors meet the floor only (group 2); the prism meets the world only (group 1)
            pybullet.setCollisionFilterGroupMask(identity, link, 4, 2, physicsClientId=self._client)
        pybullet.setCollisionFilterGroupMask(identity, -1, 8, 1, physicsClientId=self._client)
        return identity

    def restart(self, pose):
        """At rest at ``pose`` (3,), odometry at zero, no command."""
        self.distance = 0.0
        self._odometry = np.zeros(3)
        self._odometry_twist = Twist(0.0, 0.0)
        self.place(pose)

    def place(self, pose):
        """Set down at rest at ``pose`` (3,) in the world; the odometry does not notice."""
        self._pending = deque()
        self._target = (0.0, 0.0)
        self._answer = [0.0, 0.0]
        self._last_command = -math.inf
        c, s = math.cos(pose[2]), math.sin(pose[2])
        centre = self.body.centre
        pybullet.resetBasePositionAndOrientation(
            self.identity, [pose[0] + c * centre[0], pose[1] + s * centre[0], centre[2]],
            [0.0, 0.0, math.sin(pose[2] / 2.0), math.cos(pose[2] / 2.0)], physicsClientId=self._client)
        pybullet.resetBaseVelocity(self.identity, [0, 0, 0], [0, 0, 0], physicsClientId=self._client)
        for joint in (0, 1):
            pybullet.resetJointState(self.identity, joint, 0.0, 0.0, physicsClientId=self._client)
        self._angles = (0.0, 0.0)
        self.wheel_angles, self.castor_angles = [0.0, 0.0], [0.0, 0.0, 0.0, 0.0]
        self._read()

    def command(self, now, v, w):
        """Take a command at ``now`` [s]: it acts after the dead time. What is not finite counts as zero."""
        limits = self._chair.limits
        if not (math.isfinite(v) and math.isfinite(w)):
            v = w = 0.0
        v = min(max(v, -limits.speed), limits.speed)
        w = min(max(w, -limits.turn_rate), limits.turn_rate)
        self._last_command = now
        self._pending.append((now + self._chair.actuation.dead_time, v, w))

    def before_step(self, now):
        """Set the motors for the step that begins at ``now`` [s]."""
        while self._pending and self._pending[0][0] <= now + 1e-9:
            self._target = self._pending.popleft()[1:]
        if now - self._chair.actuation.dead_time - self._last_command > self._settings.command_timeout + 1e-9:
            self._target = (0.0, 0.0)
        self._answer[0] += self._lag_gain * (self._target[0] - self._answer[0])
        self._answer[1] += self._lag_gain * (self._target[1] - self._answer[1])
        v, turn = self._answer[0], self._answer[1] * self.body.track / 2.0
        radius, torque = self.body.wheel_radius, self._settings.wheel_torque
        pybullet.setJointMotorControlArray(
            self.identity, (0, 1), pybullet.VELOCITY_CONTROL,
            targetVelocities=((v - turn) / radius, (v + turn) / radius), forces=(torque, torque),
            physicsClientId=self._client)

    def after_step(self):
        """Read pose and wheels back, and carry the odometry on."""
        before = self._angles
        self._read()
        radius, track = self.body.wheel_radius * self._scale, self.body.track
        left, right = ((now - then) * radius for now, then in zip(self._angles, before))
        forward = 0.5 * (left + right)
        turn = (right - left) / track + self._drift * abs(forward)
        self.distance += abs(forward)
        self.wheel_angles = [angle + now - then
                             for angle, now, then in zip(self.wheel_angles, self._angles, before)]
        x, y, yaw = self._odometry
        middle = yaw + 0.5 * turn
        self._odometry = np.array([x + forward * math.cos(middle), y + forward * math.sin(middle), yaw + turn])
        h = self._settings.physics_step
        self._odometry_twist = Twist(forward / h, turn / h)

    def _read(self):
        states = pybullet.getJointStates(self.identity, (0, 1), physicsClientId=self._client)
        self._angles = (states[0][0], states[1][0])
        position, quaternion = pybullet.getBasePositionAndOrientation(self.identity, physicsClientId=self._client)
        x, y, z, w = quaternion
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        centre = self.body.centre
        # the centre of mass leans by pitch and roll: its projection along the body's own x axis
        forward_x, forward_y = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
        up_x, up_y = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x)
        self.pose = np.array([position[0] - centre[0] * forward_x - centre[2] * up_x,
                              position[1] - centre[0] * forward_y - centre[2] * up_y, yaw])

    def twist(self):
        """True velocity of base_link along its own x axis [m/s], and its turn rate [rad/s]."""
        linear, angular = pybullet.getBaseVelocity(self.identity, physicsClientId=self._client)
        yaw = self.pose[2]
        return Twist(math.cos(yaw) * linear[0] + math.sin(yaw) * linear[1], angular[2])

    def roll_castors(self, dt):
        """Turn the castors, for the eye only, as ``dt`` [s] of the present motion turns them."""
        v, w = self.twist()
        for index, side in enumerate((1.0, -1.0)):
            x, y = v - w * side * self.body.castor_y, w * self.body.castor_x
            swivel = self.castor_angles[index]
            along = x * math.cos(swivel) + y * math.sin(swivel)
            across = y * math.cos(swivel) - x * math.sin(swivel)
            swivel += dt * (across / CASTOR_TRAIL - w)
            self.castor_angles[index] = math.atan2(math.sin(swivel), math.cos(swivel))
            self.castor_angles[index + 2] += dt * along / self.body.castor_radius

    def joints(self):
        """Angles [rad] of the URDF's joints by name."""
        left, right = self.castor_angles[:2]
        return {"wheel_left_joint": self.wheel_angles[0], "wheel_right_joint": self.wheel_angles[1],
                "castor_left_swivel_joint": left, "castor_right_swivel_joint": right,
                "castor_left_joint": self.castor_angles[2], "castor_right_joint": self.castor_angles[3]}

    def odometry(self, now):
        """What the wheels' encoders say: scale error and yaw drift included; starts at zero."""
        pose = self._odometry.copy()
        pose[2] = float(se2.wrap_angle(pose[2]))
        return Odometry(now, pose, self._odometry_twist)
