"""LPET against its bare counterparts: the same inputs, in one run, side by side."""
