"""Where simulation, recordings, estimators and evaluation meet."""
