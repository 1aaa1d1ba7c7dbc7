#!/usr/bin/env bash
# Checks that an offscreen OpenGL context can be made, and installs Mesa's where it may: check_opengl.sh PYTHON
set -euo pipefail
python=$1
line="apt-get install -y libegl1 libgl1 libglx-mesa0 libegl-mesa0 libgl1-mesa-dri"

has_opengl() {
  "$python" -c 'import mujoco; c = mujoco.GLContext(64, 64); c.make_current(); c.free()' >/dev/null 2>&1
}

has_opengl && exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
  echo "No offscreen OpenGL found; installing Mesa's: $line" >&2
  apt-get update -qq && $line >/dev/null
  has_opengl && exit 0
fi
echo "No offscreen OpenGL (EGL) here. Run this line as root, then call make again: $line" >&2
exit 2
