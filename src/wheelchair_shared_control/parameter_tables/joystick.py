"""The joystick's device."""
from wheelchair_shared_control.parameters import P

TABLE = [
    P("device", str, "", None, None, "path of the Linux joystick device"),
    P("rate", float, "Hz", 1.0, 100.0, "messages a second while the device answers"),
    P("retry", float, "s", 0.1, 60.0, "between two attempts to open a device that is away"),
]
