#!/usr/bin/env bash
# Inside a job of SLURM: start Ray on all of its machines, run a command of `reproduce` there, and end it all.
#
#   sbatch --nodes 4 --ntasks-per-node 1 --cpus-per-task 32 --time 12:00:00 scripts/slurm_ray.sh all --seeds 5
#
# Arguments are those of `reproduce`, without --on. PYTHON names the interpreter that msrd_ros is installed for,
# the same path on all machines; PORT the one at which they meet.
set -euo pipefail

: "${SLURM_JOB_ID:?this runs inside a job: sbatch ... scripts/slurm_ray.sh STUDY}"
: "${SLURM_CPUS_PER_TASK:?say how many processors a machine gives: sbatch --cpus-per-task N}"
[ "$#" -gt 0 ] || { echo "slurm_ray.sh: which study? for instance: scripts/slurm_ray.sh all --seeds 5" >&2; exit 2; }

PYTHON=${PYTHON:-python3}
PORT=${PORT:-$((20000 + SLURM_JOB_ID % 20000))} # other jobs may be on the same machines
PATIENCE_S=120

export RAY_USAGE_STATS_ENABLED=0
# Ray listens on the network; with this it answers nobody who is not of this job (old versions of Ray do not ask).
export RAY_AUTH_MODE=token
RAY_AUTH_TOKEN=$("$PYTHON" -c 'import secrets; print(secrets.token_hex(32))')
export RAY_AUTH_TOKEN

mapfile -t machines < <(scontrol show hostnames "$SLURM_JOB_NODELIST")
head=${machines[0]}
address=$(srun --nodes 1 --ntasks 1 --nodelist "$head" hostname --all-ip-addresses | awk '{ print $1 }')

started=()
trap 'kill "${started[@]}" 2> /dev/null || true; wait' EXIT

# --block: what srun has started lasts as long as Ray does there, and ends it when it is ended.
start() { # start MACHINE ARGUMENTS...
    srun --overlap --nodes 1 --ntasks 1 --cpus-per-task "$SLURM_CPUS_PER_TASK" --nodelist "$1" \
        "$PYTHON" -m ray.scripts.scripts start "${@:2}" \
        --num-cpus "$SLURM_CPUS_PER_TASK" --disable-usage-stats --block &
    started+=($!)
}

start "$head" --head --node-ip-address "$address" --port "$PORT" --include-dashboard false
for ((waited = 0; ; waited++)); do
    if (exec 3<> "/dev/tcp/$address/$PORT") 2> /dev/null; then break; fi
    if ((waited >= PATIENCE_S)); then
        echo "slurm_ray.sh: Ray did not start on $head within $PATIENCE_S s; see what srun says above" >&2
        exit 1
    fi
    sleep 1
done
for machine in "${machines[@]:1}"; do
    start "$machine" --address "$address:$PORT"
done

# Machines may join while the first runs are made already.
RAY_ADDRESS="$address:$PORT" "$PYTHON" -m msrd_ros reproduce "$@" --on ray
