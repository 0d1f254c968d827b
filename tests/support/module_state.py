"""Find global state: mutable values held by modules, classes, default arguments or caches."""

from __future__ import annotations

import ast
from collections.abc import Iterator

CONTAINERS = {
    *("dict", "list", "set", "bytearray", "defaultdict", "OrderedDict", "Counter", "deque", "ChainMap", "UserDict"),
    *("UserList", "SimpleNamespace"),
}
"""Types that may be constant tables, if named like one and never changed."""
STATEFUL = {
    *("Lock", "RLock", "Condition", "Semaphore", "BoundedSemaphore", "Event", "Barrier", "local", "ContextVar"),
    *("WeakKeyDictionary", "WeakValueDictionary", "WeakSet", "Queue", "LifoQueue", "PriorityQueue", "SimpleQueue"),
    *("ThreadPoolExecutor", "ProcessPoolExecutor", "count", "cycle", "iter", "default_rng", "RandomState"),
}
"""Types that are of no use unless they change."""
HARMLESS = {"TypeVar", "ParamSpec", "NewType"}
MUTATORS = {
    *("append", "extend", "insert", "add", "update", "setdefault", "pop", "popitem", "clear", "remove", "discard"),
    *("sort", "reverse", "appendleft", "extendleft", "popleft", "rotate", "move_to_end", "fill", "put", "resize"),
    *("intersection_update", "difference_update", "symmetric_difference_update", "subtract", "acquire"),
    *("__setitem__", "__delitem__", "__setattr__", "__delattr__", "__ior__", "__iadd__"),
}
CACHES = {"cache", "lru_cache"}

_DISPLAYS = (ast.Dict, ast.List, ast.Set, ast.DictComp, ast.ListComp, ast.SetComp)
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)
Finding = tuple[int, str]
"""Line, and what is wrong there."""


def state_in(tree: ast.Module) -> list[Finding]:
    """Return everything mutable that a module holds, and its changes of other modules' values."""
    return sorted({*_held(tree.body), *_changed(tree), *_kept_by_functions(tree)})


def _held(body: list[ast.stmt], owner: str = "") -> Iterator[Finding]:
    """Yield assignments of mutable values in the body of a module, or of the class ``owner``."""
    for statement in body:
        if isinstance(statement, ast.ClassDef):
            yield from _held(statement.body, statement.name)
        elif not isinstance(statement, _FUNCTIONS):
            for part in _own_parts(statement):
                yield from _held_by(part, owner)
            for inner in _blocks(statement):
                yield from _held(inner, owner)


def _blocks(statement: ast.stmt) -> Iterator[list[ast.stmt]]:
    """Yield the blocks of an ``if``, ``try``, ``with``, loop or ``match``."""
    for name in ("body", "orelse", "finalbody"):
        yield getattr(statement, name, [])
    for part in (*getattr(statement, "handlers", []), *getattr(statement, "cases", [])):
        yield part.body


def _own_parts(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a statement and its expressions, without its blocks and without functions."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, (ast.stmt, ast.excepthandler, ast.match_case, *_FUNCTIONS)):
            yield from _own_parts(child)


def _held_by(node: ast.AST, owner: str) -> Iterator[Finding]:
    if isinstance(node, ast.Assign):
        targets, value = node.targets, node.value
    elif isinstance(node, ast.AnnAssign | ast.NamedExpr) and node.value is not None:
        targets, value = [node.target], node.value
    elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
        yield node.lineno, f"{node.target.id} changes"
        return
    else:
        return
    stored = [each for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]
    names = [each.id for each in stored if isinstance(each.ctx, ast.Store)]
    why = _what_changes(value)
    for name in names:
        is_table = name.isupper() or (name.startswith("__") and name.endswith("__"))
        if why == "stateful" or (why == "container" and not is_table):
            yield node.lineno, f"{owner or 'the module'} holds {name} = {ast.unparse(value)[:60]}"
        elif why == "unknown" and not is_table and not owner:
            yield node.lineno, f"the module holds {name}, made by a call; constants are upper-case"


def _what_changes(value: ast.expr) -> str | None:
    """Return "stateful", "container" or "unknown" (a call) for what ``value`` is or holds; None if it is immutable."""
    found = {_kind(each) for each in _values(value)}
    return next((kind for kind in ("stateful", "container", "unknown") if kind in found), None)


def _values(value: ast.expr) -> Iterator[ast.expr]:
    """Yield what an expression may evaluate to, and what that holds."""
    yield value
    if isinstance(value, ast.Call):
        inner: list[ast.expr] = [*value.args, *[keyword.value for keyword in value.keywords]]
        for each in inner:  # arguments of a call may be kept by its result, as a lock in a tuple
            yield from (part for part in _values(each) if _kind(part) == "stateful")
    elif isinstance(value, ast.IfExp | ast.BoolOp | ast.NamedExpr | ast.Tuple | ast.List | ast.Set | ast.Dict):
        for child in ast.iter_child_nodes(value):
            if isinstance(child, ast.expr):
                yield from _values(child)
    elif isinstance(value, ast.Starred | ast.BinOp | ast.DictComp | ast.ListComp | ast.SetComp):
        for child in ast.iter_child_nodes(value):
            if isinstance(child, ast.expr):
                yield from (part for part in _values(child) if _kind(part) != "unknown")


def _kind(value: ast.expr) -> str | None:
    if isinstance(value, _DISPLAYS):
        return "container"
    if isinstance(value, ast.GeneratorExp):
        return "generator"
    if not isinstance(value, ast.Call):
        return None
    called = ast.unparse(value.func).rpartition(".")[2].partition("[")[0]
    if called in STATEFUL:
        return "stateful"
    return "container" if called in CONTAINERS else None if called in HARMLESS else "unknown"


def _kept_by_functions(tree: ast.Module) -> Iterator[Finding]:
    """Yield mutable default arguments, and caches keyed by arguments."""
    for node in ast.walk(tree):
        if not isinstance(node, _FUNCTIONS):
            continue
        arguments = node.args
        for default in [*arguments.defaults, *[each for each in arguments.kw_defaults if each is not None]]:
            if _what_changes(default) in ("stateful", "container"):
                yield default.lineno, f"a default is {ast.unparse(default)}"
        if isinstance(node, ast.Lambda):
            continue
        given = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
        for decorator in node.decorator_list:
            made = decorator.func if isinstance(decorator, ast.Call) else decorator
            if ast.unparse(made).rpartition(".")[2] in CACHES and any(given):
                yield node.lineno, f"{node.name} is cached for what it is given"


def _changed(tree: ast.Module) -> Iterator[Finding]:
    """Yield ``global`` statements, and changes of values that belong to a module or a class."""
    shared = {name for statement in tree.body for name in _bound(statement)}
    modules = {
        (alias.asname or alias.name).partition(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    yield from _changed_in(tree, shared, {name for name in modules if not name.isupper()})


def _bound(node: ast.AST) -> Iterator[str]:
    """Yield the names that a statement binds in its own scope, not in nested functions and classes."""
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
        yield node.name
        return
    if isinstance(node, ast.Import | ast.ImportFrom):
        yield from ((alias.asname or alias.name).partition(".")[0] for alias in node.names)
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, ast.ExceptHandler | ast.MatchAs | ast.MatchStar) and node.name:
        yield node.name
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.Lambda):
            yield from _bound(child)


def _changed_in(scope: ast.AST, shared: set[str], modules: set[str]) -> Iterator[Finding]:
    """Yield changes in a scope and nested ones; ``shared`` holds names that refer to values of the module."""
    for child in ast.iter_child_nodes(scope):
        if isinstance(child, _FUNCTIONS):
            yield from _changed_in(child, _shared_in(child, shared), modules)
            continue
        if isinstance(child, ast.Global):
            yield child.lineno, f"global {', '.join(child.names)}"
        elif _is_change(child, shared, modules):
            yield child.lineno, f"{ast.unparse(child)[:60]} changes what belongs to a module or a class"
        yield from _changed_in(child, shared, modules)


def _shared_in(function: ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda, shared: set[str]) -> set[str]:
    """Return names that refer to shared values in a function: not bound there, or bound to shared values."""
    arguments = function.args
    given = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    body = [function.body] if isinstance(function, ast.Lambda) else function.body
    own = {each.arg for each in given if each} | {name for statement in body for name in _bound(statement)}
    if not isinstance(function, ast.Lambda):
        own -= {name for node in ast.walk(function) if isinstance(node, ast.Global) for name in node.names}
        nested = {name for statement in body for node in ast.walk(statement) for name in _imported(node)}
        own -= nested
        shared = shared | nested
    inner = shared - own
    for node in ast.walk(function):
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Name | ast.Attribute | ast.Subscript):
            root = _root(node.value)
            if isinstance(root, ast.Name) and root.id in inner and _names_a_table(node.value):
                inner |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return inner


def _imported(node: ast.AST) -> Iterator[str]:
    if isinstance(node, ast.Import | ast.ImportFrom):
        yield from ((alias.asname or alias.name).partition(".")[0] for alias in node.names)


def _names_a_table(value: ast.expr) -> bool:
    return any(
        (each.id if isinstance(each, ast.Name) else each.attr).isupper()
        for each in ast.walk(value)
        if isinstance(each, ast.Name | ast.Attribute)
    )


def _root(node: ast.expr) -> ast.expr:
    """Return the expression at the base of attributes and subscripts."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node


def _is_shared(node: ast.expr, shared: set[str]) -> bool:
    """Return whether ``node`` is, or belongs to, a value of a module or a class."""
    root = _root(node)
    if isinstance(root, ast.Call):
        return ast.unparse(root.func) in ("type", "globals", "vars", "super")
    if not isinstance(root, ast.Name):
        return False
    if root.id in shared or root.id == "cls":
        return True
    # Through an object: its class, or an upper-case attribute of its class.
    attributes = [each.attr for each in ast.walk(node) if isinstance(each, ast.Attribute)]
    return "__class__" in attributes or (root.id == "self" and bool(attributes) and attributes[-1].isupper())


def _is_change(node: ast.AST, shared: set[str], modules: set[str]) -> bool:
    if isinstance(node, ast.Attribute | ast.Subscript) and not isinstance(node.ctx, ast.Load):
        return _is_shared(node, shared)
    if not isinstance(node, ast.Call):
        return False
    if isinstance(node.func, ast.Name) and node.func.id in ("setattr", "delattr") and node.args:
        return _is_shared(node.args[0], shared)
    if not isinstance(node.func, ast.Attribute) or node.func.attr not in MUTATORS:
        return False
    of = node.func.value
    # A function of a module may have the name of such a method.
    is_module = isinstance(of, ast.Name) and of.id in modules
    return not is_module and _is_shared(of, shared)
