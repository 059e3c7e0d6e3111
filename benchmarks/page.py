"""Make docs/benchmarks.md anew: every part of ``octoctrl bench``, and the elastic rod beside PyElastica where that is installed.

Run with ``python benchmarks/page.py`` from the root (some ten minutes; ``quick`` leaves out the full arm and half of the cases).
"""

import sys
from importlib.util import find_spec
from pathlib import Path

from octoctrl.bench import benchmark as benchmarking
from octoctrl.progress import RichProgress

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"


def main():
    full = "quick" not in sys.argv[1:]
    parts = [name for name in benchmarking.PARTS if full or name not in ("assembly", "mixed")]
    tables = benchmarking.run(parts, full=full, progress=RichProgress())
    if find_spec("elastica"):
        import rod_against_pyelastica

        tables.insert(0, rod_against_pyelastica.compare(full))
    command = "python benchmarks/page.py" + ("" if full else " quick")
    benchmarking.write(tables, command, output=PAGE.with_suffix(".json") if "json" in sys.argv[1:] else None, page=PAGE)
    print(*tables, sep="\n\n")


if __name__ == "__main__":
    main()
