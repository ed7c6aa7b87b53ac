"""Mutation testing of the core: random small faults are put into a copy of the sources, and the tests must notice.

`make mutations SAMPLE=300 SEED=19` runs it; CONTRIBUTING.md describes the result. A fault changes one node of the
syntax tree (`faults`): another operator or number, a condition turned round, no iteration, another end of a loop,
another exception, or a statement left out. The sample is spread over the files by their size.

A coverage run records for each test its lines and its time. A mutant then meets the tests that run its line, those of
the folder that mirrors the package first and the fastest of them first, until one fails. A constant or a default meets
the tests that run the lines that name it. Where none fails, the other tests of the folder that mirrors the package
follow. A test that kills only counts if it passes on the original.

Kernels are mutated as the Python functions that they are: their mutants meet tests in which no kernel is compiled
(`interpret`), chosen by a coverage run of its own. With --kernels the sample is one of the kernels alone.
"""

from __future__ import annotations

import argparse
import ast
import collections
import contextlib
import copy
import functools
import itertools
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent

CORE = """
raff2urdf/[cdprt]*.py raff2urdf/raff/[crkw]*.py raff2urdf/writers/{urdf,inertia,tree_at_home}.py
cinegen/{joints,tolerances}.py cinegen/{model,loops,ik,singularities,toolpath,realtime,planning,assembly,workspace}/*.py
cinegen/session/{undo,motion}.py
cinegen/devices/{magellan,spaceball,serial_mouse,json_socket,reading_json,lines,mouse_events,spacenav}.py
cinegen/devices/{scripted_path,replay,gamepad,teleoperation}.py
"""
"""Files of the core, as patterns; without the kernels and without `LEFT_OUT`."""

KERNELS = """
cinegen/{loops,ik,collision,dynamics,planning}/_kernels/*.py cinegen/jit/{banded,factor,se3,smallest,svd,vectors}.py
"""
"""Files of the core's kernels."""

LEFT_OUT = """
__init__ __main__ thresholds cli command_line cluster local_cluster zarr_store check
"""
"""Names of files that are left out: command lines, processes and disks."""

FOLDERS = """
raff2urdf model loops ik toolpath realtime singularities devices session planning
assembly workspace collision mission jit
"""
"""Folders in tests/ whose tests may kill."""

KERNEL_FOLDERS = "jit loops ik collision dynamics planning model"
"""Folders in tests/ whose tests may kill a kernel."""

SLOWEST = {"python": 12.0, "kernels": 6.0}  # s of CPU: a test that takes longer, measured with coverage, is left out
FIRST = 10.0  # s of tests that a mutant meets at first
MOST = 60.0  # s of tests that a mutant meets at most
NOT_PYTHON = {"intrinsic", "overload"}  # of numba: never run as Python

BINARY = {"Add": ["Sub"], "Sub": ["Add"], "Mult": ["Div"], "Div": ["Mult"], "FloorDiv": ["Mult"], "Mod": ["Mult"],
          "Pow": ["Mult"], "BitOr": ["BitAnd"], "BitAnd": ["BitOr"]}  # fmt: skip
COMPARISON = {"Eq": ["NotEq"], "NotEq": ["Eq"], "Lt": ["LtE", "GtE"], "LtE": ["Lt", "Gt"], "Gt": ["GtE", "LtE"],
              "GtE": ["Gt", "Lt"], "Is": ["IsNot"], "IsNot": ["Is"]}  # fmt: skip


@dataclass
class Mutant:
    """A fault: `text` stands for the original from line and column `start` on to `stop`."""

    file: str
    operator: str
    start: tuple[int, int]
    stop: tuple[int, int]
    before: str
    after: str
    text: str  # the whole line or lines, changed
    status: str = ""  # killed, survived, not covered
    by: str = ""  # the test that killed it, "timeout" or "collection"
    tests: int = 0
    seconds: float = 0.0

    @property
    def line(self) -> int:
        """Number of the line."""
        return self.start[0]

    @property
    def mode(self) -> str:
        """How its tests run: "python", or "kernels" if no kernel is compiled."""
        return "kernels" if "/_kernels/" in self.file or self.file.startswith("cinegen/jit/") else "python"


# --- The sample -------------------------------------------------------------------------------------------------


def faults(node: ast.AST) -> Iterator[tuple[str, str, ast.AST, ast.AST]]:
    """Yield the faults of a node: family, name, what is replaced, and by what."""

    def changed(**fields: Any) -> ast.AST:
        new = copy.copy(node)
        for name, value in fields.items():
            setattr(new, name, value)
        return new

    match node:
        case ast.BinOp():
            for name in BINARY.get(type(node.op).__name__, ()):
                yield "arithmetic", name, node, changed(op=getattr(ast, name)())
        case ast.Compare():
            for i, operator in enumerate(node.ops):
                for name in COMPARISON.get(type(operator).__name__, ()):
                    operators = [*node.ops[:i], getattr(ast, name)(), *node.ops[i + 1 :]]
                    yield "comparison", name, node, changed(ops=operators)
        case ast.BoolOp():
            other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            yield "boolean", type(other).__name__, node, changed(op=other)
        case ast.Constant(value=bool()):
            yield "boolean", str(not node.value), node, ast.Constant(not node.value)
        case ast.Constant(value=int() | float()):
            for step in (1, -1):
                yield "number", f"{step:+}", node, ast.Constant(node.value + step)
            if node.value % 1.0:
                yield "scale", "x 100", node, ast.Constant(100.0 * node.value)
        case ast.If() | ast.While() | ast.IfExp():
            yield "condition", "Not", node.test, ast.UnaryOp(ast.Not(), node.test)
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield "sign", "left out", node, node.operand
        case ast.For():
            yield "loop", "no iteration", node.iter, ast.List([])
        case ast.Break() | ast.Continue():
            yield "loop", "other end", node, ast.Continue() if isinstance(node, ast.Break) else ast.Break()
        case ast.ExceptHandler(type=ast.expr()):
            yield "exception", "another", node.type, ast.Name("StopAsyncIteration")
        case ast.AugAssign() | ast.Expr(value=ast.Call()):
            yield "statement", "left out", node, ast.Pass()


def run_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that run as Python: no annotations, type aliases, texts, and nothing that is for numba alone."""
    match node:
        case ast.JoinedStr() | ast.If(test=ast.Name("TYPE_CHECKING")):
            return
        case ast.FunctionDef(decorator_list=[*decorators]) if NOT_PYTHON & {
            getattr(getattr(decorator, "func", decorator), "id", "") for decorator in decorators
        }:
            return
        case ast.Assign(targets=[ast.Name(name)], value=ast.BinOp() | ast.Subscript()) if re.fullmatch(
            "[A-Z][a-z][A-Za-z]*", name
        ):
            return
        case ast.Call(func=ast.Name("cast" | "TypeVar")):
            parts: list[Any] = node.args[1:]
        case _:
            yield node
            fields = (value for name, value in ast.iter_fields(node) if name not in ("annotation", "returns"))
            parts = [part for value in fields for part in (value if isinstance(value, list) else [value])]
    for part in parts:
        if isinstance(part, ast.AST):
            yield from run_nodes(part)


def sites(source: str) -> list[tuple[Any, list[tuple[str, ast.AST, ast.AST]]]]:
    """Return the places that can be mutated, by family and position, and the faults of each."""
    places: dict[Any, list[tuple[str, ast.AST, ast.AST]]] = {}
    for node in run_nodes(ast.parse(source)):
        for family, name, old, new in faults(node):
            key = family, (old.lineno, old.col_offset), (old.end_lineno, old.end_col_offset)  # type: ignore[attr-defined]
            places.setdefault(key, []).append((f"{family} {name}", old, new))
    return sorted(places.items(), key=lambda place: place[0])


def replaced(source: str, old: Any, new: ast.AST) -> str:
    """Return a source in which a node is replaced."""
    data, text = source.encode(), ast.unparse(new)
    starts = list(itertools.accumulate(map(len, data.splitlines(keepends=True)), initial=0))
    begin, end = starts[old.lineno - 1] + old.col_offset, starts[old.end_lineno - 1] + old.end_col_offset
    return (data[:begin] + (f"({text})" if isinstance(old, ast.expr) else text).encode() + data[end:]).decode()


def core(tree: Path, kernels: bool) -> list[str]:
    """Return the files of the core, all of them or its kernels."""
    patterns = []
    for word in KERNELS.split() + ([] if kernels else CORE.split()):
        head, brace, rest = word.partition("{")
        names, _, tail = rest.partition("}")
        patterns += [head + name + tail for name in names.split(",")] if brace else [word]
    paths = {path for pattern in patterns for path in tree.glob(pattern)}
    return sorted(str(path.relative_to(tree)) for path in paths if path.stem not in LEFT_OUT.split())


def draw(tree: Path, count: int, seed: int, kernels: bool) -> list[Mutant]:
    """Return a random sample, the same for the same sources and seed."""
    generator = random.Random(seed)
    sources = {file: (tree / file).read_text(encoding="utf-8") for file in core(tree, kernels)}
    places = {file: sites(source) for file, source in sources.items()}
    sizes = {file: sum(bool(line.strip()) for line in source.splitlines()) for file, source in sources.items()}
    sizes = {file: size for file, size in sizes.items() if places[file]}
    quotas = {file: count * size / sum(sizes.values()) for file, size in sizes.items()}
    shares = {file: int(quota) for file, quota in quotas.items()}
    left = sorted(quotas, key=lambda file: shares[file] - quotas[file])[: count - sum(shares.values())]
    mutants = []
    for file in sizes:
        share = min(len(places[file]), shares[file] + (file in left))
        for (_, start, stop), choices in generator.sample(places[file], share):
            name, old, new = generator.choice(choices)
            text, low = replaced(sources[file], old, new), start[0] - 1
            change = (source.split("\n")[low].strip() for source in (sources[file], text))
            mutants.append(Mutant(file, name, start, stop, *change, text))
    return mutants


# --- The tests of a mutant --------------------------------------------------------------------------------------

TIMES: dict[str, dict[str, Any]] = {}


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item: Any) -> Iterator[None]:
    """End a test of the coverage run that computes too long (this file is a plugin of that run).

    It ends in code of the tree alone: not in coverage's, which holds a lock, nor in an import, which would leave half a
    module.
    """

    def ring(_signal: int, frame: Any) -> None:
        files = []
        while frame:
            files.append(frame.f_code.co_filename)
            frame = frame.f_back
        if not files[0].startswith(os.getcwd()) or any("importlib._bootstrap" in file for file in files):
            signal.setitimer(signal.ITIMER_PROF, 0.05)
            return
        raise TimeoutError("too slow to meet mutants")

    signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, SLOWEST[os.environ["MUTATION_MODE"]])
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def pytest_configure() -> None:
    """Let the coverage run of the kernels interpret them."""
    if os.environ["MUTATION_MODE"] == "kernels":
        interpret()


def interpret() -> None:
    """Let this process run kernels as Python functions, also those that a test calls itself."""
    from numba.core.registry import CPUDispatcher

    from cinegen.jit import compiled, starting
    from cinegen.jit.interpreted import interpreted

    def prepare(function: Any, *arguments: Any) -> Any:
        return starting.InterpretedKernel(function, arguments, lambda _machine_code: None)

    compiled.prepare = starting.prepare = prepare
    compiled.is_cached = starting.is_cached = lambda *_: False
    starting.COMPILATION.add = lambda _kernel: None
    CPUDispatcher.__call__ = lambda self, *arguments: interpreted(self)(*arguments)


def pytest_runtest_logreport(report: Any) -> None:
    """Note the time of a test."""
    test = TIMES.setdefault(report.nodeid, {"seconds": 0.0, "ok": True})
    test["seconds"] += report.duration
    test["ok"] &= report.outcome == "passed"


def pytest_sessionfinish() -> None:
    """Write the times."""
    Path(os.environ["MUTATION_TIMES"]).write_text(json.dumps(TIMES), encoding="utf-8")


def measure(work: Path, mode: str) -> None:
    """Run the tests that may kill once with coverage, with a context for each."""
    settings = work / "coverage.toml"
    settings.write_text('[tool.coverage.run]\nsource_pkgs = ["cinegen", "raff2urdf"]\n', encoding="utf-8")
    environment = os.environ | {"MUTATION_TIMES": str(work / f"{mode}.json"), "COVERAGE_FILE": str(work / f"{mode}.db")}
    environment["MUTATION_MODE"] = mode
    environment["PYTHONPATH"] = os.pathsep.join([str(work / "tree"), str(Path(__file__).parent), *_python_path()])
    options = ["-q", "--tb=no", "-n", "0", "--dist", "no", "-p", "no:cacheprovider", "-p", "mutations"]
    options += [f"--basetemp={work}/{mode}", "--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report="]
    folders = KERNEL_FOLDERS if mode == "kernels" else FOLDERS
    command = [sys.executable, "-m", "pytest", *options, *(f"tests/{folder}" for folder in folders.split())]
    subprocess.run(command, cwd=work / "tree", env=environment, check=False)


def _python_path() -> list[str]:
    return [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]


class Selection:
    """The tests that can kill a mutant, from the coverage run of a mode."""

    def __init__(self, work: Path, mode: str) -> None:
        from coverage import CoverageData

        self.tree = work / "tree"
        times = json.loads((work / f"{mode}.json").read_text(encoding="utf-8"))
        self.seconds = {name: test["seconds"] for name, test in times.items() if test["ok"]}
        self.data = CoverageData(str(work / f"{mode}.db"))
        self.data.read()
        if self.data.measured_contexts() == {""}:
            raise SystemExit("the coverage run has not recorded which test runs which line")

    @functools.cache  # noqa: B019
    def contexts(self, file: str) -> dict[int, set[str]]:
        """Return the tests by line of a file."""
        by_line = self.data.contexts_by_lineno(str(self.tree / file))
        return {line: {name.rpartition("|")[0] for name in names if name} for line, names in by_line.items()}

    @functools.cache  # noqa: B019
    def statements(self, file: str) -> list[tuple[range, str | None, bool]]:
        """Return each statement's lines (of a compound one: its head), the name that it binds, and whether it is in
        a function."""
        spans: list[tuple[range, str | None, bool]] = []

        def visit(body: Iterable[ast.stmt], inside: bool) -> None:
            for node in body:
                inner = [part for name in ("body", "orelse", "finalbody") for part in getattr(node, name, [])]
                inner += [part for handler in getattr(node, "handlers", []) for part in [handler, *handler.body]]
                inner += [part for case in getattr(node, "cases", []) for part in case.body]
                end = min((part.lineno for part in inner), default=(node.end_lineno or node.lineno) + 1)
                head = range(node.lineno, max(end, node.lineno + 1))
                name = None
                if isinstance(node, ast.Assign | ast.AnnAssign):
                    target = node.targets[0] if isinstance(node, ast.Assign) else node.target
                    name = getattr(target, "id", None)
                function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
                if function:
                    spans.append((range(node.lineno, node.body[0].lineno), f"def {node.lineno}", inside))
                elif not isinstance(node, ast.excepthandler):
                    spans.append((head, name, inside))
                else:
                    spans.append((range(node.lineno, node.lineno + 1), None, inside))
                visit([part for part in inner if isinstance(part, ast.stmt | ast.excepthandler)], inside or function)

        visit(ast.parse((self.tree / file).read_text(encoding="utf-8")).body, False)
        return spans

    def of(self, mutant: Mutant) -> list[str]:
        """Return the tests that run a mutant's line, or use what it binds: first those of the folder that mirrors the
        package, each fastest first."""
        contexts = self.contexts(mutant.file)
        spans = [x for x in self.statements(mutant.file) if mutant.line in x[0]]
        lines, name, inside = min(spans, key=lambda x: len(x[0]), default=(range(0), None, False))
        tests: set[str] = set()
        if name and name.startswith("def "):  # a default: whoever runs the function
            source = ast.parse((self.tree / mutant.file).read_text(encoding="utf-8"))
            node = next(n for n in ast.walk(source) if isinstance(n, ast.FunctionDef) and n.lineno == lines.start)
            lines, inside = range(node.body[0].lineno, (node.end_lineno or 0) + 1), True
        if inside:
            tests = set().union(*(contexts.get(line, set()) for line in lines))
        elif name:
            for path in [*(self.tree / "cinegen").rglob("*.py"), *(self.tree / "raff2urdf").rglob("*.py")]:
                file = str(path.relative_to(self.tree))
                text = path.read_text(encoding="utf-8")
                if file == mutant.file or (name.strip("_") and not name.startswith("_") and name in text):
                    for number, line in enumerate(text.splitlines(), 1):
                        if re.search(rf"\b{name}\b", line):
                            tests |= self.contexts(file).get(number, set())
        else:
            tests = set().union(*contexts.values()) if contexts else set()
        near = _mirror(mutant)
        return sorted(tests & self.seconds.keys(), key=lambda name: (not name.startswith(near), self.seconds[name]))

    def neighbours(self, mutant: Mutant) -> list[str]:
        """Return the tests of the folder that mirrors the package, fastest first."""
        near = _mirror(mutant)
        return sorted((name for name in self.seconds if name.startswith(near)), key=self.seconds.__getitem__)


def _mirror(mutant: Mutant) -> str:
    """Return the folder of tests that mirrors a mutant's package."""
    parts = mutant.file.split("/")
    return f"tests/{parts[0] if parts[0] == 'raff2urdf' else parts[1] if len(parts) > 2 else 'model'}/"


# --- Running ----------------------------------------------------------------------------------------------------


class Runner:
    """Runs tests in forks of this process, which has all libraries loaded but nothing of the project."""

    def __init__(self, work: Path) -> None:
        self.work, self.tree = work, work / "tree"
        self.bad: set[str] = set()
        self.verified: set[str] = set()
        import coal  # noqa: F401
        import hypothesis  # noqa: F401
        import msgspec  # noqa: F401
        import numba  # noqa: F401
        import pinocchio  # noqa: F401
        import scipy.optimize  # noqa: F401
        import scipy.spatial  # noqa: F401

    def run(self, tests: list[str], mode: str, limit: float, *more: str) -> tuple[str, str]:
        """Return what happened, "passed", "failed" or "timeout", and the test that failed."""
        log = self.work / "log.txt"
        child = os.fork()
        if not child:
            os.setsid()
            output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(output, 1)
            os.dup2(output, 2)
            os.chdir(self.tree)
            sys.path[:] = [
                str(self.tree),
                *(path for path in sys.path if Path(path or ".").resolve() != Path(__file__).parent),
            ]
            os.environ["PYTHONPATH"] = str(self.tree)
            sys.dont_write_bytecode = True
            os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
            options = ["-x", "-q", "--tb=line", "-p", "no:cacheprovider", "-n", "0", f"--basetemp={self.work}/tmp"]
            try:
                if mode == "kernels":
                    interpret()
                code = pytest.main([*options, "-rfE", *more, *tests])
            except BaseException:
                code = 99
            sys.stdout.flush()
            os._exit(int(code))
        end = time.monotonic() + limit
        while time.monotonic() < end:
            done, status = os.waitpid(child, os.WNOHANG)
            if done:
                break
            time.sleep(0.02)
        else:
            os.killpg(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return "timeout", "timeout"
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)  # what the tests left behind
        text = log.read_text(encoding="utf-8", errors="replace")
        if os.WIFEXITED(status) and os.WEXITSTATUS(status) == 0:
            return "passed", ""
        failed = re.search(r"^(?:FAILED|ERROR) (tests/.*?)(?: - |$)", text, re.MULTILINE)
        return "failed", failed[1] if failed and "::" in failed[1] else "collection"

    def judge(self, mutant: Mutant, selection: Selection, most: float) -> None:
        """Find whether any test notices a mutant, with `most` seconds of tests that it has not met yet."""
        path = self.tree / mutant.file
        original, stat = path.read_bytes(), path.stat()
        begin = time.monotonic()
        covering = selection.of(mutant)
        waiting = covering[mutant.tests :]
        if most > FIRST:
            waiting += [test for test in selection.neighbours(mutant) if test not in set(covering)]
        mutant.status, chosen, total = "survived" if covering else "not covered", [], 0.0
        for test in waiting:
            if test not in self.bad and total + selection.seconds[test] <= most:
                chosen.append(test)
                total += selection.seconds[test]
        mutant.tests += len(chosen)
        while chosen:
            try:
                path.write_text(mutant.text, encoding="utf-8")
                result, by = self.run(chosen, mutant.mode, 60.0 + 5.0 * total)
            finally:
                path.write_bytes(original)
                os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            if (
                result != "passed"
                and "::" not in by
                and (lost := self.not_found())
                and self.run(lost, mutant.mode, 60.0, "--collect-only")[0] != "passed"
            ):
                self.bad |= {*lost}  # pytest does not find them by their names
                chosen = [test for test in chosen if test not in self.bad]
                continue
            if result != "passed":
                mutant.status, mutant.by = "killed", by
            break
        mutant.seconds = round(mutant.seconds + time.monotonic() - begin, 1)

    def not_found(self) -> list[str]:
        """Return the tests that pytest did not find in the last run."""
        text = (self.work / "log.txt").read_text(encoding="utf-8", errors="replace")
        return re.findall(rf"^ERROR: not found: {re.escape(str(self.tree))}/(.*)$", text, re.MULTILINE)

    def verify(self, mutants: list[Mutant]) -> list[Mutant]:
        """Return the mutants that were killed by a test that fails on the original too."""
        files: dict[tuple[str, str], set[str]] = {}
        for mutant in mutants:
            if mutant.status == "killed" and "::" in mutant.by:
                files.setdefault((mutant.mode, mutant.by.split("::")[0]), set()).add(mutant.by)
        for (mode, _), tests in files.items():
            new = sorted(tests - self.verified)
            result, by = self.run(new, mode, 300.0) if new else ("passed", "")
            while result != "passed":
                self.bad |= {by} if "::" in by else tests
                tests -= self.bad
                result, by = self.run(sorted(tests), mode, 300.0) if tests else ("passed", "")
            self.verified |= tests
        return [mutant for mutant in mutants if mutant.by in self.bad]


def copy_tree(work: Path) -> None:
    """Copy the sources, and what numba has compiled from them."""
    shutil.rmtree(work, ignore_errors=True)
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split(
        "\n"
    )
    compiled = [str(path.relative_to(ROOT)) for path in (ROOT / "cinegen").rglob("*.nb[ic]")]
    for name in [*filter(None, listed), *compiled]:
        (work / "tree" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, work / "tree" / name)


def report(mutants: list[Mutant]) -> None:
    """Print the score by package and what survives."""
    table: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for mutant in mutants:
        package = "/".join(mutant.file.split("/")[:-1])
        for key in (package, "all"):
            table[key][mutant.status] += 1
    print(f"| package | mutants | killed | survived | not covered | score |\n{'| --- ' * 6}|")
    for package, counts in sorted(table.items(), key=lambda pair: (pair[0] == "all", pair[0])):
        total, killed = counts.total(), counts["killed"]
        numbers = total, killed, counts["survived"], counts["not covered"], f"{killed / total:.0%}"
        print(f"| {package} | {' | '.join(map(str, numbers))} |")
    for mutant in mutants:
        if mutant.status != "killed":
            print(f"\n{mutant.file}:{mutant.line} {mutant.operator} {mutant.status} ({mutant.tests} tests)")
            print(f"  - {mutant.before}\n  + {mutant.after}")


def run(work: Path, results: Path, mutants: list[Mutant]) -> None:
    """Judge all mutants, the survivors of the first tests again with more."""
    runner, selections = Runner(work), {mode: Selection(work, mode) for mode in {mutant.mode for mutant in mutants}}

    def judge(which: list[Mutant], most: float) -> None:
        for mutant in which:
            runner.judge(mutant, selections[mutant.mode], most)
            results.write_text(json.dumps([asdict(entry) for entry in mutants]), encoding="utf-8")
            where = f"{mutant.file}:{mutant.line}"
            print(
                f"{mutants.index(mutant):4} {mutant.status:11} {mutant.seconds:6.1f} s {where} {mutant.by}", flush=True
            )

    judge([mutant for mutant in mutants if not mutant.status], FIRST)
    judge([mutant for mutant in mutants if mutant.status != "killed"], MOST - FIRST)
    while again := runner.verify(mutants):
        for mutant in again:
            mutant.tests, mutant.by = 0, ""
        judge(again, MOST)
    results.write_text(json.dumps([asdict(entry) for entry in mutants]), encoding="utf-8")


def main() -> None:
    """Run it all."""
    parser = argparse.ArgumentParser(description="Mutation testing of the core.")
    parser.add_argument("--sample", type=int, default=300)
    parser.add_argument("--seed", type=int, default=19)
    parser.add_argument("--kernels", action="store_true", help="mutate the kernels alone")
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "mutations")
    parser.add_argument("--keep", action="store_true", help="use the copy and the coverage of an earlier run")
    parser.add_argument("--report", action="store_true", help="only print the result so far")
    options = parser.parse_args()
    work: Path = options.work.resolve()
    results = work / "results.json"
    if not options.keep and not options.report:
        copy_tree(work)
        with ThreadPoolExecutor() as pool:
            list(pool.map(measure, [work, work], ["kernels"] if options.kernels else ["python", "kernels"]))
    if not results.exists():
        drawn = draw(work / "tree", options.sample, options.seed, options.kernels)
        results.write_text(json.dumps([asdict(mutant) for mutant in drawn]), encoding="utf-8")
    mutants = [Mutant(**entry) for entry in json.loads(results.read_text(encoding="utf-8"))]
    if not options.report:
        run(work, results, mutants)
    report(mutants)


if __name__ == "__main__":
    main()
