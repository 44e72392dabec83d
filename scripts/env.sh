# Makes the workspace and its Python environment current in this shell (bash): . scripts/env.sh
# A workspace that was sourced before stays in reach, behind this one.

_wsc_root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
if [ ! -f "$_wsc_root/build/catkin_ws/devel/setup.bash" ] || [ ! -x "$_wsc_root/.venv/bin/python" ]; then
  echo "env.sh: nothing is built yet: run $_wsc_root/scripts/setup.sh first" >&2
  unset _wsc_root
  return 1 2>/dev/null || exit 1
fi

# catkin's scripts read unset variables, and may end with a status that means nothing.
_wsc_flags=$-
set +eu
_wsc_source() { . "$1" --extend; }
if [ -f /opt/ros/noetic/setup.bash ]; then
  _wsc_source /opt/ros/noetic/setup.bash
fi
_wsc_source "$_wsc_root/build/catkin_ws/devel/setup.bash"

# The environment's Python first on the path, once.
PATH=":$PATH:"
PATH="${PATH//:$_wsc_root\/.venv\/bin:/:}"
PATH="${PATH#:}"
export PATH="$_wsc_root/.venv/bin:${PATH%:}"
export VIRTUAL_ENV="$_wsc_root/.venv"
hash -r

case $_wsc_flags in *u*) set -u ;; esac
case $_wsc_flags in *e*) set -e ;; esac
unset _wsc_root _wsc_flags
unset -f _wsc_source
