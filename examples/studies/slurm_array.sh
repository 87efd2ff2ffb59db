#!/bin/sh
# A study on a cluster with Slurm: every task of the array takes every 64th point, from its own on.
#
#   sbatch examples/studies/slurm_array.sh my_study.toml results
#
# Tasks write into one folder, each to a journal of its own. One that is killed or requeued goes on where it was; running the whole
# array again takes only what is missing. When all are done, one table is made of them:
#
#   gdtof sweep merge results

#SBATCH --job-name=gdtof-sweep
#SBATCH --array=1-64
#SBATCH --cpus-per-task=4
#SBATCH --mem-per-cpu=500M
#SBATCH --time=04:00:00
#SBATCH --requeue

set -eu
study=$1
folder=$2
exec gdtof sweep "$study" --out "$folder" --threads "${SLURM_CPUS_PER_TASK:-1}" \
    --shard "${SLURM_ARRAY_TASK_ID:?}/${SLURM_ARRAY_TASK_COUNT:?}"
