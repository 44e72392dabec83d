"""The policies: how the user's and the planner's command become one (paper section III-B, and its rivals).

A policy is a function ``(tick, memory) -> PolicyResult``; ``memory`` is a dictionary of its own that lives as
long as one assistance. ``POLICIES`` is the table that node, experiments and benchmark iterate.
"""
import importlib.util
import math
import sys
import traceback
from pathlib import Path

import numpy as np

from wheelchair_shared_control import sweep
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.policy import STICK_AT_REST, PolicyResult, at_rest
from wheelchair_shared_control.policy import Tick as Tick  # the contract, for whoever looks for it here
from wheelchair_shared_control.rivals.case_based import case_based
from wheelchair_shared_control.rivals.efficiency import efficiency
from wheelchair_shared_control.rivals.intent import intent
from wheelchair_shared_control.rivals.minimax import minimax
from wheelchair_shared_control.rivals.minimum_vfh import minimum_vfh
from wheelchair_shared_control.rivals.winner_takes_all import winner_takes_all
from wheelchair_shared_control.values import Twist


class PolicyError(Error):
    """A policy is unknown or its file cannot be used."""


# ---- the paper's equations -----------------------------------------------------------------------------


def user_weight(w_user, w_planner, sigma):
    """beta of Eq. 2, with its limits by value; broadcasts.

    Equal commands give 1, whatever sigma; sigma = 0 with different commands gives 0.
    """
    difference = np.abs(np.asarray(w_user, dtype=float) - w_planner)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        beta = np.exp(-difference / np.asarray(sigma, dtype=float))
    beta = np.where(np.asarray(sigma) > 0.0, beta, 0.0)
    return np.where(difference == 0.0, 1.0, beta)


def blended_turn_rate(w_user, w_planner, beta):
    """w of Eq. 1 [rad/s]; broadcasts. Never outside the two commands, also in floating point."""
    w_user, w_planner = np.asarray(w_user, dtype=float), np.asarray(w_planner, dtype=float)
    w = (1.0 - beta) * w_planner + beta * w_user
    return np.clip(w, np.minimum(w_user, w_planner), np.maximum(w_user, w_planner))


def blended_speed(v_user, v_planner):
    """v of Fig. 2 line 9 [m/s], the mean; opposite directions give 0 (ours: neither wants the mean)."""
    v_user, v_planner = np.asarray(v_user, dtype=float), np.asarray(v_planner, dtype=float)
    return np.where(v_user * v_planner < 0.0, 0.0, 0.5 * (v_planner + v_user))


def side_sigma(w_user, w_planner, sigma_l, sigma_r, straight=1e-3):
    """sigma of Eq. 3 [rad/s]: that of the side to which the planner turns, the user's if it drives straight.

    ``abs(w_planner) < straight`` counts as straight. Both straight: the smaller one (Eq. 3 leaves it open,
    and Eq. 2 then gives 1 for equal commands whichever is taken).
    """
    w_user, w_planner = np.asarray(w_user, dtype=float), np.asarray(w_planner, dtype=float)
    turn = np.where(np.abs(w_planner) < straight, w_user, w_planner)
    sided = np.where(turn > 0.0, sigma_l, sigma_r)
    return np.where(turn == 0.0, np.minimum(sigma_l, sigma_r), sided)


def blend(user, planner, sigma):
    """Command and beta of Eqs. 1 and 2 for a given ``sigma`` [rad/s] (already scaled)."""
    difference = abs(user.w - planner.w)
    if difference == 0.0:
        beta = 1.0
    elif sigma > 0.0:
        beta = math.exp(-min(difference / sigma, 700.0))
    else:
        beta = 0.0
    w = (1.0 - beta) * planner.w + beta * user.w
    w = min(max(w, min(user.w, planner.w)), max(user.w, planner.w))
    v = 0.0 if user.v * planner.v < 0.0 else 0.5 * (planner.v + user.v)
    return Twist(v, w), beta


# ---- the policies --------------------------------------------------------------------------------------

def user(tick, memory):
    """The person drives alone: u_H."""
    return PolicyResult(tick.user, 1.0)


def planner(tick, memory):
    """The planner drives alone: u_P, whatever the stick says."""
    return PolicyResult(tick.planner, 0.0)


def fixed_share(tick, memory):
    """(1 - a) u_P + a u_H with a fixed a."""
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    a = tick.settings.fixed_share.user
    v = 0.0 if tick.user.v * tick.planner.v < 0.0 else (1.0 - a) * tick.planner.v + a * tick.user.v
    return PolicyResult(Twist(v, (1.0 - a) * tick.planner.w + a * tick.user.w), a)


def learned_variance(tick, memory):
    """The paper (section III-B): sigma is the scaled learned standard deviation of the planner's side."""
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    return _blended(tick, paper_sigma(tick))


def distance(tick, memory):
    """The paper's rival (section V-B, note 3): sigma is d_min times the speed over its maximum."""
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    limit = tick.settings.wheelchair.limits.speed
    return _blended(tick, min(tick.features) * min(abs(tick.twist.v) / limit, 1.0))


def learned_confidence(tick, memory):
    """Ours: the paper's sigma where the situation was demonstrated, a bound from clearance where not.

    Derived in ``doc/learned_confidence.md``. Demonstrated means that the input's log density is at least the
    5 % quantile of the training set's; below it the bound takes over within ``confidence/transition``.
    """
    if at_rest(tick.user, tick.settings):
        return STICK_AT_REST
    settings = tick.settings.confidence
    learned = paper_sigma(tick)
    shortfall = tick.density_floor - tick.prediction.log_density
    if shortfall <= 0.0:
        return _unhurried(tick, _blended(tick, learned, "as demonstrated"))
    bound = clearance_sigma(tick)
    if math.isnan(shortfall):  # a model without its quantile: the more careful of the two
        return _unhurried(tick, _blended(tick, min(learned, bound), "the model does not say what it was shown"))
    share = min(shortfall / settings.transition, 1.0)
    _, beta_learned = blend(tick.user, tick.planner, learned)
    _, beta_bound = blend(tick.user, tick.planner, bound)
    beta = (1.0 - share) * beta_learned + share * beta_bound
    sigma = sigma_of(beta, tick.user.w - tick.planner.w, bound)
    return _unhurried(tick, _blended(tick, sigma, "not demonstrated: bounded by clearance"))


def sigma_of(beta, difference, otherwise):
    """The s [rad/s] for which Eq. 2 gives ``beta``; ``otherwise`` where every s does (equal commands)."""
    if difference == 0.0 or beta >= 1.0:
        return otherwise
    return -abs(difference) / math.log(beta) if beta > 0.0 else 0.0


def assisted_teleop(tick, memory):
    """The user's command slowed by its time to collision (Nav2 AssistedTeleop); no planner takes part."""
    settings = tick.settings.assisted_teleop
    scale = min(
        sweep.time_to_collision(
            tick.settings.wheelchair.footprint, tick.pose, tick.user, tick.points, settings.horizon, settings.step
        )
        / settings.horizon,
        1.0,
    )
    reason = "" if scale == 1.0 else "slowed: obstacle in %.1f s" % (scale * settings.horizon)
    return PolicyResult(Twist(tick.user.v * scale, tick.user.w * scale), None, reason)


def paper_sigma(tick):
    """s of Eqs. 2 and 3 [rad/s]: ``sigma_scale`` times the learned deviation of the planner's side."""
    prediction, settings = tick.prediction, tick.settings
    sided = side_sigma(
        tick.user.w, tick.planner.w, prediction.sigma_l, prediction.sigma_r, settings.planner_straight
    )
    return settings.sigma_scale * float(sided)


def clearance_sigma(tick):
    """s [rad/s] for which no user's command moves a front corner further than the nearest obstacle.

    Eq. 1 deviates from the planner by ``D exp(-D / s)``, at most ``s / e`` (at D = s). A deviation that lasts T
    moves the front corners sideways by ``(front T + v T^2 / 2)`` times itself. Setting that equal to the
    clearance gives the bound.
    """
    settings = tick.settings.confidence
    footprint = tick.settings.wheelchair.footprint
    room = max(min(tick.features) - settings.margin, 0.0)
    horizon = settings.horizon
    lever = (footprint.length - footprint.axle_to_rear) * horizon + 0.5 * abs(tick.twist.v) * horizon * horizon
    return math.e * room / lever


def _unhurried(tick, result):
    """``result`` not faster than unseen ground allows, unless the planner drives as fast.

    The mean of Fig. 2 (line 9) lets a person who pushes harder than the planner drive faster over ground that nobody
    has seen than the guard permits, and the guard then brakes what the policy has just asked for. The planner keeps
    to that speed where its way leads over unseen ground; where it drives faster, it has seen that it can.
    """
    allowed = max(tick.settings.guarding.unknown_speed, tick.planner.v)
    if result.command.v <= allowed:
        return result
    return result._replace(command=Twist(allowed, result.command.w), reason=result.reason + ", not faster than seen")


def _blended(tick, sigma, reason=""):
    command, beta = blend(tick.user, tick.planner, sigma)
    return PolicyResult(command, beta, reason, sigma)


POLICIES = {
    "user": user,
    "planner": planner,
    "fixed_share": fixed_share,
    "learned_variance": learned_variance,
    "distance": distance,
    "learned_confidence": learned_confidence,
    "assisted_teleop": assisted_teleop,
    "efficiency": efficiency,
    "minimax": minimax,
    "intent": intent,
    "case_based": case_based,
    "winner_takes_all": winner_takes_all,
    "minimum_vfh": minimum_vfh,
}

# how the words begin with which a policy's own failure ends an assistance
FAILED = ("policy raised", "policy gave")

# What each policy cannot do without; one that is not listed (a function of one's own) is given all there is.
NEEDS_PREDICTION = {"learned_variance", "learned_confidence"}
NEEDS_NO_PLANNER = {"user", "assisted_teleop", "intent", "case_based", "minimum_vfh"}


def load_policy(name):
    """The policy function of a row of the table or of ``path.py:function``. Raises PolicyError."""
    if name in POLICIES:
        return POLICIES[name]
    if ":" not in name:
        raise PolicyError(
            "unknown policy '%s': must be one of %s, or path.py:function" % (name, ", ".join(sorted(POLICIES)))
        )
    path, _, function = name.rpartition(":")
    if not Path(path).is_file():
        raise PolicyError("policy '%s': no file %s" % (name, path))
    spec = importlib.util.spec_from_file_location("policy_" + Path(path).stem, path)
    if spec is None:
        raise PolicyError("policy '%s': %s is no Python file" % (name, path))
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses and pickle look it up
    _import_from(str(Path(path).resolve().parent))
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a stranger's file raises must end in one line
        raise PolicyError("policy '%s': %s" % (name, _in_one_line(error, path)))
    policy = getattr(module, function, None)
    if not callable(policy):
        raise PolicyError("policy '%s': %s has no function '%s'" % (name, path, function))
    return policy


def prepare(policy, settings):
    """What a policy does once before its first tick: its own ``prepare(settings)``, if it carries one."""
    own = getattr(policy, "prepare", None)
    if own is not None:
        try:
            own(settings)
        except Error as error:
            raise PolicyError(str(error))
        except (Exception, SystemExit) as error:  # a stranger's function
            raise PolicyError("policy's prepare: %s" % _in_one_line(error))


def decided(policy, tick, memory):
    """The ``PolicyResult`` of a policy, which may be a plain (command, beta, reason) of somebody's own file.

    Raises PolicyError where it raises anything, or gives no command that a chair could be sent.
    """
    try:
        result = policy(tick, memory)
    except (Exception, SystemExit) as error:  # a stranger's function: the chair must outlive it
        raise PolicyError(FAILED[0] + " %s" % _in_one_line(error))
    try:
        given = result if isinstance(result, PolicyResult) else PolicyResult(*result)
        v, w = given.command
        beta = None if given.beta is None else float(given.beta)
        given = PolicyResult(Twist(float(v), float(w)), beta, given.reason, float(given.sigma))
        if not isinstance(given.reason, str) or (beta is not None and not math.isfinite(beta)):
            raise ValueError
        result = given
    except Exception:  # whatever a stranger's object does when it is unpacked
        raise PolicyError(
            FAILED[1] + " %.80s, not ((v, w), beta, reason): two numbers, a finite number or None, words"
            % " ".join(repr(result).split())
        )
    if not (math.isfinite(result.command.v) and math.isfinite(result.command.w)):
        raise PolicyError(FAILED[1] + " a command that is not finite")
    return result


_FOLDERS = []  # of the policies' files, as far as they were put on the path here


def _import_from(folder):
    """Let what stands in ``folder`` be imported, after all else, and nothing from beside another policy's file."""
    for name, module in list(sys.modules.items()):
        if name != "__main__" and str(Path(getattr(module, "__file__", None) or "").parent) in _FOLDERS:
            del sys.modules[name]
    for former in _FOLDERS:
        if former in sys.path:
            sys.path.remove(former)
    _FOLDERS.clear()
    if folder not in sys.path:
        sys.path.append(folder)
        _FOLDERS.append(folder)


def _in_one_line(error, path=None):
    """An exception in one line, with the line of a stranger's file ``path`` (or of any file) that it came from."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    if path is not None:
        frames = [frame for frame in frames if Path(frame.filename).name == Path(path).name]
    where = " (%s, line %d)" % (Path(frames[-1].filename).name, frames[-1].lineno) if frames else ""
    return "%s: %s%s" % (type(error).__name__, " ".join(str(error).split()), where)


def needs_prediction(name):
    """Whether a policy refuses to work without the task model."""
    return name in NEEDS_PREDICTION


def leads(name):
    """Whether a policy may lead the chair elsewhere than the stick does, and a fault of it must end in letting go."""
    return name not in ("user", "assisted_teleop")


def needs_planner(name):
    """Whether a policy refuses to work without the planner's command."""
    return name not in NEEDS_NO_PLANNER
