"""How well activities and primitives are planned and carried out."""
