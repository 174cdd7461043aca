"""All families; the catalogue is made of their CATEGORIES."""

from . import cabinets, chairs, cookware, fridges, fruit, books, packages, sinks, stoves, tables, tableware

FAMILIES = (cabinets, chairs, cookware, fridges, fruit, books, packages, sinks, stoves, tables, tableware)
