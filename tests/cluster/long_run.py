"""Jobs through a storm of some minutes; see run."""

import argparse
import random
import sys

import deployment
import storm


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--minutes", type=float, default=10, help="of the fake engine's storm")
    parser.add_argument("--jobs", type=int, default=100, help="of the fake engine")
    parser.add_argument("--real-jobs", type=int, default=3, help="of the real engine")
    parser.add_argument("--real-minutes", type=float, default=2)
    parser.add_argument("--seed", type=int, default=random.randrange(1_000_000))
    args = parser.parse_args()
    print(f"seed {args.seed}", flush=True)

    def report(text):
        print(text, flush=True)

    rows, complaints = [], 0
    # Long enough for all the time there is: six clients, one job each at a time.
    iterations = max(50, int(args.minutes * 60 * 6 / max(args.jobs, 1) / 0.02 / 3))
    with deployment.scratch() as folder:
        for workload, jobs, minutes in (
                (storm.fake_workload(iterations), args.jobs, args.minutes),
                (storm.real_workload(folder), args.real_jobs, args.real_minutes)):
            if jobs == 0:
                continue
            tally = storm.run(workload, args.seed, jobs, 60 * minutes, report)
            rows.append(f"| {workload.engine} engine | {tally.row()} |")
            complaints += len(tally.complaints)
    print("\n| Workload | Jobs | Disturbances | Leases | Resumed by their owner | Promises broken |\n"
          "|---|---:|---|---:|---:|---:|")
    print("\n".join(rows))
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
