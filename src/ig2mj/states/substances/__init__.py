"""Substances in containers and on objects (docs/design/substances.md). Scenes that name none do not have these
states."""
