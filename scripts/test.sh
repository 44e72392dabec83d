#!/usr/bin/env bash
# Lint, unit tests, rostests: scripts/test.sh [lint|unit|rostest [NAME]]; last line "N passed, N failed".
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
case "${1:-}" in
  -h | --help) sed -n '2s/^# //p' "${BASH_SOURCE[0]}"; exit 0 ;;
esac
"$root/scripts/setup.sh"
. "$root/scripts/env.sh"
exec python "$root/test/run.py" "$@"
