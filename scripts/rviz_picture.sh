#!/usr/bin/env bash
# Takes a picture of rviz in the middle of a crossing, without a screen: scripts/rviz_picture.sh FILE.png [ARG:=VALUE ...]
# Needs Xvfb and ImageMagick (apt-get install xvfb imagemagick). ARGs are those of demo.launch.
set -eu
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
[ $# -ge 1 ] || { echo "usage: rviz_picture.sh FILE.png [ARG:=VALUE ...]" >&2; exit 2; }
for program in xvfb-run import convert; do
  command -v "$program" > /dev/null || { echo "rviz_picture.sh: needs $program: apt-get install xvfb imagemagick" >&2; exit 1; }
done
picture=$1
shift
# shellcheck source=env.sh
. "$here/env.sh"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
export ROS_MASTER_URI=http://localhost:11399 ROS_HOSTNAME=localhost LIBGL_ALWAYS_SOFTWARE=1 FOLDER="$folder"
# drawn by the processor alone, rviz needs most of it: the simulation is slowed down
xvfb-run -a -s "-screen 0 1500x900x24" bash -c '
  roslaunch --port 11399 wheelchair_shared_control demo.launch rviz:=true realtime_factor:=0.35 camera:=320x240 \
    result_file:="$FOLDER/result.json" "$@" > "$FOLDER/log" 2>&1 &
  for picture in $(seq 10 70); do
    sleep 2
    import -window root "$FOLDER/$picture.png"
    [ -e "$FOLDER/result.json" ] && break
  done
  kill -INT $! 2> /dev/null
  wait' rviz_picture "$@"
[ -e "$folder/result.json" ] || { echo "rviz_picture.sh: the crossing did not end" >&2; tail -5 "$folder/log" >&2; exit 1; }
# the chair is before the door when about two thirds of the pictures with anything on them are taken
mapfile -t taken < <(find "$folder" -name '*.png' -size +100k | sort)
[ ${#taken[@]} -gt 0 ] || { echo "rviz_picture.sh: rviz drew nothing" >&2; exit 1; }
convert "${taken[$((${#taken[@]} * 5 / 9))]}" -crop 1395x900+0+0 +repage -resize 1100x "$picture"
