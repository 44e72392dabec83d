"""Planning in the rolling window: path search, refinement, following, and the navigation state machine."""
