#!/usr/bin/env bash
# An evaluation as a Slurm job array:
#
#     sbatch --array=0-15 slurm.sh --out runs/a --model gpt-4o --data frames/ --rpm 500
#     darkqa-eval merge runs/a --out runs/a-whole        # when all tasks are done
#
# Each task does the part with its number in the array. The key comes from the environment of sbatch, or --api-key-file.
# A task that is preempted, or near its time limit, finishes the requests in flight, and continues when it is started again.
#SBATCH --job-name=darkqa
#SBATCH --array=0-3
#SBATCH --cpus-per-task=1
#SBATCH --time=12:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=darkqa-%A_%a.log
#SBATCH --signal=B:TERM@120
set -u
stopped=
darkqa-eval --threads "${SLURM_CPUS_PER_TASK:-1}" "$@" &
child=$!
trap 'stopped=yes; kill -TERM "$child"' TERM
wait "$child"
code=$?
if [ -n "$stopped" ]; then
  # The first wait ended with the signal; this one ends with the program.
  wait "$child"
  code=$?
fi
# 130: interrupted, with more to do. Slurm restarts a preempted task without this, but not one at its time limit.
if [ -n "$stopped" ] && [ "$code" -eq 130 ]; then
  scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"
fi
exit "$code"
