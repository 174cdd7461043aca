"""Substances in containers and on objects (docs/design/substances.md). A scene that names none has no part of it."""
