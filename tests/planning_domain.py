"""An interpreter of the PDDL that `ig2mj.planning.pddl` writes, to carry plans out in it."""

from __future__ import annotations

import re


def parse(text: str):
    """Nested lists of words."""
    tokens = re.findall(r"[()]|[^\s()]+", re.sub(r";[^\n]*", "", text))

    def read(k):
        found = []
        while k < len(tokens):
            if tokens[k] == "(":
                inner, k = read(k + 1)
                found.append(inner)
            elif tokens[k] == ")":
                return found, k + 1
            else:
                found.append(tokens[k])
                k += 1
        return found, k

    return read(0)[0][0]


def _typed(words):
    kinds, names = {}, []
    k = 0
    while k < len(words):
        if words[k] == "-":
            kinds |= dict.fromkeys(names, words[k + 1])
            names, k = [], k + 2
        else:
            names.append(words[k])
            k += 1
    return kinds


class World:
    """What holds in a PDDL problem."""

    def __init__(self, domain: str, problem: str):
        self.actions = {}
        for part in parse(domain):
            if part[0] == ":action":
                fields = dict(zip(part[2::2], part[3::2], strict=True))
                self.actions[part[1]] = fields
        sections = {part[0]: part[1:] for part in parse(problem) if isinstance(part, list)}
        self.kinds = _typed(sections[":objects"])
        self.facts = {tuple(fact) for fact in sections[":init"]}
        self.goal = sections[":goal"][0]

    def act(self, name: str, arguments: tuple[str, ...]) -> bool:
        """Carries out an action, with any hand that fits; False where its precondition is false."""
        action = self.actions[name]
        kinds = _typed(action[":parameters"])
        names = list(kinds)
        free = [n for n in names[len(arguments) :]]
        hands = [n for n, kind in self.kinds.items() if kind == "hand"] if free else [None]
        for hand in hands:
            bound = dict(zip(names, (*arguments, hand), strict=False))
            if self.true(action[":precondition"], bound):
                add, remove = set(), set()
                self._effects(action[":effect"], bound, add, remove)
                self.facts = (self.facts - remove) | add
                return True
        return False

    def done(self) -> bool:
        return self.true(self.goal, {})

    def true(self, e, bound) -> bool:
        if e[0] == "and":
            return all(self.true(p, bound) for p in e[1:])
        if e[0] == "or":
            return any(self.true(p, bound) for p in e[1:])
        if e[0] == "not":
            return not self.true(e[1], bound)
        if e[0] == "imply":
            return not self.true(e[1], bound) or self.true(e[2], bound)
        if e[0] == "forall":
            return all(self.true(e[2], b) for b in self._each(e[1], bound))
        return tuple(bound.get(x, x) for x in e) in self.facts

    def _each(self, variables, bound):
        ((name, kind),) = _typed(variables).items()
        return [{**bound, name: n} for n, k in self.kinds.items() if k == kind]

    def _effects(self, e, bound, add, remove):
        if e[0] == "and":
            for p in e[1:]:
                self._effects(p, bound, add, remove)
        elif e[0] == "forall":
            for b in self._each(e[1], bound):
                self._effects(e[2], b, add, remove)
        elif e[0] == "not":
            remove.add(tuple(bound.get(x, x) for x in e[1]))
        else:
            add.add(tuple(bound.get(x, x) for x in e))
