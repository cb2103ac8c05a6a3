#!/bin/bash
# What Snakemake asks about a job: success, failed or running. A job that was killed, or whose node is lost, says so to Slurm
# alone.
state=$(scontrol --oneliner show job "$1" 2>/dev/null | grep -o 'JobState=[A-Z_]*')
[[ -n $state ]] || state=JobState=$(sacct -X -n -o State -j "$1" 2>/dev/null | awk 'NR == 1 {print $1}')
case ${state#JobState=} in
  COMPLETED) echo success ;;
  PENDING | CONFIGURING | RUNNING | COMPLETING | SUSPENDED | REQUEUED | RESIZING) echo running ;;
  "") echo running ;;  # the controller does not answer just now
  *) echo failed ;;
esac
