"""ig2mj: iGibson 2.0 on MuJoCo and JAX."""
