#!/usr/bin/env bash
# An evaluation on Kubernetes: its volumes, then plan, parts and merge, each when the one before is complete.
#
#     kubernetes.sh [flags of kubectl, such as --namespace NAME]
#
# It may be stopped and given again at any time: the jobs go on without it. A finished step is not done again for a day.
set -euo pipefail
cd "$(dirname "$0")"
kubectl "$@" apply -f claims.yaml
for step in plan job merge; do
    kubectl "$@" apply -f "$step.yaml"
    until kubectl "$@" wait --for=condition=complete --timeout=30s -f "$step.yaml" 2> /dev/null; do
        failed=$(kubectl "$@" get -f "$step.yaml" -o 'jsonpath={.status.conditions[?(@.type=="Failed")].reason}')
        if [ -n "$failed" ]; then
            echo "$step.yaml has failed ($failed): see its pods' logs; after 'kubectl delete -f $step.yaml' this script goes on," \
                "and only what is missing is asked" >&2
            exit 1
        fi
    done
done
