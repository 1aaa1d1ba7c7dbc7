"""Soil mechanics of a wheel: what a slip gives in traction, side force, sinkage; and back."""
