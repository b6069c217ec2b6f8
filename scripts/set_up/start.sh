#!/bin/sh
# Start the set-up with any Python that can run it. machine.py chooses the Python of the environment.
here=$(dirname "$0")
for python in python3 python3.13 python3.12 python3.11 /usr/bin/python3; do
    if "$python" -I -S -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
        exec "$python" -I -S -B "$here" "$@"
    fi
done
echo "set-up: no Python 3.11, 3.12 or 3.13 found; install one: sudo apt install python3 python3-venv python3-dev" >&2
exit 1
