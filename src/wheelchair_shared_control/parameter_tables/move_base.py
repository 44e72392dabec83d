"""Parameters of the navigation node: the local costmap and its sources, then the planner."""
from wheelchair_shared_control import footprint
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair"]

TABLE = [
    # --- local costmap: names as in costmap_2d where it has the same thing --------------------------------
    P("local_costmap/global_frame", str, "", None, None, "frame that the window is aligned with"),
    P("local_costmap/robot_base_frame", str, "", None, None, "frame of the chair"),
    P("local_costmap/update_frequency", float, "Hz", 1.0, 50.0, "updates of the grid"),
    P("local_costmap/publish_frequency", float, "Hz", 0.0, 50.0, "grids sent out; 0: none"),
    P("local_costmap/width", float, "m", 2.0, 20.0, "side of the window along x"),
    P("local_costmap/height", float, "m", 2.0, 20.0, "side of the window along y"),
    P("local_costmap/resolution", float, "m", 0.01, 0.1, "side of a cell"),
    P("local_costmap/rolling_window", bool, "", None, None, "the window follows the chair (only true is offered)",
      (True,)),
    P("local_costmap/transform_tolerance", float, "s", 0.0, 2.0, "how long a transform may be late"),
    P("local_costmap/footprint", list, "", None, None, "corners [[x, y], ...]: none, or those of the chair"),
    P("local_costmap/footprint_padding", float, "m", 0.0, 0.2, "added to every edge of the footprint"),
    P("local_costmap/always_send_full_costmap", bool, "", None, None, "full grids instead of updates"),
    P("local_costmap/track_unknown_space", bool, "", None, None, "unknown is 255 (-1 on the wire), else free"),
    P("local_costmap/observation_sources", str, "", None, None, "names of the sources, separated by blanks"),
    P("local_costmap/inflation_radius", float, "m", 0.0, 3.0, "reach of the cost about a lethal cell"),
    P("local_costmap/cost_scaling_factor", float, "1/m", 0.1, 100.0, "decay k of floor(252 exp(-k (d - r)))"),
    # --- local costmap: ours -----------------------------------------------------------------------------
    # Up to 0.85, log-odds of 1.73: below the least log_odds_max, or nothing would ever be lethal.
    P("local_costmap/lethal_probability", float, "", 0.5, 0.85, "a cell is lethal from this probability on"),
    P("local_costmap/hit", float, "", 0.1, 5.0, "log-odds that one clear hit adds"),
    P("local_costmap/miss", float, "", 0.0, 5.0, "log-odds that one look through a cell takes away"),
    P("local_costmap/log_odds_min", float, "", -5.0, 0.0, "least log-odds; near 0 an intruder shows at once"),
    P("local_costmap/log_odds_max", float, "", 1.75, 5.0, "largest log-odds; small, so that the newest look wins"),
    P("local_costmap/start_margin", float, "m", 0.0, 1.0, "ground about the first footprint taken as free"),
    P("local_costmap/start_trust", float, "m", 0.0, 1.0, "the part of it that the chair may reverse over unseen"),
    P("local_costmap/floor_tolerance", float, "m", 0.01, 0.2, "returns this far below the floor are drop-offs"),
    P("local_costmap/pitch_tolerance", float, "rad", 0.0, 0.1, "error of the camera's pitch that is tracked"),
    P("local_costmap/floor_near", float, "m", 0.0, 5.0, "from this distance of the camera on the floor must be seen"),
    P("local_costmap/floor_far", float, "m", 0.0, 5.0, "up to this distance of the camera the floor must be seen"),
    P("local_costmap/static_time", float, "s", 0.0, 60.0, "what was seen for so long out of view is kept for good"),
    P("local_costmap/memory_time", float, "s", 0.1, 600.0, "what was seen more briefly is forgotten after this"),
    P("local_costmap/distance_cap", float, "m", 0.1, 10.0, "distances are measured up to this"),
]

# --- planner ---------------------------------------------------------------------------------------------
PLANNERS = ("move_base", "potential_field", "bezier")
TABLE += [
    P("base_local_planner", str, "", None, None, "what plans: move_base is ours, the others are rivals", PLANNERS),
    P("controller_frequency", float, "Hz", 2.0, 100.0, "commands"),
    P("planner_frequency", float, "Hz", 0.1, 20.0, "searches for a better path while one is followed"),
    P("controller_patience", float, "s", 0.1, 60.0, "without a legal command: then recovery, then abort"),
    P("planner_patience", float, "s", 0.1, 60.0, "without a path: then recovery, then abort"),
    P("oscillation_timeout", float, "s", 0.0, 60.0, "without progress by the distance: then abort; 0: never"),
    P("oscillation_distance", float, "m", 0.01, 5.0, "motion that counts as progress (a turn: of the outer corner)"),
    P("recovery_behavior_enabled", bool, "", None, None, "clear the costmap out of the footprint's reach"),
    P("recovery_radius", float, "m", 0.1, 10.0, "farther than this from base_link the costmap is cleared"),
    P("costmap_timeout", float, "s", 0.05, 5.0, "oldest grid that is driven on"),
    P("odom_timeout", float, "s", 0.05, 5.0, "oldest odometry that is driven on"),
    P("planner/max_vel_x", float, "m/s", 0.05, 2.0, "forward speed"),
    P("planner/min_vel_x", float, "m/s", -1.0, 0.0, "reverse speed; 0: never reverses"),
    P("planner/max_vel_theta", float, "rad/s", 0.05, 3.0, "turn rate"),
    P("planner/acc_lim_x", float, "m/s2", 0.05, 5.0, "acceleration"),
    P("planner/acc_lim_theta", float, "rad/s2", 0.05, 10.0, "turn acceleration"),
    P("planner/xy_goal_tolerance", float, "m", 0.01, 1.0, "distance from the goal that counts as reached"),
    P("planner/yaw_goal_tolerance", float, "rad", 0.01, 3.2, "heading off the goal's that counts as reached"),
    P("planner/sim_time", float, "s", 0.2, 5.0, "how far candidate trajectories are driven ahead"),
    P("planner/max_expansions", int, "", 100, 200000, "states that one search may expand"),
    P("planner/speed_at_contact", float, "m/s", 0.02, 1.0, "speed with no clearance at all"),
    P("planner/speed_per_clearance", float, "1/s", 0.0, 20.0, "speed gained per metre of clearance"),
    P("planner/speed_in_unknown", float, "m/s", 0.02, 1.0, "speed towards ground that was not seen"),
    P("planner/min_clearance", float, "m", 0.0, 0.2, "least distance to what is in a lethal cell that is planned"),
    P("planner/turn_clearance", float, "m", 0.0, 0.3, "the same for turns on the spot, which swing the corners"),
    P("planner/margin", float, "m", 0.0, 0.2, "no command brings what is in a lethal cell closer at standstill"),
    P("planner/margin_per_speed", float, "s", 0.0, 0.5, "added to it per m/s of the outermost corner"),
]

# --- the rival planners ------------------------------------------------------------------------------------
TABLE += [
    P("potential_field/far", float, "m", 0.05, 10.0, "nearer to the goal its attraction falls in proportion"),
    P("potential_field/repulsion", float, "m2", 0.0, 1.0, "eta: repulsion in units of the attraction"),
    P("potential_field/reach", float, "m", 0.05, 1.5, "r0: what is farther away does not repel"),
    P("potential_field/closest", float, "m", 0.005, 0.5, "smallest r that the repulsion is computed for"),
    P("potential_field/speed_gain", float, "m/s", 0.01, 10.0, "speed per force along the heading"),
    P("potential_field/turn_gain", float, "rad/s", 0.01, 100.0, "turn rate per force across"),
    P("bezier/door_before_goal", float, "m", 0.0, 5.0, "the door lies so far behind the goal"),
    P("bezier/hand_over", float, "m", 0.0, 5.0, "nearer to the door the curve goes to the goal"),
    P("bezier/aside", float, "rad", 0.1, 3.2, "a target farther off the heading is turned to first"),
    P("bezier/square", float, "m", 0.0, 5.0, "the point to turn to lies so far before the door"),
    P("bezier/near", float, "m", 0.0, 2.0, "this near to that point the chair turns to the door's normal"),
    P("bezier/turned", float, "rad", 0.01, 1.0, "a turn on the spot with no more left is done"),
    P("bezier/clearance_weight", float, "1/m3", 0.0, 10000.0, "of missing clearance against bending"),
]

DATA_TYPES = ("Image", "PointCloud2", "LaserScan", "Range")


def source_rows(name):
    """The rows of one observation source, as costmap_2d names them."""
    key = "local_costmap/" + name + "/"
    return [
        P(key + "topic", str, "", None, None, "topic; for Image the camera_info lies beside it; for Range a prefix"),
        P(key + "sensor_frame", str, "", None, None, "frame of the sensor; empty: that of the message"),
        P(key + "data_type", str, "", None, None, "type of the message", DATA_TYPES),
        P(key + "marking", bool, "", None, None, "may mark obstacles"),
        P(key + "clearing", bool, "", None, None, "may clear obstacles"),
        P(key + "min_obstacle_height", float, "m", -1.0, 3.0, "lowest return that marks"),
        P(key + "max_obstacle_height", float, "m", 0.0, 3.0, "highest return that marks"),
        P(key + "obstacle_range", float, "m", 0.1, 20.0, "farthest return that marks"),
        P(key + "raytrace_range", float, "m", 0.1, 20.0, "how far rays clear"),
        P(key + "inf_is_valid", bool, "", None, None, "+Inf says that nothing is within range (REP 117)"),
        P(key + "expected_update_rate", float, "s", 0.0, 60.0, "interval between messages; 0: not required"),
    ]


def given_rows(given):
    """Rows of the sources that ``given`` (nested parameters) describes: their names are the user's."""
    costmap = given.get("local_costmap")
    if not isinstance(costmap, dict):
        return []
    names = [name for name, value in costmap.items() if isinstance(value, dict)]
    listed = costmap.get("observation_sources", "")
    names += [name for name in (listed.split() if isinstance(listed, str) else ()) if name not in names]
    return [row for name in names for row in source_rows(name)]


SAME = 0.005  # m: two outlines whose corners differ by less are the same


def contradiction(settings):
    """What the parameters contradict each other in, in words; "" if in nothing."""
    costmap = settings.local_costmap
    for name in ("global_frame", "robot_base_frame"):
        if not getattr(costmap, name):
            return "parameter 'local_costmap/%s' is empty" % name
    if costmap.floor_near >= costmap.floor_far:
        return "parameter 'local_costmap/floor_near' is %g, but must be below 'floor_far', %g m" % (
            costmap.floor_near, costmap.floor_far)
    for name in costmap.observation_sources.split():
        source = getattr(costmap, name)
        if not source.topic:
            return "parameter 'local_costmap/%s/topic' is empty" % name
        if source.min_obstacle_height >= source.max_obstacle_height:
            return (
                "parameter 'local_costmap/%s/min_obstacle_height' is %g, but must be below 'max_obstacle_height', %g m"
                % (name, source.min_obstacle_height, source.max_obstacle_height))
    return _another_outline(costmap.footprint, footprint.from_settings(settings.wheelchair))


def _another_outline(given, chair):
    """Why the corners ``given`` are not those of the ``chair``, whom the guard goes by, too; "" if they are."""
    key = "parameter 'local_costmap/footprint' "
    try:
        corners = [(float(x), float(y)) for x, y in given]
    except (TypeError, ValueError):
        return key + "is %r, but must be a list of corners [x, y] in m" % (given,)
    wanted = [(x, y) for x in (chair.rear, chair.front) for y in (-chair.half_width, chair.half_width)]

    def has(points, point):
        return any(abs(point[0] - x) <= SAME and abs(point[1] - y) <= SAME for x, y in points)

    if corners and not (all(has(wanted, c) for c in corners) and all(has(corners, w) for w in wanted)):
        return key + "is %r, but must be empty or the corners of 'wheelchair/footprint', %s m" % (
            given, ", ".join("[%g, %g]" % corner for corner in wanted))
    return ""
