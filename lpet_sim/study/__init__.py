"""The chain: one traverse with its scores, and the whole study from requirement to verdict."""
