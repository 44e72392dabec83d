"""The simulated world: scenes and maps, the chair's physics, its sensors."""
