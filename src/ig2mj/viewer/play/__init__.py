"""`ig2mj play`: a person drives a robot by keyboard and mouse, in MuJoCo's viewer (docs/guide/playing.md)."""
