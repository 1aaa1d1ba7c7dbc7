"""Checks of goal reachability that share no code with the planner."""
