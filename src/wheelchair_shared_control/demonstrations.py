"""Demonstrations: from a bag to the samples (d_l, d_f, d_r, v, w_l, w_r) that a person showed.

The distances come from the blender's state as it was recorded, or from the raw sensors through the same
costmap and features that the chair uses (``replayed_costmap``). Speeds are the measured ones at the same
stamp. What is left out is left out by a rule and counted: see ``RULES``.
"""
from typing import Dict, NamedTuple, Tuple

import numpy as np

from wheelchair_shared_control import bags, conversions, replayed_costmap, task_model
from wheelchair_shared_control.bags import BagError
from wheelchair_shared_control.values import Twist

# name on the command line -> topic. Rangers: a prefix.
TOPICS = {
    "features": "blender/state",
    "odom": "odom",
    "cmd_vel": "cmd_vel",
    "user": "user/cmd_vel",
    "assistance": "assistance",
    "depth": "camera/depth/image_raw",
    "camera_info": "camera/depth/camera_info",
    "points": "camera/depth/points",
    "scan": "scan",
    "ranges": "ir",
    "tf": "tf",
    "tf_static": "tf_static",
}
ALIASES = {
    "state": "features", "blender": "features", "odometry": "odom", "command": "cmd_vel", "cmd": "cmd_vel",
    "user_command": "user", "joystick": "user", "image": "depth", "cloud": "points", "laser": "scan", "ir": "ranges",
}
ALIASES.update({topic: name for name, topic in TOPICS.items() if topic not in TOPICS})
SOURCES = ("auto", "recorded", "raw")
# why a moment is no sample, in the order of asking: each is counted under the first that applies
RULES = {
    "impossible": "distances or speeds that are no numbers or beyond what a chair does",
    "unaligned": "no odometry on both sides within the tolerance",
    "assisted": "the assistance was blending its own command in",
    "standing": "neither driving nor turning",
    "reversing": "driving backwards, which the model is never asked about",
    "not_commanded": "moving without a command: pushed, or driven by something that was not recorded",
    "not_the_user": "the wheels' command was not the user's",
    "too_close": "closer in time to the sample before than the rate asks for",
}
ASSISTING = 2  # AssistanceState.ASSISTING


class Demonstration(NamedTuple):
    """The samples of one bag.

    ``samples`` (n, 6) in the order of ``task_model.NAMES``; ``stamps`` (n,) [s]; ``left_out``: moments not
    taken, by rule; ``source`` "recorded" or "raw"; ``duration`` [s] of the bag; ``notes``: what was missing
    or assumed, in words.
    """

    path: str
    samples: np.ndarray
    stamps: np.ndarray
    left_out: Dict[str, int]
    source: str
    duration: float
    notes: Tuple[str, ...]


class Commands(NamedTuple):
    """Commands over time: ``stamps`` (n,) [s], ``values`` (n, 2) v [m/s] and w [rad/s]."""

    stamps: np.ndarray
    values: np.ndarray


def topic_names(renamings=()):
    """``TOPICS`` with renamings such as "scan=/front/scan" applied. Raises BagError."""
    topics = dict(TOPICS)
    for text in renamings:
        name, equals, topic = text.partition("=")
        name = bags.plain(name.strip())
        name = ALIASES.get(name, name)
        if not equals or not topic.strip():
            raise BagError("--topic %s: it must be NAME=TOPIC" % text)
        if name not in topics:
            raise BagError("--topic %s: unknown name, it must be one of %s" % (text, ", ".join(TOPICS)))
        topics[name] = bags.plain(topic.strip())
    return topics


def read(path, settings, topics=None, source="auto", navigation=None):
    """``Demonstration`` of one bag.

    ``settings``: group ``demonstrations``; ``topics``: of ``topic_names``; ``source``: "recorded" features,
    "raw" sensors through the costmap, "auto" recorded where the bag has them; ``navigation``: settings of
    group ``move_base``, whose costmap is used for "raw" (default: the package's). Raises BagError.
    """
    topics = topics or topic_names()
    with bags.open_bag(path) as bag:
        if not bag.topics:
            raise BagError("%s: holds no messages" % path)
        if topics["odom"] not in bag.topics:
            raise BagError(
                "%s: no odometry on topic '%s' (topics: %s)" % (path, topics["odom"], ", ".join(sorted(bag.topics)))
            )
        if source == "auto":
            source = "recorded" if topics["features"] in bag.topics else "raw"
        log = read_log(bag, topics)
        if source == "recorded":
            stamps, distances = _recorded_features(bag, topics)
            notes = ()
        else:
            stamps, distances, notes = replayed_costmap.features(bag, topics, log.odometry, log.base_frame, navigation)
        if not len(stamps):
            raise BagError("%s: no features could be made of it%s" % (path, "".join("; " + note for note in notes)))
        samples, stamps, left_out = select(stamps, distances, log, settings)
        notes = tuple(notes) + log.notes
        return Demonstration(str(path), samples, stamps, left_out, source, bag.duration, notes)


class Log(NamedTuple):
    """What a bag says about the driving.

    ``odometry`` (n, 6): stamp [s], x, y [m], yaw [rad], v [m/s], w [rad/s]; ``sent`` what went to the
    wheels, ``user`` what the person asked for, None where not recorded; ``assisting`` (m, 2): time [s] and
    1 while the assistance blends.
    """

    odometry: np.ndarray
    base_frame: str
    sent: Commands
    user: Commands
    assisting: np.ndarray
    notes: Tuple[str, ...]


def select(stamps, distances, log, settings):
    """Samples (n, 6), their stamps (n,), and counts by rule of the moments left out.

    ``stamps`` (m,), ``distances`` (m, 3): the features' moments.
    """
    order = np.argsort(stamps, kind="stable")
    stamps, distances = stamps[order], distances[order]
    v, w, gap = _at(log.odometry, stamps)
    broken = np.zeros(len(stamps), bool)
    with np.errstate(invalid="ignore"):
        broken |= ~((distances >= 0.0) & (distances <= task_model.DISTANCE_LIMIT)).all(axis=1)
        broken |= ~((np.abs(v) <= settings.largest_speed) & (np.abs(w) <= settings.largest_turn_rate))
    asked_low, asked_high = envelope(log.user, stamps, settings.command_memory)
    sent_low, sent_high = envelope(log.sent, stamps, settings.command_memory)
    moving = (np.abs(v) >= settings.standing_speed) | (np.abs(w) >= settings.standing_turn_rate)
    commanded = log.sent if log.sent is not None else log.user
    reasons = {
        "impossible": broken,
        "unaligned": gap > settings.odometry_gap,
        "assisted": _assisting(log.assisting, stamps),
        "standing": ~moving,
        "reversing": v < -settings.standing_speed,
    }
    if commanded is not None:
        low, high = (sent_low, sent_high) if log.sent is not None else (asked_low, asked_high)
        reasons["not_commanded"] = (np.maximum(np.abs(low), np.abs(high)) < 1e-3).all(axis=1)
    if log.sent is not None and log.user is not None:
        # limits of acceleration only delay and cut: what goes to the wheels lies between recent requests
        now = _latest(log.sent, stamps)
        reasons["not_the_user"] = (
            (now < asked_low - settings.command_tolerance) | (now > asked_high + settings.command_tolerance)
        ).any(axis=1)
    taken = np.ones(len(stamps), bool)
    left_out = dict.fromkeys(RULES, 0)
    for rule in RULES:
        if rule in reasons:
            left_out[rule] = int((taken & reasons[rule]).sum())
            taken &= ~reasons[rule]
    taken, left_out["too_close"] = _thin(stamps, taken, settings.rate)
    v, w = np.maximum(v[taken], 0.0), w[taken]
    samples = np.column_stack((distances[taken], v, np.maximum(w, 0.0), np.maximum(-w, 0.0)))
    return samples, stamps[taken], left_out


def envelope(commands, stamps, memory):
    """Smallest and largest command (n, 2) in force within ``memory`` [s] before ``stamps`` (n,), zero included.

    Zero is always within: a chair may be slower than asked. Without commands: NaN.
    """
    if commands is None:
        nothing = np.full((len(stamps), 2), np.nan)
        return nothing, nothing
    low, high = np.zeros((len(stamps), 2)), np.zeros((len(stamps), 2))
    # a command is in force from its stamp until the next one
    first = np.searchsorted(commands.stamps, stamps - memory, side="right") - 1
    last = np.searchsorted(commands.stamps, stamps, side="right")
    for i, (begin, end) in enumerate(zip(first, last)):
        if begin >= 0 and stamps[i] - commands.stamps[begin] > 2.0 * memory:
            begin += 1  # long since timed out
        window = commands.values[max(begin, 0) : end]
        if len(window):
            low[i], high[i] = np.minimum(window.min(axis=0), 0.0), np.maximum(window.max(axis=0), 0.0)
    return low, high


def _latest(commands, stamps):
    index = np.searchsorted(commands.stamps, stamps, side="right") - 1
    return np.where(index[:, None] >= 0, commands.values[np.maximum(index, 0)], 0.0)


def _at(odometry, stamps):
    """Speeds v, w (n,) at ``stamps`` by interpolation, and the gap [s] between the messages on both sides."""
    after = np.searchsorted(odometry[:, 0], stamps, side="left")
    before = np.where((after < len(odometry)) & (odometry[np.minimum(after, len(odometry) - 1), 0] == stamps),
        after, after - 1)
    known = (before >= 0) & (after < len(odometry))
    before, after = np.maximum(before, 0), np.minimum(after, len(odometry) - 1)
    gap = np.where(known, odometry[after, 0] - odometry[before, 0], np.inf)
    v = np.interp(stamps, odometry[:, 0], odometry[:, 4])
    w = np.interp(stamps, odometry[:, 0], odometry[:, 5])
    return v, w, gap


def _assisting(states, stamps):
    if not len(states):
        return np.zeros(len(stamps), bool)
    index = np.searchsorted(states[:, 0], stamps, side="right") - 1
    return (index >= 0) & (states[np.maximum(index, 0), 1] > 0.5)


def _thin(stamps, taken, rate):
    """Drop moments that follow the last one taken sooner than ``rate`` [Hz] allows."""
    taken, dropped, last = taken.copy(), 0, -np.inf
    # stamps jitter: nine tenths of the interval is the interval
    shortest = 0.9 / rate
    for index in np.flatnonzero(taken):
        if stamps[index] - last < shortest:
            taken[index] = False
            dropped += 1
        else:
            last = stamps[index]
    return taken, dropped


def _recorded_features(bag, topics):
    """Stamps (n,) and distances (n, 3) of the blender's states."""
    stamps, distances = [], []
    for _, kind, _, message in bag.messages([topics["features"]]):
        if not all(hasattr(message, name) for name in ("header", "d_l", "d_f", "d_r")):
            raise BagError("%s: topic '%s' is %s, not BlendState" % (bag.path, topics["features"], kind))
        stamps.append(conversions.seconds(message.header.stamp))
        distances.append((message.d_l, message.d_f, message.d_r))
    return np.array(stamps), np.array(distances).reshape(-1, 3)


def read_log(bag, topics):
    """``Log`` of an open bag. Raises BagError where it has no odometry, or messages of other types."""
    odometry, sent, user, assisting, offsets, base_frame = [], [], [], [], [], "base_link"
    malformed = []
    for topic, kind, time, message in bag.messages([topics[name] for name in ("odom", "cmd_vel", "user",
        "assistance")]):
        if topic == topics["odom"]:
            if not hasattr(message, "twist") or not hasattr(message, "pose"):
                raise BagError("%s: topic '%s' is %s, not nav_msgs/Odometry" % (bag.path, topic, kind))
            try:
                value = conversions.odometry_of(message)
            except conversions.ConversionError as error:
                malformed.append(str(error))
                continue
            odometry.append((value.stamp,) + tuple(value.pose) + tuple(value.twist))
            offsets.append(value.stamp - time)
            base_frame = bags.plain(message.child_frame_id) or base_frame
        elif topic == topics["assistance"]:
            assisting.append((time, float(getattr(message, "state", 0) == ASSISTING)))
        else:
            twist = getattr(message, "twist", message)  # TwistStamped
            if not hasattr(twist, "linear"):
                raise BagError("%s: topic '%s' is %s, not geometry_msgs/Twist" % (bag.path, topic, kind))
            command = conversions.twist_of(twist)
            if np.isfinite(command).all():
                (sent if topic == topics["cmd_vel"] else user).append((time,) + tuple(Twist(*command)))
    if not odometry:
        raise BagError("%s: no usable odometry on topic '%s'%s" % (
            bag.path, topics["odom"], ": " + malformed[0] if malformed else ""))
    table = np.array(odometry)
    table = table[np.argsort(table[:, 0], kind="stable")]
    if table[0, 0] == table[-1, 0]:
        raise BagError("%s: the stamps of topic '%s' do not advance: all are %.3f s" % (
            bag.path, topics["odom"], table[0, 0]))
    # commands carry no stamp: their time of recording, moved to the clock of the stamps where that is another
    offset = float(np.median(offsets))
    if abs(offset) < 0.5:
        offset = 0.0
    notes = []
    if malformed:
        notes.append("%d odometry messages are malformed, the first one: %s" % (len(malformed), malformed[0]))
    if offset:
        notes.append("stamps and times of recording differ by %.1f s: commands are moved by that" % offset)
    if topics["cmd_vel"] not in bag.topics and not user:
        notes.append("no commands on '%s': every motion counts as the driver's" % topics["cmd_vel"])
    states = np.array(assisting).reshape(-1, 2)
    states[:, 0] += offset
    return Log(table, base_frame, _commands(sent, offset), _commands(user, offset), states, tuple(notes))


def _commands(rows, offset):
    if not rows:
        return None
    table = np.array(rows)
    return Commands(table[:, 0] + offset, table[:, 1:])
