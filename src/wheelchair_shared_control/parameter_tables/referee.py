"""The referee's node: which episode it watches, and where the result goes."""
from wheelchair_shared_control.parameters import P

INCLUDES = ["wheelchair", "scene"]

TABLE = [
    P("policy", str, "", None, None, "the blender's policy: says whether a refused assistance is the end"),
    P("title", str, "", None, None, "headline of the figure"),
    P("result_file", str, "", None, None, "JSON file for the result; empty: none"),
    P("figure_file", str, "", None, None, "PNG file for the figure; empty: none"),
    P("rate", float, "Hz", 10.0, 200.0, "how often the truth is looked at"),
    P("patience", float, "s", 1.0, 600.0, "wall time without a first command or without the truth: give up"),
]
