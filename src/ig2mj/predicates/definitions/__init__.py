"""The logical predicates of the paper's table A.1, one file each."""
