"""The scene: which world, which door, where the chair starts; simulator and simulated user share it."""
from wheelchair_shared_control.parameters import P

TABLE = [
    P("scene", str, "", None, None, "open, left_wall, right_wall, hallway, or a scene's YAML file"),
    P("map", str, "", None, None, "map_server YAML, .sdf, .obj, .stl, .dae or .ply file; empty: the scene is used"),
    P("doors", str, "", None, None, "YAML file with the map's annotated doors; empty: none"),
    P("door", str, "", None, None, "name of the door to cross; empty: the first"),
    P("side", int, "", 0, 1, "annotated side of the door where the chair starts"),
    P("door_width", float, "m", 0.3, 2.0, "clear width of the door in the four scenes"),
    P("door_height", float, "m", 1.4, 2.4, "height of the lintel in the four scenes"),
    P("wall_thickness", float, "m", 0.02, 0.6, "thickness of the door's wall in the four scenes"),
    P("wall_height", float, "m", 1.5, 5.0, "height of walls, also of those raised from a map"),
    P("clutter", bool, "", None, None, "3-6 boxes of 0.2-0.6 m stand about"),
    P("seed", int, "", 0, 2**31 - 1, "fixes start, clutter, noise and user"),
    P("start_pose", list, "m, rad", None, None, "x, y, yaw of base_link in the world; empty: drawn by the seed"),
    P("start_distance", list, "m", None, None, "base_link to the door plane: low, high of the draw"),
    P("start_heading", list, "degrees", None, None, "heading to the door's normal, left positive: low, high"),
    P("start_offset", list, "m", None, None, "base_link beside the door's axis, left positive: low, high"),
]
