"""The rover: its spec, kinematics, scene and drive."""
