"""Pieces of the paper's experiment, which `scenarios.paper_experiment` puts together."""
