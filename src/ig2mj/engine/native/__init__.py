"""The native engine: C MuJoCo with sleeping, one world or many on a thread pool."""
