"""Estimators of other people's: found by entry point or command, run apart, looked over."""
