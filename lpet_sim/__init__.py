"""LPET: localization performance evaluation for planetary rovers."""

__version__ = "0.1.0"
