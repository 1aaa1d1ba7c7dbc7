"""Peers: the estimators of other libraries, run on the same measurements as our own."""
