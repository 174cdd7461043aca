"""What this machine can run: the checks of `ig2mj doctor`, and the probes that they run in processes of their own."""
