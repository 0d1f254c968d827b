"""Loops of kernels that have no bound of their own, found in the source."""

import ast
from collections.abc import Iterator

_UP, _DOWN = (ast.Lt, ast.LtE), (ast.Gt, ast.GtE)


def unbounded_loops(tree: ast.AST) -> Iterator[tuple[str, ast.While]]:
    """(function, loop) of each ``while`` that neither counts nor takes turns, which are limited."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            for loop in ast.walk(function):
                if isinstance(loop, ast.While) and not _counts(loop) and not _takes_turns(loop):
                    yield function.name, loop


def _counts(loop: ast.While) -> bool:
    """Whether a name is only ever counted up in the loop, in each round, and compared with a limit that stays."""
    tests = loop.test.values if isinstance(loop.test, ast.BoolOp) and isinstance(loop.test.op, ast.And) else [loop.test]
    written = {name.id for name in ast.walk(loop) if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)}
    for test in tests:
        if isinstance(test, ast.Compare) and len(test.ops) == 1 and isinstance(test.left, ast.Name):
            op, limit = test.ops[0], test.comparators[0]
            up = isinstance(op, _UP)
            if (up or isinstance(op, _DOWN)) and _stays(limit, written) and _steps(loop, test.left.id, up):
                return True
    return False


def _stays(limit: ast.expr, written: set[str]) -> bool:
    """Whether nothing in the loop changes what the counter is compared with."""
    for node in ast.walk(limit):
        if isinstance(node, ast.Name) and node.id in written:
            return False
        if isinstance(node, ast.Attribute) and node.attr not in ("shape", "size", "budget"):
            return False
        if isinstance(node, ast.Call) and ast.unparse(node.func) != "len":
            return False
    return True


def _steps(loop: ast.While, name: str, up: bool) -> bool:
    """Whether each round moves ``name`` by a positive number, one way, and nothing else writes it."""
    writes = [
        node
        for node in ast.walk(loop)
        if isinstance(node, ast.Name) and node.id == name and isinstance(node.ctx, ast.Store)
    ]
    steps = 0
    for statement in loop.body:
        if isinstance(statement, ast.AugAssign) and ast.unparse(statement.target) == name:
            way = isinstance(statement.op, ast.Add if up else ast.Sub)
            steps += way and isinstance(statement.value, ast.Constant) and statement.value.value > 0
        elif not steps and any(isinstance(node, ast.Continue) for node in ast.walk(statement)):
            return False
    return 0 < steps == len(writes)


def _takes_turns(loop: ast.While) -> bool:
    """Whether each round, before any ``continue``, may end the loop: by the turns of an edit, or by BoundExceeded."""
    if _asks(loop.test):
        return True
    for statement in loop.body:
        if isinstance(statement, ast.If):
            last = statement.body[-1]
            if _asks(statement.test) and isinstance(last, ast.Return | ast.Break):
                return True
            if isinstance(last, ast.Raise) and ast.unparse(last) == "raise BoundExceeded":
                return True
        if any(isinstance(node, ast.Continue) for node in ast.walk(statement)):
            return False
    return False


def _asks(test: ast.expr) -> bool:
    return any(isinstance(node, ast.Call) and ast.unparse(node.func) == "is_spent" for node in ast.walk(test))
