#!/bin/sh
# Runs foley and the programs beside it in turn (A B A B) and compares their processor times.
#   PEERS=FOLDER benches/peers/compare.sh [ITEM ...]    items: 01 .. 14 (default: all)
# Environment:
#   PEERS         folder of the other programs' scripts, with py, rs and c; needed
#   PEERS_VENV    virtual environment of their Python packages
#   PEERS_BUILD   folder of their Rust programs, in target/release; C programs are built into it
#   ROUNDS        turns (default 2); PEERS_RUNS, PEERS_THREADS: as in run.sh
set -eu
if [ ! -d "${PEERS:-}/py" ]; then
  echo "compare.sh: set PEERS to the folder of the other programs' scripts; ${PEERS:-an empty name} has no folder py" >&2
  exit 2
fi
root=$(cd "$(dirname "$0")/../.." && pwd)
# The binary stays the same in all turns, whatever happens to the sources.
FOLEY_BENCH=$(cd "$root" && cargo bench --locked -p foley --no-run --message-format=json-render-diagnostics |
  sed -n 's/.*"executable":"\([^"]*graphs-[^"]*\)".*/\1/p' | tail -n 1)
export FOLEY_BENCH
exec python3 "$root/benches/peers/compare.py" "$@"
