"""The simulated user's node: who sits on the chair, and before which door (the simulator's scene)."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["users", "scene"]

TABLE = [
    P("user", str, "", None, None, "name of a simulated user, or a YAML file"),
    P("button", str, "", None, None, "what comes before what the user's name says", ("face_first", "at_once", "never")),
    P("button_number", int, "", 0, 63, "button of joy that X is"),
    P("cancel_number", int, "", 0, 63, "button of joy that circle is"),
    P("rate", float, "Hz", 5.0, 100.0, "commands a second"),
    P("wait_for", list, "", None, None, "topics that must have been heard before the person moves"),
    P("truth_age", float, "s", 0.05, 5.0, "without a newer true pose the stick is let go"),
]
