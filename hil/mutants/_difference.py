"""Where a defect would make a difference: both the expression as it is and the changed one are evaluated, and
the product goes on with the one as it is.

A case in which they are always equal cannot notice the defect (weak mutation: Howden, "Weak mutation testing
and completeness of test sets", IEEE Transactions on Software Engineering 8 (1982), 371-379). One run tells it
for many defects at once.

The largest expression around the change that only reads is compared: in `if a and b < c` that is the whole
condition. Where a call is in the way, the operator alone is evaluated twice, on the same operands. What can
have an effect of its own is never done twice: there, a defect counts as different wherever it is reached.
"""

from __future__ import annotations

import ast
import inspect
import marshal
import operator
import textwrap
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any, Final

from hil.mutants._mutant import Edit, Mutant
from hil.mutants._patch import HOOK, Patch, changed_source, compiled, function_of, innermost

_READS: Final = (
    ast.Name,
    ast.Attribute,
    ast.Constant,
    ast.BinOp,
    ast.UnaryOp,
    ast.BoolOp,
    ast.Compare,
    ast.IfExp,
    ast.Subscript,
    ast.Slice,
    ast.Tuple,
    ast.List,
    ast.Set,
    ast.Dict,
    ast.ListComp,
    ast.SetComp,
    ast.DictComp,
    ast.GeneratorExp,
    ast.Call,
    ast.Starred,
)
_NO_VALUES: Final = (ast.Slice, ast.Starred, ast.GeneratorExp)
"""They stand in an expression only, or are used up by the first who reads them."""
_PURE_CALLS: Final = frozenset(
    [
        "abs",
        "all",
        "any",
        "bool",
        "divmod",
        "float",
        "frozenset",
        "int",
        "isinstance",
        "len",
        "max",
        "min",
        "range",
        "round",
        "sum",
        "tuple",
    ]
)
_PURE_MODULES: Final = frozenset({"math"})
_PURE_METHODS: Final = frozenset(
    {"bit_length", "endswith", "items", "keys", "startswith", "to_bytes", "values"}
)
_LOAD: Final = ast.Load()
_MISSING: Final = object()


def _same(one: object, other: object) -> bool:
    """Return whether nothing can go on differently with the one than with the other."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, float):
        return repr(one) == repr(other)  # 0.0 and -0.0 differ, and nan is nan
    return bool(one == other)


class Witness:
    """What the changed functions tell: the global that they find under `HOOK`.

    Args:
        found: Gets the names of the defects that make a difference.

    """

    def __init__(self, found: set[str]) -> None:
        self._found = found
        self._held: dict[str, list[object]] = {}

    def reached(self, name: str) -> None:
        """Note a defect that is different wherever it is reached."""
        self._found.add(name)

    def value(self, name: str, value: Any, changed: Callable[[], object]) -> Any:
        """Return a value; note whether the changed expression has another one."""
        if name not in self._found:
            self._compare(name, value, changed)
        return value

    def truth(self, name: str, value: Any, changed: Callable[[], object]) -> Any:
        """Return a condition; note whether the changed one is not as true."""
        if name not in self._found:
            self._compare(name, bool(value), lambda: bool(changed()))
        return value

    def operands(self, name: str, symbol: str, changed: str, *operands: Any) -> Any:
        """Return what an operator makes of operands; note whether the other one makes something else."""
        return self.value(name, _OPERATION[symbol](*operands), lambda: _OPERATION[changed](*operands))

    def both(self, name: str, function: Callable[..., Any], changed: Callable[..., Any]) -> Any:
        """Return a function that notes whether the other one would return something else."""

        def call(*arguments: Any, **options: Any) -> Any:
            if len(arguments) == 1:
                arguments = (list(arguments[0]),)  # it may be an iterator
            return self.value(name, function(*arguments, **options), lambda: changed(*arguments, **options))

        return call

    def hold(self, name: str, value: Any) -> Any:
        """Return a value, and keep it for `differs`."""
        self._held.setdefault(name, []).append(value)
        return value

    def differs(self, name: str, value: Any) -> Any:
        """Return a value; note whether it is another one than that kept last."""
        kept = self._held[name].pop()
        return self.value(name, value, lambda: kept)

    def sums(self, name: str, sum_: Callable[[], object], changed: Callable[[], object]) -> None:
        """Note whether two sums differ; one that cannot be made, as of a list and a tuple, does."""
        if name not in self._found:
            self._compare(name, True, lambda: _same(sum_(), changed()))

    def before(self, name: str, *targets: Callable[[], object]) -> None:
        """Keep what attributes and elements have before an assignment."""
        self._held.setdefault(name, []).append([_read(one) for one in targets])

    def after(self, name: str, *targets: Callable[[], object]) -> None:
        """Note whether an assignment has changed them."""
        kept = self._held[name].pop()
        if name not in self._found:
            self._compare(name, [_read(one) for one in targets], lambda: kept)

    def _compare(self, name: str, value: object, changed: Callable[[], object]) -> None:
        try:
            other = changed()
            if isinstance(value, list) and isinstance(other, list) and len(value) == len(other):
                same = all(map(_same, value, other))
            else:
                same = _same(value, other)
        except Exception:  # noqa: BLE001 - the changed expression fails, or its value cannot be compared
            same = False
        if not same:
            self._found.add(name)


def _read(target: Callable[[], object]) -> object:
    try:
        return target()
    except (AttributeError, LookupError):
        return _MISSING


_OPERATION: Final[dict[str, Callable[..., Any]]] = {
    "Lt": operator.lt,
    "LtE": operator.le,
    "Gt": operator.gt,
    "GtE": operator.ge,
    "Eq": operator.eq,
    "NotEq": operator.ne,
    "Is": operator.is_,
    "IsNot": operator.is_not,
    "In": lambda one, many: one in many,
    "NotIn": lambda one, many: one not in many,
    "Add": operator.add,
    "Sub": operator.sub,
    "Mult": operator.mul,
    "Div": operator.truediv,
    "FloorDiv": operator.floordiv,
    "LShift": operator.lshift,
    "RShift": operator.rshift,
    "BitAnd": operator.and_,
    "BitOr": operator.or_,
    "BitXor": operator.xor,
    "Not": operator.not_,
    "USub": operator.neg,
    "": lambda value: value,
}


def _is_pure(node: ast.AST) -> bool:
    """Return whether to evaluate an expression has no effect: it only reads."""
    inside = [one.target for one in ast.walk(node) if isinstance(one, ast.comprehension)]
    own = {id(part) for target in inside for part in ast.walk(target)}
    return all(
        id(one) in own or (_reads(one) and isinstance(getattr(one, "ctx", _LOAD), ast.Load))
        for one in ast.walk(node)
        if isinstance(one, ast.expr)
    )


def _reads(node: ast.expr) -> bool:
    if isinstance(node, ast.Call):
        match node.func:
            case ast.Name(id=name):
                return name in _PURE_CALLS
            case ast.Attribute(value=ast.Name(id=module)) if module in _PURE_MODULES:
                return True
            case ast.Attribute(attr=name):
                return name in _PURE_METHODS
            case _:
                return False
    return isinstance(node, _READS)


Pair = tuple[Any, Any]
"""A node of the source as it is, and of the changed one."""


def _path(one: Any, other: Any) -> list[Pair]:
    """Return the pairs of nodes from the whole down to the smallest one that holds all that has changed."""
    path: list[Pair] = [(one, other)]
    if type(one) is not type(other):
        return path
    differing: list[Pair] = []
    for name in one._fields:
        here, there = getattr(one, name), getattr(other, name)
        if not isinstance(here, list):
            here, there = [here], [there]
        if len(here) != len(there):
            return path
        for part, changed in zip(here, there, strict=True):
            if isinstance(part, ast.AST) and isinstance(changed, ast.AST):
                if ast.dump(part) != ast.dump(changed):
                    differing.append((part, changed))
            elif part != changed or type(part) is not type(changed):
                return path
    return path + _path(*differing[0]) if len(differing) == 1 else path


@dataclass
class _Body:
    """A function, and what is to be put into it."""

    definition: ast.FunctionDef
    wraps: dict[int, list[Callable[[ast.expr], ast.expr]]] = field(default_factory=dict)
    """For the identity of an expression what is put around it."""
    before: dict[int, list[ast.stmt]] = field(default_factory=dict)
    after: dict[int, list[ast.stmt]] = field(default_factory=dict)
    """For the identity of a statement those that are put in front of it, and behind it."""

    def wrap(self, node: ast.expr, around: Callable[[ast.expr], ast.expr]) -> None:
        self.wraps.setdefault(id(node), []).append(around)

    def finished(self) -> ast.FunctionDef:
        """Return the function with all that; the nodes are changed."""
        done = _Insertion(self).visit(self.definition)
        assert isinstance(done, ast.FunctionDef)  # nothing is put around the whole
        return done


class _Insertion(ast.NodeTransformer):
    def __init__(self, body: _Body) -> None:
        self._body = body

    def visit(self, node: ast.AST) -> Any:
        key = id(node)
        made: Any = self.generic_visit(node)
        if isinstance(node, ast.expr):
            for around in self._body.wraps.get(key, ()):
                made = ast.copy_location(around(made), node)
            return made
        before, after = self._body.before.get(key, []), self._body.after.get(key, [])
        for one in (*before, *after):
            ast.copy_location(one, node)
        return [*before, made, *after] if before or after else made


def _call(method: str, name: str, *arguments: ast.expr) -> ast.expr:
    function = ast.Attribute(ast.Name(HOOK, ast.Load()), method, ast.Load())
    return ast.Call(function, [ast.Constant(name), *arguments], [])


def _later(node: ast.expr) -> ast.expr:
    nothing = ast.arguments(posonlyargs=[], args=[], kwonlyargs=[], kw_defaults=[], defaults=[])
    return ast.Lambda(nothing, node)


def _insert(body: _Body, name: str, path: Sequence[Pair], line: int) -> None:
    """Put into a function what tells that a defect makes a difference."""
    inner = [pair for pair in path if isinstance(pair[0], (ast.expr, ast.stmt))]
    while inner and isinstance(inner[-1][0], _NO_VALUES):
        inner.pop()
    smallest = inner[-1]
    if isinstance(smallest[0], ast.expr) and isinstance(smallest[1], ast.expr):
        whole = _largest_pure(inner)
        if whole is not None:
            node, changed = whole
            parent = next((one for one, _ in reversed(path) if _is_condition(one, node)), None)
            method = "value" if parent is None else "truth"
            body.wrap(node, lambda made: _call(method, name, made, _later(changed)))
            return
        if _insert_operator(body, name, *smallest):
            return
    elif isinstance(smallest[0], ast.stmt) and _insert_around(body, name, *smallest):
        return
    statement = innermost(body.definition.body, line)
    assert statement is not None  # the change is in one
    body.before.setdefault(id(statement), []).append(ast.Expr(_call("reached", name)))


def _is_condition(parent: ast.AST, node: ast.expr) -> bool:
    return isinstance(parent, (ast.If, ast.While, ast.IfExp)) and parent.test is node


def _largest_pure(path: Sequence[Pair]) -> Pair | None:
    """Return the largest expression around the change that only reads, as long as what is around it does."""
    found = None
    for node, changed in reversed(path):
        if not (isinstance(node, ast.expr) and isinstance(changed, ast.expr)):
            break
        if not (_is_pure(node) and _is_pure(changed)):
            break
        if not isinstance(node, _NO_VALUES):
            found = node, changed
    # A constant or a function alone is always another one.
    return None if found is None or isinstance(found[0], (ast.Constant, ast.Name)) else found


def _insert_operator(body: _Body, name: str, node: ast.expr, changed: ast.expr) -> bool:
    """Compare two operators on the same operands, two functions with the same arguments, or two arguments."""
    match node, changed:
        case ast.Compare(ops=[one]), ast.Compare(ops=[other]) if type(one) is not type(other):
            body.wrap(node, lambda made: _operands(name, one, other, made.left, made.comparators[0]))  # type: ignore[attr-defined]
        case ast.BinOp(op=one), ast.BinOp(op=other) if type(one) is not type(other):
            body.wrap(node, lambda made: _operands(name, one, other, made.left, made.right))  # type: ignore[attr-defined]
        case ast.UnaryOp(op=one), _ if ast.dump(node.operand) == ast.dump(changed):
            body.wrap(node, lambda made: _operands(name, one, None, made.operand))  # type: ignore[attr-defined]
        case ast.Name(id="min" | "max"), ast.Name():
            body.wrap(node, lambda made: _call("both", name, made, changed))
        case ast.Call(args=[first, second, *_]), ast.Call(args=[third, *_]) if ast.dump(second) == ast.dump(
            third
        ):
            body.wrap(first, lambda made: _call("hold", name, made))
            body.wrap(second, lambda made: _call("differs", name, made))
        case _:
            return False
    return True


def _operands(name: str, one: ast.AST, other: ast.AST | None, *operands: ast.expr) -> ast.expr:
    changed = "" if other is None else type(other).__name__
    return _call("operands", name, ast.Constant(type(one).__name__), ast.Constant(changed), *operands)


def _insert_around(body: _Body, name: str, node: ast.stmt, changed: ast.stmt) -> bool:
    """Look at what an assignment changes, or at the other sum."""
    if not isinstance(node, (ast.Assign, ast.AugAssign)) or not _is_pure(node.value):
        return False
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    read = [_loaded(one) for one in targets]
    if not all(_is_pure(one) for one in read):
        return False
    if isinstance(changed, ast.Pass):
        for method, statements in (("before", body.before), ("after", body.after)):
            call = _call(method, name, *(_later(one) for one in read))
            statements.setdefault(id(node), []).append(ast.Expr(call))
        return True
    if isinstance(node, ast.AugAssign) and isinstance(changed, ast.AugAssign):
        one, other = (ast.BinOp(read[0], op, node.value) for op in (node.op, changed.op))
        body.before.setdefault(id(node), []).append(ast.Expr(_call("sums", name, _later(one), _later(other))))
        return True
    return False


def _loaded(target: ast.expr) -> ast.expr:
    """Return an expression that reads what an assignment writes."""
    (statement,) = ast.parse(ast.unparse(target)).body
    assert isinstance(statement, ast.Expr)  # parsed just now
    return statement.value


def differences_of(mutants: Iterable[Mutant]) -> Patch:
    """Return code that does what the product does, and notes the defects that would make a difference.

    Raises:
        TargetChangedError: The code that one of them changes is not what the catalogue says.

    """
    bodies: dict[FunctionType, _Body] = {}
    edits: dict[FunctionType, Edit] = {}
    for mutant in mutants:
        for edit in mutant.edits:
            function = function_of(edit)
            change = changed_source(edit, function)
            body = bodies.get(function)
            if body is None:
                body = bodies[function] = _Body(_definition(inspect.getsource(function)))
                edits[function] = edit
            path = _path(body.definition, _definition(change.source))
            _insert(body, mutant.name, path, change.line)
    places = tuple(
        (edits[function], marshal.dumps(compiled(function, body.finished(), edits[function])))
        for function, body in bodies.items()
    )
    return Patch(places, Witness)


def _definition(source: str) -> ast.FunctionDef:
    (definition,) = ast.parse(textwrap.dedent(source)).body
    assert isinstance(definition, ast.FunctionDef)  # `function_of` found no other
    return definition
