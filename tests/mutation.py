"""Change one thing in a module, run the tests that guard it, and see whether they notice: `python tests/mutation.py [MODULE ...]`.

The changes are those of cosmic-ray, and `Swap` beside them. Nothing on disk is touched: a mutant lives in a process of its own, forked
from one in which the tests have run once, so that only the mutated module, what imports it and the tests are imported again. One mutant
takes the time of the tests and some tenths of a second, where a process that starts anew takes three. Kernels run as Python.
"""

import argparse
import ast
import importlib.abc
import importlib.util
import io
import itertools
import os
import random
import resource
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).parent
ROOT = TESTS.parent

GUARDS = {
    "octoctrl.judging.verification": ("test_verdict.py",),
    "octoctrl.judging.comparison": ("test_comparison.py",),
    "octoctrl.carrying.results": ("test_verdict.py",),
    "octoctrl.files.toml_source": ("test_toml_source.py",),
    "octoctrl.files.store": ("test_store.py -k 'not kill'",),
    "octoctrl.planners.solving.plan": ("test_plan_status.py -k 'only_a_solved or worst or text or knows'",),
    "octoctrl.planners.solving.reachability": ("test_plan_status.py -k 'limit or first'",),
    "octoctrl.planners.following.tracking": ("test_feedback.py -k 'weighs or nothing or delay or weak0 or bias or bounds'",),
    "octoctrl.sim.templates": ("test_activation.py",),
    "octoctrl.sim.activation": ("test_activation.py",),
    "octoctrl.sim.topology.inputs": ("test_topology_inputs.py -k 'not whatever'",),
    "octoctrl.sim.topology.measures": (
        "test_topology_inputs.py test_topology.py -k 'not whatever and not arctangent and not torus_curves'",
    ),
    "octoctrl.sim.topology.meter": (
        "test_topology_inputs.py test_topology.py -k 'meter or series or hanging or pole or sentence or coil'",
    ),
    "octoctrl.sim.topology.trace": ("test_topology_trace.py test_topology_inputs.py -k 'not whatever and not hanging and not pole'",),
    "octoctrl.sim.topology.topology_kernels": ("test_topology_kernels.py",),
}
"""The modules on which the verdict stands, and the tests that must notice a change in them, the quickest first."""

SAMPLE, SEED = 120, 20260101
PATIENCE = 10
"""A mutant that takes so many times the processor time of the tests is counted as noticed: it does not end."""


@dataclass(frozen=True)
class Mutant:
    """One change: by which operator, where, and the source that it gives."""

    operator: str
    line: int
    source: str


def swap():
    """An operator of ours: a reduction, rounding or comparison by name for another one."""
    from cosmic_ray.operators.operator import Operator
    from parso.python.tree import Name

    pairs = [("max", "min"), ("max", "mean"), ("argmax", "argmin"), ("any", "all"), ("floor", "ceil"), ("sin", "cos"), ("fmax", "fmin")]
    pairs += [("maximum", "minimum"), ("cumsum", "asarray"), ("sum", "max"), ("rfind", "find"), ("startswith", "endswith"), ("inf", "nan")]
    known = {}
    for one, other in pairs:
        known.setdefault(one, []).append(other)
        known.setdefault(other, []).append(one)

    class Swap(Operator):
        def mutation_positions(self, node):
            if isinstance(node, Name):
                yield from ((node.start_pos, node.end_pos) for _ in known.get(node.value, ()))

        def mutate(self, node, index):
            node.value = known[node.value][index]
            return node

        @classmethod
        def examples(cls):
            return ()

    return Swap()


def places(path):
    """Where a module can be changed: operator, occurrence and line; annotations, decorators and imports stay."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    source = path.read_text()
    kept, nodes = unchanged(source), list(ast_nodes(get_ast(source)))
    # cosmic-ray stumbles over exceptions that are named with their module.
    classes = [get_operator(name) for name in operator_names() if "exception" not in name.lower()]
    for operator in [*(kind() for kind in classes if not kind.arguments()), swap()]:
        starts = [start for node in nodes for start, _ in operator.mutation_positions(node)]
        for occurrence, start in enumerate(starts):
            if not any(begin <= start < end for begin, end in kept) and not senseless(operator, source, start):
                yield operator, occurrence, start[0]


def mutants(source, chosen):
    """The mutants of places, in their order; those that are no program, the same program or one that was made before are left out."""
    from cosmic_ray.mutating import mutate_code

    seen = {ast.dump(ast.parse(source))}
    for operator, occurrence, line in chosen:
        mutated = mutate_code(source, operator, occurrence)
        try:
            tree = ast.dump(ast.parse(mutated))
        except SyntaxError:
            continue
        if tree not in seen:
            seen.add(tree)
            yield Mutant(type(operator).__name__, line, mutated)


def senseless(operator, source, start):
    """Whether a change puts an operation on bits in the place of arithmetic, or takes the star of a signature for a product."""
    line, column = source.splitlines()[start[0] - 1], start[1]
    _, _, last = type(operator).__name__.rpartition("_")
    bits = {"RShift", "LShift", "BitOr", "BitAnd", "BitXor"}
    return (last in bits and line[column] in "+-*/%") or line[column : column + 2] == "*,"


def unchanged(source):
    """Places of annotations, decorators and imports: begin and end as (line, column)."""
    found = []
    for node in ast.walk(ast.parse(source)):
        parts = [getattr(node, "annotation", None), getattr(node, "returns", None), *getattr(node, "decorator_list", ())]
        parts += [node] if isinstance(node, ast.Import | ast.ImportFrom) else []
        # one column earlier: the sign before a decorator
        found += [
            ((part.lineno, part.col_offset - 1), (part.end_lineno, part.end_col_offset)) for part in parts if isinstance(part, ast.AST)
        ]
    return found


class Mutated(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives a module another source than that of its file."""

    def __init__(self, name, path, source):
        self.name, self.path, self.source = name, path, source

    def find_spec(self, name, path=None, target=None):
        return importlib.util.spec_from_file_location(name, self.path, loader=self) if name == self.name else None

    def exec_module(self, module):
        exec(compile(self.source, self.path, "exec"), module.__dict__)


def importers(name):
    """A module and all of ours that import it, directly or not, and the tests."""
    from test_house import MODULES, imports, module_name

    known = {module_name(path): imports(path) for path in MODULES}
    found = {name}
    while more := {module for module, names in known.items() if names & found} - found:
        found |= more
    return found | {Path(path).stem for path in TESTS.glob("*.py")} - {"mutation"}


def forget(gone):
    """Take modules out of this process; packages stay, but for what they remember of those modules."""
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == "octoctrl" and hasattr(module, "__path__"):
            known = [key for key, value in vars(module).items() if f"{name}.{key}" in gone or getattr(value, "__module__", "") in gone]
            for key in known:
                del module.__dict__[key]
        elif name in gone:
            del sys.modules[name]


def run(guards):
    """Run tests in this process, without a sound; their exit code and what they said."""
    import shlex

    import pytest

    said = io.StringIO()
    arguments = [str(TESTS / word) if word.endswith(".py") else word for guard in guards for word in shlex.split(guard)]
    with redirect_stdout(said), redirect_stderr(said):
        code = pytest.main(
            ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:randomly", "-p", "no:xdist", "--no-header", "-o", "addopts=", *arguments]
        )
    return int(code), said.getvalue()


def judge(name, path, source, guards, gone, patience):
    """Run the tests on a mutant in a forked process: whether they notice it, the processor time, and what they said."""
    reader, writer = os.pipe()
    if (child := os.fork()) == 0:
        os.close(reader)
        signal.setitimer(signal.ITIMER_PROF, patience)
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
        os.chdir(ROOT)
        forget(gone)
        sys.meta_path.insert(0, Mutated(name, str(path), source))
        code, said = 1, ""
        try:
            code, said = run(guards)
        finally:
            os.write(writer, said[-4000:].encode())
            os._exit(code)
    os.close(writer)
    said = b""
    while piece := os.read(reader, 65536):
        said += piece
    os.close(reader)
    _, status, used = os.wait4(child, 0)
    return status != 0, used.ru_utime + used.ru_stime, said.decode(errors="replace")


def study(name, *, sample, seed, lines):
    """Judge the mutants of one module and print the result."""
    os.environ |= {"OPENBLAS_NUM_THREADS": "1"} | ({"NUMBA_DISABLE_JIT": "1"} if name.endswith("kernels") else {})
    sys.path.insert(0, str(TESTS))
    sys.dont_write_bytecode = True
    from test_house import MODULES, module_name

    guards, path = GUARDS[name], next(path for path in MODULES if module_name(path) == name)
    chosen = [place for place in places(path) if not lines or place[2] in lines]
    random.Random(seed).shuffle(chosen)
    gone, source = importers(name), path.read_text()
    code, said = run(guards)
    noticed, usual, again = judge(name, path, source, guards, gone, 600.0)
    if code or noticed:
        raise SystemExit(f"{name}: its tests do not pass unchanged\n{said if code else again}")
    begin, survivors, judged = time.perf_counter(), [], 0
    for mutant in itertools.islice(mutants(source, chosen), sample or None):
        judged += 1
        noticed, _, _ = judge(name, path, mutant.source, guards, gone, PATIENCE * usual + 5.0)
        if not noticed:
            survivors.append(mutant)
            print(f"  {path.relative_to(ROOT)}:{mutant.line} {mutant.operator}\n{difference(source, mutant.source)}", flush=True)
    killed, spent = judged - len(survivors), (time.perf_counter() - begin) / max(judged, 1)
    print(f"{name}: {killed} of {judged} noticed, {killed / max(judged, 1):.1%} (of {len(chosen)} places; {spent:.1f} s each)", flush=True)


def difference(before, after):
    """The lines that a mutant changes."""
    import difflib

    changed = difflib.unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    return "\n".join(f"    {line}" for line in list(changed)[3:])


def main():
    """Study the modules that are named, or all, each in a process of its own."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("modules", nargs="*", metavar="MODULE", help=f"of {', '.join(GUARDS)}; all if omitted")
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants of a module at most, drawn by the seed; 0 for all")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--lines", help="only mutants of these lines: 20-35")
    chosen = parser.parse_args()
    known = [name for name in GUARDS if not chosen.modules or any(name.endswith(asked) for asked in chosen.modules)]
    if len(known) != 1:
        options = [f"--sample={chosen.sample}", f"--seed={chosen.seed}"]
        raise SystemExit(max((subprocess.call([sys.executable, __file__, name, *options]) for name in known), default=2))
    begin, _, end = (chosen.lines or "").partition("-")
    lines = range(int(begin), int(end or begin) + 1) if begin else ()
    study(known[0], sample=chosen.sample, seed=chosen.seed, lines=lines)


if __name__ == "__main__":
    main()
