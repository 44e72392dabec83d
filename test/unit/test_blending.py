"""The blend: equations 1-3 against a table computed by hand, and their properties over a million inputs."""
import math

import numpy as np
import pytest

from wheelchair_shared_control import blending, parameters
from wheelchair_shared_control.blending import POLICIES, Tick
from wheelchair_shared_control.task_model import Prediction
from wheelchair_shared_control.values import STOP, Twist

SETTINGS = parameters.load("blender")
N = 1000000
E1 = 0.36787944117144233  # exp(-1)


def tick(user, planner, **changes):
    """A tick in free space with a model that allows 0.1 rad/s to the left and 0.2 rad/s to the right."""
    values = dict(
        now=0.0, user=Twist(*user), planner=Twist(*planner), pose=np.zeros(3), twist=Twist(0.3, 0.0),
        features=(2.0, 2.0, 2.0), clearance=2.0, prediction=Prediction(0.0, 0.0, 0.1, 0.2, 0.0), density_floor=-5.0,
        grid=None, points=np.empty((0, 2)), goal=None, doorway=None, doorways=(), settings=SETTINGS,
    )
    values.update(changes)
    return Tick(**values)


# (title, user, planner, expected command, expected beta) with sigma = 3 x (0.1 left, 0.2 right)
BY_HAND = [
    # planner turns left: s = 0.3, |0.5 - 0.2| / 0.3 = 1, beta = 1/e, w = 0.2 + 0.3/e
    ("planner left", (0.4, 0.5), (0.2, 0.2), (0.3, 0.2 + 0.3 * E1), E1),
    # planner turns right: s = 0.6, |0.4 + 0.2| / 0.6 = 1, w = -0.2 + 0.6/e
    ("planner right, user left", (0.4, 0.4), (0.4, -0.2), (0.4, -0.2 + 0.6 * E1), E1),
    # planner straight: the user's side; left s = 0.3, 0.6 / 0.3 = 2
    ("planner straight, user left", (0.2, 0.6), (0.2, 0.0), (0.2, 0.6 * E1**2), E1**2),
    # right s = 0.6, 0.6 / 0.6 = 1
    ("planner straight, user right", (0.2, -0.6), (0.2, 0.0), (0.2, -0.6 * E1), E1),
    # 0.0005 rad/s is straight: the user's side (right, 0.6) although the sign says left (0.3)
    ("planner as good as straight", (0.2, -0.5995), (0.2, 0.0005), (0.2, 0.0005 - 0.6 * E1), E1),
    ("both straight", (0.4, 0.0), (0.2, 0.0), (0.3, 0.0), 1.0),
    ("the same turn", (0.4, 0.3), (0.2, 0.3), (0.3, 0.3), 1.0),
    ("opposite directions of travel stop", (-0.4, 0.5), (0.2, 0.2), (0.0, 0.2 + 0.3 * E1), E1),
    ("one of them stands", (0.4, 0.2), (0.0, 0.2), (0.2, 0.2), 1.0),
    ("both reverse", (-0.4, 0.2), (-0.2, 0.2), (-0.3, 0.2), 1.0),
    ("stick at rest", (0.019, -0.019), (0.5, 0.4), (0.0, 0.0), None),
    ("stick just outside its dead zone", (0.02, 0.2), (0.5, 0.2), (0.26, 0.2), 1.0),
]


@pytest.mark.parametrize("title, user, planner, command, beta", BY_HAND, ids=[row[0] for row in BY_HAND])
def test_learned_variance_by_hand(title, user, planner, command, beta):
    result = POLICIES["learned_variance"](tick(user, planner), {})
    assert result.command == pytest.approx(command, abs=1e-12)
    assert result.beta == (None if beta is None else pytest.approx(beta, abs=1e-12))


def test_limits_of_beta_by_value():
    beta = blending.user_weight([0.3, 0.3, 0.0, 0.3, 0.3], [0.3, 0.1, 0.0, 0.1, 0.1], [0.0, 0.0, 0.0, 1e-300, np.inf])
    # equal commands: 1 even for s = 0; s = 0 with different ones: 0; tiny s: 0; endless s: 1
    assert beta.tolist() == [1.0, 0.0, 1.0, 0.0, 1.0]


def random_inputs(rng):
    """A million cases, a share of them at the limits: equal commands, zero sigma, straight planner."""
    w_user, w_planner = rng.uniform(-1, 1, (2, N))
    sigma = 10.0 ** rng.uniform(-9, 2, (2, N))
    w_planner[: N // 20] = w_user[: N // 20]
    w_planner[N // 20 : N // 10] = 0.0
    w_user[N // 10 : N // 7] = 0.0
    sigma[:, N // 7 : N // 5] = 0.0
    sigma[0, N // 5 : N // 4] = 0.0
    return w_user, w_planner, sigma[0], sigma[1]


def test_properties_over_a_million_inputs():
    rng = np.random.default_rng(6)
    w_user, w_planner, sigma_l, sigma_r = random_inputs(rng)
    sigma = blending.side_sigma(w_user, w_planner, sigma_l, sigma_r)
    beta = blending.user_weight(w_user, w_planner, sigma)
    w = blending.blended_turn_rate(w_user, w_planner, beta)
    assert np.isfinite(beta).all() and np.isfinite(w).all()
    assert ((beta >= 0.0) & (beta <= 1.0)).all()
    assert ((w >= np.minimum(w_user, w_planner)) & (w <= np.maximum(w_user, w_planner))).all()
    # monotone: more sigma, no less of the user; more disagreement, no more of the user
    assert (blending.user_weight(w_user, w_planner, sigma * 1.3 + 1e-6) >= beta).all()
    further = w_user + np.where(w_user >= w_planner, 0.1, -0.1)
    assert (blending.user_weight(further, w_planner, sigma) <= beta).all()
    # mirrored: left becomes right, and the command its negative
    mirrored = blending.side_sigma(-w_user, -w_planner, sigma_r, sigma_l)
    assert (mirrored == sigma).all()
    assert (blending.user_weight(-w_user, -w_planner, mirrored) == beta).all()
    assert (blending.blended_turn_rate(-w_user, -w_planner, beta) == -w).all()
    # Eq. 1 never deviates from the planner by more than s / e: what doc/learned_confidence.md rests on
    assert (np.abs(w - w_planner) <= sigma / math.e + 1e-12).all()


def test_speed_over_a_million_inputs():
    rng = np.random.default_rng(7)
    v_user, v_planner = rng.uniform(-0.6, 0.6, (2, N))
    v = blending.blended_speed(v_user, v_planner)
    low, high = np.minimum(v_user, v_planner), np.maximum(v_user, v_planner)
    assert ((v >= low) & (v <= high)).all()
    opposite = v_user * v_planner < 0.0
    assert (v[opposite] == 0.0).all() and (v[~opposite] == 0.5 * (v_user + v_planner)[~opposite]).all()


def test_the_scalar_blend_is_the_vector_one():
    rng = np.random.default_rng(8)
    w_user, w_planner, sigma_l, _ = (column[:: N // 2000] for column in random_inputs(rng))
    v_user, v_planner = rng.uniform(-0.6, 0.6, (2, len(w_user)))
    beta = blending.user_weight(w_user, w_planner, sigma_l)
    w = blending.blended_turn_rate(w_user, w_planner, beta)
    v = blending.blended_speed(v_user, v_planner)
    for i in range(len(w)):
        command, one = blending.blend(Twist(v_user[i], w_user[i]), Twist(v_planner[i], w_planner[i]), sigma_l[i])
        assert (command.v, command.w, one) == pytest.approx((v[i], w[i], beta[i]), abs=1e-12)


@pytest.mark.parametrize("name", sorted(set(POLICIES) - {"planner"}))
def test_a_stick_at_rest_stops_the_chair(name):
    assert POLICIES[name](tick((0.0, 0.0), (0.5, 0.4)), {}).command == STOP


def test_the_planner_alone_may_reverse_with_the_stick_at_rest():
    assert POLICIES["planner"](tick((0.0, 0.0), (-0.2, 0.4)), {}).command == Twist(-0.2, 0.4)


def test_fixed_share_is_the_weighted_mean():
    half = SETTINGS.replace(**{"fixed_share/user": 0.25})
    result = POLICIES["fixed_share"](tick((0.4, 0.8), (0.2, 0.0), settings=half), {})
    # 0.75 * 0.2 + 0.25 * 0.4 = 0.25; 0.75 * 0 + 0.25 * 0.8 = 0.2
    assert result.command == pytest.approx((0.25, 0.2)) and result.beta == 0.25


def test_distance_uses_the_nearest_feature_and_the_normalised_speed():
    # s = 0.4 m * |-0.3| / 0.6 = 0.2; |0.3 - 0.1| / 0.2 = 1
    result = POLICIES["distance"](
        tick((0.4, 0.3), (0.4, 0.1), features=(2.0, 0.4, 0.9), twist=Twist(-0.3, 0.0)), {}
    )
    assert result.beta == pytest.approx(E1) and result.sigma == pytest.approx(0.2)


@pytest.mark.parametrize(
    "distance_m, scale",
    [
        (2.0, 1.0),  # 0.6 m/s for 1 s covers 0.6 m of 1.3 m
        # front edge at 0.7, point at 1.005: 0.305 m at 0.06 m a step; the sixth step hits, so 0.5 s are free
        (1.0, 0.5),
        (0.72, 0.0),
    ],
)
def test_assisted_teleop_slows_by_the_time_to_collision(distance_m, scale):
    # points off the step's grid, so that no rounding decides
    points = np.array([[distance_m + 0.005, 0.1]])
    result = POLICIES["assisted_teleop"](tick((0.6, 0.0), (0.0, 0.0), points=points), {})
    assert result.command == pytest.approx((0.6 * scale, 0.0)) and result.beta is None


class TestLearnedConfidence:
    policy = staticmethod(POLICIES["learned_confidence"])

    @pytest.mark.parametrize("excess", [0.0, 0.1, 20.0])
    def test_is_the_paper_where_it_was_demonstrated(self, excess):
        rng = np.random.default_rng(9)
        for _ in range(200):
            prediction = Prediction(0.0, 0.0, *rng.uniform(0.0, 0.5, 2), -5.0 + excess)
            case = tick(
                rng.uniform(-0.6, 0.6, 2), rng.uniform(-0.6, 0.6, 2), prediction=prediction,
                features=tuple(rng.uniform(0, 2, 3)),
            )
            assert self.policy(case, {}).beta == POLICIES["learned_variance"](case, {}).beta

    def bounded(self, user, planner, features, v=0.3, sigma=0.0):
        strange = Prediction(0.0, 0.0, sigma, sigma, -1e3)
        return self.policy(
            tick(user, planner, prediction=strange, features=features, clearance=min(features), twist=Twist(v, 0.0)),
            {},
        )

    def test_unseen_does_not_mean_forbidden(self):
        # A model that allows nothing, in the open: the bound alone speaks.
        # T = 5 s: s = e (2 - 0.03) / (0.7 * 5 + 0.3 * 25 / 2) = 0.739, beta = exp(-0.5 / 0.739) = 0.508
        assert self.bounded((0.4, 0.5), (0.4, 0.0), (2.0, 2.0, 2.0)).beta == pytest.approx(0.508, abs=0.001)

    def test_unseen_does_not_mean_free(self):
        # A model that allows everything, 4 cm beside a wall: the planner turns.
        assert self.bounded((0.4, 0.5), (0.4, 0.0), (0.04, 2.0, 2.0), sigma=10.0).beta < 0.01

    def test_no_command_moves_a_corner_further_than_the_clearance(self):
        settings = SETTINGS.confidence
        for room in (0.05, 0.1, 0.3, 1.0):
            for v in (0.0, 0.3, 0.6):
                for w in np.linspace(0.01, 1.0, 50):
                    result = self.bounded((v, w), (v, 0.0), (room, 2.0, 2.0), v=v)
                    t = settings.horizon
                    # small angles: the front corners, 0.7 m ahead, move 0.7 w t + v w t^2 / 2 to the left
                    moved = result.command.w * (0.7 * t + 0.5 * v * t * t)
                    assert moved <= room - settings.margin + 1e-9

    @pytest.mark.parametrize(
        "v_user, v_planner, v",
        [
            (0.5, 0.29, 0.3),  # their mean is 0.395: the guard would brake it over unseen ground
            (0.3, 0.2, 0.25),  # the mean is slow enough
            (0.6, 0.5, 0.5),  # no faster than the planner, who sees where
            (0.4, 0.5, 0.45),  # a person who wants to go slower is heard
            (-0.6, -0.2, -0.4),  # back: the guard alone
        ],
    )
    @pytest.mark.parametrize("log_density", [0.0, -100.0])
    def test_pushing_harder_than_the_planner_is_no_way_over_unseen_ground(self, v_user, v_planner, v, log_density):
        prediction = Prediction(0.0, 0.0, 0.1, 0.1, log_density)
        case = tick((v_user, 0.3), (v_planner, 0.2), prediction=prediction)
        assert SETTINGS.guarding.unknown_speed == 0.3
        result = self.policy(case, {})
        assert result.command.v == pytest.approx(v)
        assert ("not faster than seen" in result.reason) == (v < 0.5 * (v_user + v_planner) - 1e-9)

    def test_takes_over_without_a_step(self):
        betas = []
        for log_density in np.linspace(-4.0, -12.0, 200):
            prediction = Prediction(0.0, 0.0, 0.05, 0.05, log_density)
            betas.append(self.policy(tick((0.4, 0.5), (0.4, 0.0), prediction=prediction), {}).beta)
        assert np.abs(np.diff(betas)).max() < 0.1
        assert betas[-1] > betas[0]

    def test_without_the_quantile_the_more_careful_of_the_two_rules(self):
        wide = Prediction(0.0, 0.0, 10.0, 10.0, 0.0)
        near = tick(
            (0.4, 0.5), (0.4, 0.0), prediction=wide, features=(0.05, 2.0, 2.0), clearance=0.05,
            density_floor=math.nan,
        )
        assert self.policy(near, {}).beta < 0.05
        narrow = tick((0.4, 0.5), (0.4, 0.0), prediction=Prediction(0, 0, 1e-3, 1e-3, 0.0), density_floor=math.nan)
        assert self.policy(narrow, {}).beta < 1e-6


def test_a_policy_of_ones_own(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "def careful(tick, memory):\n    memory['n'] = memory.get('n', 0) + 1\n    return tick.user, memory['n']\n"
    )
    policy, memory = blending.load_policy("%s:careful" % path), {}
    policy(tick((0.1, 0.2), (0.3, 0.4)), memory)
    assert policy(tick((0.1, 0.2), (0.3, 0.4)), memory) == (Twist(0.1, 0.2), 2)


@pytest.mark.parametrize(
    "name, words",
    [
        ("best", "unknown policy 'best': must be one of assisted_teleop, case_based"),
        ("/nowhere/p.py:f", "no file /nowhere/p.py"),
        ("{path}:missing", "has no function 'missing'"),
        ("{broken}:f", "SyntaxError"),
    ],
)
def test_a_policy_that_cannot_be_used_says_why(tmp_path, name, words):
    (tmp_path / "p.py").write_text("f = None\n")
    (tmp_path / "broken.py").write_text("def f(:\n")
    with pytest.raises(blending.PolicyError) as error:
        blending.load_policy(name.format(path=tmp_path / "p.py", broken=tmp_path / "broken.py"))
    assert words in str(error.value) and "\n" not in str(error.value)
