"""LPET against its bare counterparts: the same inputs, in one run, side by side."""

import os

# Without it mujoco.Renderer looks for a window system, and draws into LPET's context.
os.environ.setdefault("MUJOCO_GL", "egl")
