"""Activities in BDDL: BEHAVIOR-100 and BEHAVIOR-1K, bound to homes and compiled to goals."""
