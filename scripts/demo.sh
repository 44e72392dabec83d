#!/usr/bin/env bash
# Installs and builds what is missing, then crosses a doorway with all nodes running. Options: --help.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
case "${1:-}" in
  -h | --help)
    [ -x "$here/../.venv/bin/python" ] || {
      echo "usage: scripts/demo.sh [--rviz] [--scene S] [--user U] [--policy P] [--seed K] ...: installs and builds what is"
      echo "missing (apt, pip, catkin), then crosses a doorway. Once that is done, --help lists all options."
      exit 0
    } ;;
  *) "$here/setup.sh" >&2 ;;
esac
# shellcheck source=env.sh
. "$here/env.sh"
exec rosrun wheelchair_shared_control demo "$@"
