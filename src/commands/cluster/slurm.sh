#!/usr/bin/env bash
# An evaluation as jobs of Slurm: its plan, 256 parts of which 16 run at once, and the merge of them into runs/a-whole.
#
#     ./slurm.sh --out runs/a --model gpt-4o --data frames/ --rpm 500
#
# PARTS=64 AT_ONCE=8 in front divides otherwise; SBATCH_ACCOUNT, SBATCH_PARTITION and the like are sbatch's own. The key comes from
# the environment, or --api-key-file. One array alone, where the plan is there or none is wanted:
#
#     sbatch --array=0-15%4 slurm.sh --shard workers=4 --out runs/a --model gpt-4o --data frames/ --rpm 500
#
# A task that is preempted, or near its time limit, finishes the requests in flight, and Slurm starts it again. A task that was
# killed (kill -9, no memory), cancelled or lost with its node is not started again, and the merge is cancelled with it: give the
# same line again. Only what is missing is asked, and PARTS may be another number.
#SBATCH --job-name=darkqa
#SBATCH --cpus-per-task=1
#SBATCH --time=12:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x-%j.log
#SBATCH --signal=B:TERM@150
set -eu

# Outside of a job: submits the three.
if [ -z "${SLURM_JOB_ID:-}" ]; then
  parts=${PARTS:-256} at_once=${AT_ONCE:-16} out='' before=''
  for word in "$@"; do
    case $word in --out=*) out=${word#--out=} ;; esac
    [ "$before" = --out ] && out=$word
    before=$word
  done
  [ -n "$out" ] || { echo "$0: --out DIR is missing: the tasks share the folder of the run" >&2; exit 2; }
  [ "$parts" -ge 2 ] || { echo "$0: PARTS must be 2 or more: a run in one part needs neither plan nor merge" >&2; exit 2; }
  submit() { sbatch --parsable --kill-on-invalid-dep=yes "$@"; }
  plan=$(submit --job-name=darkqa-plan "$0" plan "$@")
  array=$(submit --array="0-$((parts - 1))%$at_once" --output=darkqa-%A_%a.log --dependency="afterok:$plan" \
    "$0" --shard "workers=$at_once" "$@")
  merge=$(submit --job-name=darkqa-merge --dependency="afterok:$array" "$0" report merge "$out" --out "${out%/}-whole" --quiet)
  echo "plan $plan, $parts parts $array, merge $merge: squeue --me shows them"
  exit
fi

set +e
stopped=
export DARKQA_THREADS=${DARKQA_THREADS:-${SLURM_CPUS_PER_TASK:-1}}
darkqa-eval "$@" &
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
