"""Estimators: they read measurements alone and give a trajectory with its covariance."""
