"""Definitions as bddl's own parser reads them, for comparison with ours."""

import json
import subprocess
import textwrap

from ig2mj.predicates import logic
from ig2mj.tasks.bddl.definitions import read_problem


def package_says(python: str, source: str, domain: str, names: list[str]) -> dict:
    """What bddl's own parser makes of definitions; a process of its own, because it is slow to import and warns."""
    code = """
        import json, sys, warnings
        warnings.simplefilter("ignore")
        sys.path.insert(0, SOURCE) if SOURCE else None
        from bddl.parsing import parse_problem
        print(json.dumps({name: parse_problem(name, 0, DOMAIN) for name in json.load(sys.stdin)}))
    """
    code = textwrap.dedent(code).replace("SOURCE", repr(source)).replace("DOMAIN", repr(domain))
    done = subprocess.run(
        [python, "-W", "ignore", "-c", code], input=json.dumps(names), capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def as_lists(e: logic.Expression) -> list:
    """An expression in the form in which bddl's parser leaves conditions."""
    match e:
        case logic.Atom(predicate, arguments):
            return [predicate, *arguments]
        case logic.Not(part):
            return ["not", as_lists(part)]
        case logic.And(parts):
            return ["and", *map(as_lists, parts)]
        case logic.Or(parts):
            return ["or", *map(as_lists, parts)]
        case logic.ForAll(x, group, body):
            return ["forall", [x, "-", group], as_lists(body)]
        case logic.Exists(x, group, body):
            return ["exists", [x, "-", group], as_lists(body)]
        case logic.ForN(n, x, group, body):
            return ["forn", [str(n)], [x, "-", group], as_lists(body)]
        case logic.ForPairs((x, g), (y, h), body):
            return ["forpairs", [x, "-", g], [y, "-", h], as_lists(body)]
        case logic.ForNPairs(n, (x, g), (y, h), body):
            return ["fornpairs", [str(n)], [x, "-", g], [y, "-", h], as_lists(body)]
    raise TypeError(e)


def plain(tree, bound: frozenset = frozenset()):
    """bddl's lists with what our expressions do not keep taken out: `imply`, question marks of names of objects."""
    if isinstance(tree, str):
        return tree if tree in bound else tree.removeprefix("?")
    if tree and tree[0] == "imply":
        return ["or", ["not", plain(tree[1], bound)], plain(tree[2], bound)]
    if tree and tree[0] in ("forall", "exists", "forn", "forpairs", "fornpairs"):
        bindings = [part for part in tree[1:-1] if len(part) == 3]
        inner = bound | {part[0] for part in bindings}
        return [tree[0], *tree[1:-1], plain(tree[-1], inner)]
    return [plain(part, bound) for part in tree]


def compare(names: list[str], said: dict, behavior_1k: bool, odd: frozenset[str] = frozenset()) -> None:
    for name in names:
        problem = read_problem(name, behavior_1k)
        _, objects, init, goal = said[name]
        objects = {synset: list(dict.fromkeys(found)) for synset, found in objects.items()}
        assert {s: list(n) for s, n in problem.objects.items()} == objects, name
        rooms = {c[1]: c[2] for c in init if c[0] == "inroom"}
        assert dict(problem.rooms) == rooms, name
        assert list(map(as_lists, problem.init)) == [plain(c) for c in init if c[0] != "inroom"], name
        assert list(map(as_lists, problem.goal)) == list(map(plain, goal)), name
        assert bool(problem.remarks) == (name in odd), name
