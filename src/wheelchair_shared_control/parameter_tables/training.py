"""Fitting the task model (Goil 2013, III-C and IV-C)."""
from wheelchair_shared_control.parameters import P

TABLE = [
    P("components", int, "", 1, 100, "Gaussians K (the paper: 3)"),
    P("input_floor", float, "", 1e-4, 1.0,
        "standard deviation added to distances and speed, as a share of their range"),
    P("output_floor", float, "", 1e-4, 1.0, "standard deviation added to turn rates, as a share of their range"),
    P("initialisations", int, "", 1, 1000, "k-means starts, the likeliest fit is kept"),
    P("initialisations_in_short", int, "", 1, 1000, "the same where a fit only judges: other K, bags left out"),
    P("iterations", int, "", 10, 100000, "most steps of expectation-maximisation"),
    P("tolerance", float, "", 1e-12, 0.1, "smallest gain of the mean log likelihood that goes on"),
]
