"""The task model's node: which model, and which variance."""
from wheelchair_shared_control.parameters import P

TABLE = [
    P("model", str, "", None, None, "paper, full, or a file made by train"),
    P("variance", str, "", None, None, "paper: Eq. 7; total: with the spread of the components' means",
      ("paper", "total")),
]
