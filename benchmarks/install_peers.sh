#!/bin/sh
# Install the systems that `make bench` compares with: pip and npm packages into .venv-peers, and Debian's C++ libraries.
# What cannot be installed is named at the end; the benchmark runs with the rest.
cd "$(dirname "$0")/.." || exit 1
PEERS=.venv-peers
missing=""

try() { # name, command …
	name=$1
	shift
	printf '%-28s' "$name"
	if output=$("$@" 2>&1); then
		echo "ok"
	else
		echo "failed: $(echo "$output" | grep -iE 'error|not found|unable' | tail -1)"
		missing="$missing $name"
	fi
}

if ! [ -x $PEERS/bin/python ]; then
	.venv/bin/python -m venv $PEERS 2>/dev/null || python3 -m venv $PEERS || exit 1
fi
# numpy and scipy are what the runner itself needs; the others are independent of each other
for package in numpy scipy python-fcl trimesh rtree coal mujoco newton pybullet; do
	try "$package" $PEERS/bin/python -m pip install --quiet --only-binary :all: "$package"
done

if command -v npm >/dev/null; then
	for package in @dimforge/rapier3d-compat @dimforge/rapier3d-simd-compat jolt-physics; do
		try "$package" npm install --silent --no-audit --no-fund --prefix $PEERS "$package"
	done
else
	echo "npm is not installed: no Rapier, no Jolt"
	missing="$missing npm"
fi

DEBIAN="g++ pkg-config libfcl-dev libbullet-dev libeigen3-dev"
absent=""
for package in $DEBIAN; do
	dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q "install ok" || absent="$absent $package"
done
if [ -z "$absent" ]; then
	:
elif [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
	# shellcheck disable=SC2086  # a list of words
	try "$(echo $absent)" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $absent
else
	echo "FCL and Bullet from C++ need root once: apt-get install$absent"
	missing="$missing$absent"
fi

[ -z "$missing" ] && echo "all peers are installed" || echo "not installed:$missing"
