"""The planners that can fill the slot of ``planner/cmd_vel``: one interface, that of ``navigation.Navigator``."""
from wheelchair_shared_control.errors import Error
from wheelchair_shared_control.planning.bezier import Bezier
from wheelchair_shared_control.planning.navigation import Navigator
from wheelchair_shared_control.planning.potential_field import PotentialField

# names: parameter_tables/move_base.py, which needs no kernels to be read
TABLE = {"move_base": Navigator, "potential_field": PotentialField, "bezier": Bezier}


class PlannerError(Error):
    """A planner is unknown."""


def make(settings, name=None):
    """The planner ``name``, or that of ``base_local_planner``; ``settings`` of group ``move_base``."""
    name = settings.base_local_planner if name is None else name
    if name not in TABLE:
        raise PlannerError("unknown planner '%s': must be one of %s" % (name, ", ".join(TABLE)))
    return TABLE[name](settings)
