# MuJoCo's bindings are compiled and come without types; every attribute is accepted.
from typing import Any

def __getattr__(name: str) -> Any: ...
