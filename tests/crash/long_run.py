"""Many seeds of kill_rounds.py, and a table of what they did: see tests/crash/run."""

import argparse
import random
import sys

import deployment
import kill_rounds


def row(name, tally):
    kills = ", ".join(f"{count} {victim}" for victim, count in sorted(tally.kills.items()))
    return (f"| {name} | {tally.rounds} | {kills} | {tally.jobs} | {tally.lost_jobs} "
            f"| {tally.changed_scenes} | {tally.broken_histories} | {tally.orphans} "
            f"| {tally.strays} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=50, help="rounds of each workload")
    parser.add_argument("--first", type=int, default=random.randrange(1_000_000))
    parser.add_argument("--at-once", type=int, default=4, help="rounds that run side by side")
    parser.add_argument("--only", choices=("fake", "real"))
    args = parser.parse_args()
    seeds = range(args.first, args.first + args.seeds)
    print(f"seeds {seeds[0]}..{seeds[-1]}; --first {args.first} --seeds {args.seeds} repeats them")
    rows, complaints = [], []
    with deployment.scratch() as folder:
        workloads = []
        if args.only != "real":
            workloads.append(kill_rounds.fake_workload())
        if args.only != "fake":
            workloads.append(kill_rounds.real_workload(folder))
        for workload in workloads:
            tally = kill_rounds.run_rounds(workload, seeds, args.at_once,
                                           report=lambda text: print(text, flush=True))
            rows.append(row(workload.name, tally))
            complaints += tally.complaints
            print(f"{workload.name}: kills left something to tidy up in {tally.swept} rounds")
    print("\n| Workload | Rounds | kill -9 of | Jobs | Lost | Changed scenes | Events lost or doubled "
          "| Processes left | Files left |\n|---|---:|---|---:|---:|---:|---:|---:|---:|")
    print("\n".join(rows))
    for complaint in complaints:
        print(complaint)
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
