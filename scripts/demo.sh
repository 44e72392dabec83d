#!/usr/bin/env bash
# Installs and builds what is missing, then crosses a doorway with all nodes running. Options: --help.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
"$here/setup.sh" >&2
# shellcheck source=env.sh
. "$here/env.sh"
exec rosrun wheelchair_shared_control demo "$@"
