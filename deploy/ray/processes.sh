#!/bin/sh
# A head and two workers of Ray as processes of this machine, one command on them, and their end:
#   deploy/ray/processes.sh pns batch in/ out/ --report report.jsonl
# `--address` is added to the command.
set -eu
port=${RAY_PORT:-6379}
here=$(mktemp -d)
nodes=""
stop() {
  # What this script started, and nothing else of Ray's.
  for node in $nodes; do kill "$node" 2>/dev/null || true; done
  wait
  rm -rf "$here"
}
trap stop EXIT INT TERM
# Whoever has no token is turned away.
RAY_AUTH_TOKEN=$(od -An -N32 -tx1 /dev/urandom | tr -d ' \n')
export RAY_AUTH_TOKEN RAY_AUTH_MODE=token
export RAY_USAGE_STATS_ENABLED=0 RAY_raylet_start_wait_time_s=300 OMP_NUM_THREADS=1
store="--object-store-memory=134217728"
ray start --head --node-ip-address=127.0.0.1 --port="$port" --num-cpus=0 --include-dashboard=false \
  --temp-dir="$here" $store --block >"$here/head.log" 2>&1 &
nodes="$nodes $!"
until ray health-check --address "127.0.0.1:$port" >/dev/null 2>&1; do
  kill -0 "${nodes# }" 2>/dev/null || { cat "$here/head.log" >&2; exit 1; }
  sleep 1
done
for worker in 1 2; do
  ray start --address="127.0.0.1:$port" --num-cpus=1 $store --block >"$here/worker$worker.log" 2>&1 &
  nodes="$nodes $!"
  until grep -qs "Ray runtime started" "$here/worker$worker.log"; do
    kill -0 $! 2>/dev/null || { cat "$here/worker$worker.log" >&2; exit 1; }
    sleep 1
  done
done
"$@" --address "127.0.0.1:$port"
