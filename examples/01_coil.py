"""The main job as a library: plan the coil, carry it out in closed loop, verify, draw.

Run with ``python examples/01_coil.py [--quick]``; leaves ``01_coil.png``.
"""

import sys

import octoctrl as oc


def main(quick=False):
    plan = oc.plan("coil")
    run = oc.execute(plan, feedback="tvlqr")
    verdict = oc.verify(run)
    print(plan, run, verdict, sep="\n\n")
    oc.plot(run, "01_coil.png", overwrite=True, snapshots=3 if quick else 6)
    return verdict


if __name__ == "__main__":
    main(quick="--quick" in sys.argv)
