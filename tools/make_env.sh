#!/usr/bin/env bash
# Makes the virtual environment from the lock file: make_env.sh PYTHON VENV
set -euo pipefail
python=$1 venv=$2

command -v "$python" >/dev/null || python=python3
"$python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null || {
  echo "LPET needs Python 3.11 (found: $("$python" --version 2>&1 || true)); on Debian 12: apt-get install python3 python3-venv" >&2
  exit 2
}
if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
  line="apt-get install -y python3-venv"
  echo "Python's venv module is missing: $line" >&2
  [ "$(id -u)" = 0 ] || { echo "Run this line as root, then call make again: $line" >&2; exit 2; }
  apt-get update -qq && $line >/dev/null
fi
"$python" -m venv "$venv"
echo "Installing the locked packages into $venv (about a minute) ..."
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -r requirements.lock
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-deps --editable .
