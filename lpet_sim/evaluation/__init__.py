"""Errors, consistency and the verdict against a requirement."""
