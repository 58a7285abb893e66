#!/bin/sh
# The command `galloping` of a clone, as .venv/bin/galloping: wherever the clone lies, by links too.
own=$0
while [ -L "$own" ]; do
  link=$(readlink "$own")
  case $link in
    /*) own=$link ;;
    *) own=$(dirname "$own")/$link ;;
  esac
done
root=$(CDPATH= cd -- "$(dirname "$own")/../.." && pwd)
PYTHONPATH="$root/workflow/src" exec "$root/.venv/bin/python" -m galloping "$@"
