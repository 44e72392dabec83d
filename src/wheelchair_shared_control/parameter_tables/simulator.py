"""The simulator: physics, sensor noise, rates; the chair and the scene stand beside it."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair", "scene"]

TABLE = [
    P("physics_step", float, "s", 0.001, 0.01, "time step of pybullet"),
    P("command_timeout", float, "s", 0.05, 5.0, "a command older than this counts as zero"),
    P("wheel_friction", float, "", 0.05, 2.0, "friction between drive wheels and floor: low values slip"),
    P("wheel_torque", float, "N m", 1.0, 500.0, "largest torque of one drive wheel"),
    P("odometry/scale_error", float, "", 0.0, 0.2, "standard deviation of the distance's scale, drawn per episode"),
    P("odometry/yaw_drift", float, "rad/m", 0.0, 0.2, "standard deviation of the yaw drift, drawn per episode"),
    P("odometry/factor", float, "", 0.0, 10.0, "both odometry errors times this"),
    P("depth_noise/sigma_base", float, "m", 0.0, 0.5, "standard deviation of depth at sigma_from"),
    P("depth_noise/sigma_square", float, "1/m", 0.0, 0.5, "growth of it with the square of the depth"),
    P("depth_noise/sigma_from", float, "m", 0.0, 2.0, "depth from which it grows"),
    P("depth_noise/baseline", float, "m", 0.001, 1.0, "between projector and camera"),
    P("depth_noise/disparity_step", float, "pixels", 0.0, 4.0, "quantum of disparity; 0: not quantised"),
    P("depth_noise/grazing", float, "rad", 0.1, 1.5707963, "no depth beyond this angle of incidence"),
    P("depth_noise/edge_pixels", int, "pixels", 0, 16, "no depth this near an edge, in a full-size image"),
    P("depth_noise/edge_step", float, "m", 0.001, 1.0, "jump in depth between neighbours that is an edge"),
    P("ranges_noise", float, "", 0.0, 0.5, "standard deviation of a ranger's reading relative to it"),
    P("camera_width", int, "pixels", 16, 4096, "columns of the published image; intrinsics are scaled"),
    P("camera_height", int, "pixels", 12, 4096, "rows of the published image"),
    P("depth_encoding", str, "", None, None, "32FC1: metres; 16UC1: millimetres, 0 invalid", ("32FC1", "16UC1")),
    P("person", bool, "", None, None, "a person walks across the chair's way"),
    P("realtime_factor", float, "", 0.01, 100.0, "simulated over wall time that the node holds"),
    P("clock_rate", float, "Hz", 10.0, 1000.0, "of clock, in simulated time"),
    P("odometry_rate", float, "Hz", 1.0, 200.0, "of odom, tf, joint_states, ground_truth/odom"),
    P("camera_rate", float, "Hz", 0.5, 60.0, "of depth images"),
    P("ranges_rate", float, "Hz", 0.5, 100.0, "of every ranger"),
    P("contacts_rate", float, "Hz", 0.5, 200.0, "of contacts"),
]
